"""``reconstruct`` and ``compare`` as a user gives them."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
import trimesh
from service_helpers import RIGWRIGHT

from evaluation.reconstruction.cloudfile import read_points, write_distances

pytest.importorskip("igl")
pytestmark = pytest.mark.slow  # each starts the program anew
ROOT = Path(__file__).resolve().parents[2]


def run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*RIGWRIGHT, *map(str, arguments)], capture_output=True, text=True, check=False, cwd=ROOT
    )


@pytest.fixture(scope="module")
def ball(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sphere as a mesh, and a cloud 0.1 mm outside of it."""
    folder = tmp_path_factory.mktemp("ball")
    sphere = trimesh.creation.icosphere(4, 50.0)
    sphere.export(folder / "ball.ply")
    points = np.asarray(sphere.triangles_center)
    normals = np.asarray(sphere.face_normals)
    write_distances(folder / "cloud.ply", points + 0.1 * normals, np.zeros(len(points)))
    return folder


def test_a_cloud_is_compared_and_its_distances_kept(ball: Path) -> None:
    out = ball / "compared"
    done = run("compare", ball / "cloud.ply", "--truth", ball / "ball.ply", "--out", out, "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)["result"]
    # Each point stands 0.1 mm before the middle of its face; files hold doubles.
    assert result["bias_mm"] == pytest.approx(0.1, abs=1e-6)
    assert result["rms_mm"] == pytest.approx(0.1, abs=1e-6)
    assert len(read_points(out / "distances.ply")) == result["points"]
    assert "rms 0.100 mm" in (out / "report.html").read_text(encoding="utf-8")
    table = run("compare", ball / "cloud.ply", "--truth", ball / "ball.ply", "--out", ball / "two")
    assert "+0.1000 mm" in table.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["compare", "CLOUD", "--truth", "none.ply"], "there is no file none.ply"),
        (["compare", "CLOUD", "--truth", "README.md"], "no mesh file"),
        (["compare", "README.md", "--truth", "BALL"], "no PLY file with points"),
        (["compare", "CLOUD", "--truth", "BALL", "--align", "fit"], "align is 'fit'"),
        (
            ["compare", "CLOUD", "--truth", "BALL", "--within", "900", "0", "0", "5"],
            "no point of the cloud lies in the region",
        ),
        (["reconstruct", "."], "where the cameras are is not known"),
    ],
    ids=["missing", "no-mesh", "no-cloud", "align", "region", "cameras"],
)
def test_what_cannot_be_done_is_one_line(
    ball: Path, tmp_path: Path, arguments: list[str], words: str
) -> None:
    files = {"CLOUD": ball / "cloud.ply", "BALL": ball / "ball.ply"}
    given = [str(files.get(a, a)) for a in arguments]
    done = run(*given, "--out", tmp_path / "out")
    assert done.returncode == 2
    # Progress goes to standard error too; the error is its last line, and one.
    assert words in done.stderr.splitlines()[-1]
    assert done.stderr.count("rigwright:") == 1
    assert not (tmp_path / "out").exists()
