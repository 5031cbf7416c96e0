"""``rigwright trial``: a small rig tried on the bundled head, and what cannot be tried."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from evaluation_helpers import small_rig
from service_helpers import one_line_and_nothing_left, rigwright_here

from evaluation.comparison.comparing import Figures
from evaluation.reconstruction.cloudfile import read_points
from rig.design.designfile import placed_camera
from rig.simulation.heads import head_mesh
from rig.simulation.settings import HeadSettings
from rig.specification.examples import example_rig
from service.kinds.trial import TrialRequest
from service.tasks.trying import verdict_on


@pytest.fixture(scope="module")
def design(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five cameras of 600 pixels before the bundled head, and the head as a file."""
    from dataclasses import replace

    folder = tmp_path_factory.mktemp("design")
    head = head_mesh(HeadSettings())
    trimesh.Trimesh(head.vertices_mm, head.faces, process=False).export(folder / "head.ply")
    nose = head.vertices_mm[np.argmin(head.vertices_mm[:, 1])]
    kind, width = example_rig("face").camera, 600
    camera = replace(
        kind,
        image_size_px=(width, round(width * kind.image_size_px[1] / kind.image_size_px[0])),
        pixel_pitch_mm=kind.pixel_pitch_mm * kind.image_size_px[0] / width,
        principal_point_px=np.full(2, np.nan),
    )
    cameras = [placed_camera(c) for c in small_rig(camera, nose + np.array([0.0, 40.0, 0.0]))]
    document = {"schema": "rigwright.design/1", "cameras": cameras}
    (folder / "design.json").write_text(json.dumps(document), encoding="utf-8")
    return folder


@pytest.mark.slow
def test_a_rig_is_tried_and_judged_by_its_limits(design: Path) -> None:
    pytest.importorskip("numba")
    pytest.importorskip("igl")
    done = rigwright_here(
        "trial", "design.json", "--head", "head.ply", "--stride", "3", "--radius", "60",
        "--limit-rms", "0.001", "--out", "out", "--json", cwd=design,
    )  # fmt: skip
    # No rig of 0.7 mm a pixel measures to a micrometre.
    assert done.returncode == 4, done.stderr
    result = json.loads(done.stdout)["result"]
    assert "does not measure this face: its rms of" in result["verdict"]
    # As of the reconstruction of such pictures: 0.73 mm a pixel, 0.1 px over the base's angle.
    assert result["median_absolute_mm"] < 0.3
    names = [r["region"] for r in result["regions"]]
    assert names[0] == "all"
    assert {"nose and eyes", "mouth and chin"} <= set(names)
    assert 0.0 < result["seen_percent"] < 100.0
    page = (design / "out" / "report.html").read_text(encoding="utf-8")
    assert result["verdict"] in page
    assert "mouth and chin" in page
    assert len(read_points(design / "out" / "distances.ply")) == result["points"]


@pytest.mark.parametrize(
    ("rms_mm", "reached", "words"),
    [
        (0.05, 95.0, "The rig measures this face: rms 0.050 mm"),
        (0.2, 95.0, "its rms of 0.200 mm is above 0.1 mm."),
        (0.05, 80.0, "80.0 % of what two cameras see have a point within 0.5 mm, less than 90 %"),
        (0.2, 80.0, "above 0.1 mm, and 80.0 %"),
    ],
)
def test_the_verdict_names_every_limit_that_is_broken(
    rms_mm: float, reached: float, words: str
) -> None:
    figures = Figures(10, 0, 0.0, rms_mm, 0.0, 0.0, (), ((0.5, reached),), 1.0)
    measures, verdict = verdict_on(figures, TrialRequest())
    assert words in verdict
    assert measures == (rms_mm < 0.1 and reached > 90.0)


@pytest.mark.slow
def test_what_cannot_be_tried_is_one_line(design: Path, tmp_path: Path) -> None:
    pytest.importorskip("numba")
    for name in ("design.json", "head.ply"):
        shutil.copy(design / name, tmp_path)
    design = tmp_path
    said = one_line_and_nothing_left(design, "trial", "design.json", "--head", "none.ply")
    assert "none.ply" in said
    said = one_line_and_nothing_left(
        design, "trial", "design.json", "--head", "head.ply", "--exposure", "bright"
    )
    assert "exposure" in said
    said = one_line_and_nothing_left(design, "trial", "design.json")
    assert "--scan" in said or "head" in said


def test_a_blender_that_is_not_there_is_one_line(design: Path) -> None:
    pytest.importorskip("numba")
    pytest.importorskip("igl")
    told = one_line_and_nothing_left(
        design, "trial", "design.json", "--head", "head.ply", "--blender", "./none", here=True
    )
    assert "./none cannot be run: No such file or directory" in told
