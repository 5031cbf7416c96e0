"""``rigwright scan``: what was understood, and nothing of the user's is lost."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scanfiles import plain_head
from service_helpers import rigwright_here


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    plain_head().export(tmp_path / "head.ply")
    return tmp_path


def test_it_tells_units_axes_and_face(folder: Path) -> None:
    done = rigwright_here("scan", "head.ply", "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert (told["units"], told["up"], told["front"]) == ("mm", [0.0, 0.0, 1.0], [0.0, -1.0, 0.0])
    assert told["face"]["confidence"] > 0.5
    # The nose of a plain head is what stands out in front of it, on its plane of symmetry.
    tip = np.array(told["face"]["nose_tip_rig_mm"])
    foremost = plain_head().vertices[:, 1].min()
    assert abs(tip[0]) < 3.0 and abs(tip[1] - foremost) < 3.0


def test_a_picture_is_drawn(folder: Path) -> None:
    done = rigwright_here("scan", "head.ply", "--picture", "head.png", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert (folder / "head.png").read_bytes().startswith(b"\x89PNG")
    assert "picture: head.png" in done.stdout


@pytest.mark.parametrize("name", ["head.ply", "thesis.png", "rig.toml"])
def test_a_picture_replaces_nothing(folder: Path, name: str) -> None:
    if name != "head.ply":
        (folder / name).write_text("mine")
    before = (folder / name).read_bytes()
    done = rigwright_here("scan", "head.ply", "--picture", name, cwd=folder)
    assert done.returncode == 2
    assert done.stderr.endswith(f"{name} is there already; give another name for the picture\n")
    assert (folder / name).read_bytes() == before


@pytest.mark.parametrize("more", [("gone.ply",), ("head.ply", "--rig", "gone.toml"), (".",)])
def test_what_is_not_there_gets_one_line(folder: Path, more: tuple[str, ...]) -> None:
    done = rigwright_here("scan", *more, cwd=folder)
    assert done.returncode == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("rigwright: ") and "; " in line
