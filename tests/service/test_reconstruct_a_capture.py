"""The loop closed: a simulated rig photographs a head, and its surface is found again."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from evaluation_helpers import photographed, run

pytest.importorskip("numba")
pytest.importorskip("igl")
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def taken(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return photographed(tmp_path_factory.mktemp("taken"))


def test_the_head_is_found_where_it_was_photographed(taken: Path, tmp_path: Path) -> None:
    made = run(
        "reconstruct", taken / "pictures", "--design", taken / "design.json",
        "--mesh", "ply", "--mesh", "obj", "--texture", "--depth-maps",
        "--out", tmp_path / "face", "--json",
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    meshes = {path.name for path in (tmp_path / "face").glob("mesh.*")}
    assert meshes == {"mesh.ply", "mesh.obj", "mesh.mtl", "mesh.png"}
    maps = {path.stem for path in (tmp_path / "face" / "depthmaps").glob("*.tif")}
    assert maps == {folder.name for folder in (taken / "pictures").iterdir()}
    result = json.loads(made.stdout)["result"]
    assert result["without_pictures"] == []
    assert result["points"] > 10_000
    # Points are seen by two cameras or more, so few triangles between them are seen by none.
    assert result["texture"]["unseen_faces"] < 0.05 * result["mesh_faces"]
    page = (tmp_path / "face" / "report.html").read_text("utf-8")
    assert "from its left" in page
    assert 'id="surface-3d"' in page
    nose = json.loads((taken / "nose.json").read_text())
    compared = run(
        "compare", tmp_path / "face" / "cloud.ply", "--truth", taken / "truth.ply",
        "--within", *nose, "60", "--out", tmp_path / "compared", "--json",
    )  # fmt: skip
    assert compared.returncode == 0, compared.stderr
    figures = json.loads(compared.stdout)["result"]
    surface = run(
        "compare", tmp_path / "face" / "mesh.ply", "--truth", taken / "truth.ply",
        "--within", *nose, "60", "--out", tmp_path / "surface", "--json",
    )  # fmt: skip
    smooth = json.loads(surface.stdout)["result"]
    # Vertices are spread evenly, points are dense where they are surest: the rms of the two is not
    # to be compared, the limit of the points holds for both.
    assert smooth["median_absolute_mm"] < 0.23
    assert abs(smooth["bias_mm"]) < 0.1
    # The pixel is 0.6 mm on the face and rays meet at about 15 degrees: 0.1 px of matching is
    # 0.6 x 0.1 / 0.26 = 0.23 mm. Twice that for the shadows of a small picture.
    assert figures["median_absolute_mm"] < 0.23
    assert abs(figures["bias_mm"]) < 0.1
    assert {s["at"]: s["value"] for s in figures["reached_percent"]}[1.0] > 85.0


def test_a_camera_without_a_picture_is_told(taken: Path, tmp_path: Path) -> None:
    few = tmp_path / "few"
    for folder in sorted((taken / "pictures").iterdir())[:3]:
        (few / folder.name).mkdir(parents=True)
        for file in folder.iterdir():
            (few / folder.name / file.name).write_bytes(file.read_bytes())
    made = run(
        "reconstruct", few, "--design", taken / "design.json", "--out", tmp_path / "out", "--json"
    )
    assert made.returncode == 0, made.stderr
    assert len(json.loads(made.stdout)["result"]["without_pictures"]) >= 1


@pytest.mark.parametrize("kind", ["black", "size", "foreign"])
def test_pictures_that_cannot_be_matched_are_one_line(
    taken: Path, tmp_path: Path, kind: str
) -> None:
    import cv2

    rng = np.random.default_rng(1)
    bad = tmp_path / "bad"
    for folder in sorted((taken / "pictures").iterdir()):
        (bad / folder.name).mkdir(parents=True)
        shape = cv2.imread(str(next(folder.iterdir()))).shape
        picture = {
            "black": np.zeros(shape, np.uint8),
            "size": np.zeros((shape[0] + 2, shape[1], 3), np.uint8),
            "foreign": rng.integers(0, 255, shape, dtype=np.uint8),
        }[kind]
        cv2.imwrite(str(bad / folder.name / "1.png"), picture)
    made = run("reconstruct", bad, "--design", taken / "design.json", "--out", tmp_path / "out")
    assert made.returncode == 2
    assert made.stderr.strip().splitlines()[-1].startswith("rigwright: ")
    assert "Traceback" not in made.stderr
    assert not (tmp_path / "out").exists()
