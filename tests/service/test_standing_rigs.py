"""A rig of cameras that stand already: told of and planned for like a design."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from service_helpers import small_rig_text
from typer.testing import CliRunner

from common.errors import InputError
from geometry.head import synthetic_head
from rig.specification.rigfile import parse_rig
from service.cli import app
from service.tasks.designing import write_scan

FIXED = """
[[fixed]]
name = "f{k}"
position_mm = [{x}, -900, {z}]
look_at_mm = [0, 0, 0]
"""
PLACES = ((-260, 0), (0, 0), (260, 0))


def standing() -> str:
    text = small_rig_text().replace("cameras = 4", "cameras = 0")
    return text + "".join(FIXED.format(k=k, x=x, z=z) for k, (x, z) in enumerate(PLACES))


def test_a_rig_of_fixed_cameras_alone_is_read_and_one_camera_is_none() -> None:
    assert len(parse_rig(standing()).fixed) == 3
    with pytest.raises(InputError, match="the rig has 0 cameras"):
        parse_rig(small_rig_text().replace("cameras = 4", "cameras = 0"))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (["--rig", "rig.toml"], "give --scan"),
        (["design.json", "--rig", "rig.toml"], "a plan is of one rig"),
        ([], "a plan is of one rig"),
    ],
)
def test_a_plan_is_of_a_design_or_of_a_rig(given: list[str], words: str, tmp_path: Path) -> None:
    asked = ["plan", *given, "--mount", "m.toml", "--out", str(tmp_path / "plan")]
    done = CliRunner().invoke(app, asked)
    assert done.exit_code == 2
    assert words in done.stderr


@pytest.mark.slow
def test_a_standing_rig_is_told_of_and_planned(tmp_path: Path) -> None:
    write_scan(synthetic_head(), tmp_path / "head.ply")
    (tmp_path / "rig.toml").write_text(standing())
    (tmp_path / "tripods.toml").write_text('schema = "rigwright.mount/1"\nkind = "tripods"\n')
    head, rig = str(tmp_path / "head.ply"), str(tmp_path / "rig.toml")
    out = tmp_path / "out"
    done = CliRunner().invoke(app, ["design", head, "--rig", rig, "--out", str(out), "--json"])
    assert done.exit_code in (0, 3), done.stderr
    design = json.loads((out / "design.json").read_text())
    assert [c["name"] for c in design["cameras"]] == ["f0", "f1", "f2"]
    assert [c["position_mm"][0] for c in design["cameras"]] == [x for x, _ in PLACES]
    assert "told of as it stands" in (out / "report.html").read_text()
    mount, plan = str(tmp_path / "tripods.toml"), tmp_path / "plan"
    asked = ["plan", "--rig", rig, "--scan", head, "--mount", mount, "--out", str(plan), "--json"]
    planned = CliRunner().invoke(app, asked)
    assert planned.exit_code in (0, 3), planned.stderr
    assert len(json.loads((plan / "plan.json").read_text())["mounts"]) == 3
