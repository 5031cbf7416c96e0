"""A design keeps where its scan was, so that a plan finds it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from common.errors import InputError
from service.cli import app
from service.cli.scans import remember_scan, scan_of


@pytest.fixture
def design(tmp_path: Path) -> Path:
    (tmp_path / "heads").mkdir()
    (tmp_path / "heads" / "head.glb").write_bytes(b"head")
    out, partial = tmp_path / "my-rig", tmp_path / ".my-rig-x" / "files"
    partial.mkdir(parents=True)
    (partial / "design.json").write_text(json.dumps({"scan": {"name": "head.glb"}}))
    remember_scan(partial, out, tmp_path / "heads" / "head.glb")
    partial.rename(out)
    return out / "design.json"


def test_a_scan_elsewhere_is_found(design: Path) -> None:
    assert scan_of(design).read_bytes() == b"head"


def test_it_is_found_after_both_moved(design: Path, tmp_path: Path) -> None:
    moved = tmp_path / "moved"
    moved.mkdir()
    shutil.move(design.parent, moved / "my-rig")
    shutil.move(tmp_path / "heads", moved / "heads")
    assert scan_of(moved / "my-rig" / "design.json").read_bytes() == b"head"


def test_a_scan_that_changed_is_told(design: Path, tmp_path: Path) -> None:
    (tmp_path / "heads" / "head.glb").write_bytes(b"haed")
    with pytest.raises(InputError, match="has changed since the design was made; give --scan"):
        scan_of(design)


def test_a_scan_that_is_gone_is_told(design: Path, tmp_path: Path) -> None:
    (tmp_path / "heads" / "head.glb").unlink()
    with pytest.raises(InputError, match=r"head\.glb is not there any more; give --scan"):
        scan_of(design)


def test_a_former_version_s_design_has_its_scan_beside_it(design: Path) -> None:
    design.with_name("scan.json").unlink()
    with pytest.raises(InputError, match=r"head\.glb that .* was made for is not beside it"):
        scan_of(design)
    (design.parent / "head.glb").write_bytes(b"head")
    assert scan_of(design) == design.parent / "head.glb"


@pytest.mark.parametrize("place", ["nowhere/design.json", "my-rig"])
def test_a_design_that_is_not_there_is_told_as_such(
    design: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    del design
    monkeypatch.chdir(tmp_path)
    (tmp_path / "t-slot.toml").write_text('kind = "t-slot"')
    done = CliRunner().invoke(app, ["plan", place, "--mount", "t-slot.toml", "--out", "my-plan"])
    assert done.exit_code == 2
    assert f"the design {place}" in done.stderr
    assert not (tmp_path / "my-plan").exists()
