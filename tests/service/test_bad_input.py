"""Every kind of bad input through both doors: one line with a remedy, nothing left behind."""

from __future__ import annotations

import tomllib
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
import trimesh
from scanfiles import plain_head
from service_helpers import InThisProcess, TestClient, files_under, one_line_and_nothing_left

from rig.specification.examples import example_text
from service.api.context import Service

RIG = "rig.toml"


@pytest.fixture
def engine() -> InThisProcess:
    """Every kind of input is asked about: a process for each takes a second."""
    return InThisProcess()


def zipped(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("head.obj", "v 0 0 0\n")


def sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(2 << 30)


def without_a_face(path: Path) -> None:
    trimesh.creation.box(extents=[150.0, 190.0, 220.0]).export(path)


def non_manifold(path: Path) -> None:
    path.write_text("v 0 0 0\nv 9 0 0\nv 0 9 0\nv 0 0 9\nv 0 -9 3\nf 1 2 3\nf 2 1 4\nf 1 2 5\n")


def text(content: str) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        path.write_text(content)

    return write


SCANS: dict[str, tuple[str, Callable[[Path], None]]] = {
    "empty": ("head.glb", text("")),
    "all NaN": ("head.xyz", text("nan nan nan\n" * 200)),
    "huge coordinates": ("head.obj", text("v 1e300 0 0\nv 0 1e300 0\nv 0 0 1e300\nf 1 2 3\n")),
    "zero area": ("head.obj", text("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")),
    "non-manifold scrap": ("head.obj", non_manifold),
    "ten million faces": (
        "head.ply",
        text("ply\nformat ascii 1.0\nelement vertex 3\nelement face 10000000\nend_header\n"),
    ),
    "two gigabytes": ("head.ply", sparse),
    "a zip called glb": ("head.glb", zipped),
    "no face": ("head.stl", without_a_face),
}


def refused(client: TestClient, service: Service, path: Path, **options: str) -> dict[str, object]:
    # A body of this size is refused by its length; sending it would only take time.
    too_long = path.stat().st_size > 1 << 30
    answer = client.post(
        "/v1/scans",
        params={"filename": path.name} | options,
        content=b"x" if too_long else path.read_bytes(),
        headers={"Content-Length": str(path.stat().st_size)} if too_long else {},
    )
    assert 400 <= answer.status_code < 500
    assert answer.headers["content-type"] == "application/problem+json"
    problem: dict[str, object] = answer.json()
    assert "\n" not in str(problem["detail"])
    assert problem["remedy"]
    assert service.store.scans.page(10, None) == []
    kept = (service.store.folder / name for name in ("blobs", "tmp", "work"))
    assert not any(files_under(folder) for folder in kept)
    return problem


LONG = {"non-manifold scrap", "ten million faces"}


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] if n in LONG else []) for n in SCANS]
)
def test_a_bad_scan(tmp_path: Path, client: TestClient, service: Service, name: str) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    filename, make = SCANS[name]
    make(folder / filename)
    (folder / RIG).write_text(example_text("face"))
    # One through the door of a process of its own, as a user comes; the others say the same here.
    here = name != "ten million faces"
    one_line_and_nothing_left(folder, "design", filename, "--rig", RIG, here=here)
    refused(client, service, folder / filename)


def test_wrong_units(tmp_path: Path, client: TestClient, service: Service) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    plain_head().export(folder / "head.ply")
    (folder / RIG).write_text(example_text("face") + '\n[scan]\nunits = "m"\n')
    line = one_line_and_nothing_left(folder, "design", "head.ply", "--rig", RIG, here=True)
    assert "units" in line
    assert "units" in str(refused(client, service, folder / "head.ply", units="m")["detail"])


RIGS = {
    "misspelt": ("[limits.frame]", "[limits.fram]", "did you mean frame"),
    "contradictory": ("min_mm = 500.0", "min_mm = 1700.0", "stand_off"),
    "impossible": ("focal_length_mm = 50.0", "focal_length_mm = -50.0", "focal_length_mm"),
    "no TOML": ("[camera]", "[camera", "line"),
}


@pytest.mark.parametrize("name", RIGS)
def test_bad_limits(tmp_path: Path, client: TestClient, head_file: Path, name: str) -> None:
    there, instead, words = RIGS[name]
    folder = tmp_path / "in"
    folder.mkdir()
    (folder / "head.ply").write_bytes(head_file.read_bytes())
    wrong = example_text("face").replace(there, instead, 1)
    (folder / RIG).write_text(wrong)
    told = one_line_and_nothing_left(folder, "design", "head.ply", "--rig", RIG, here=True)
    assert words in told
    params = {"filename": "egg.ply", "subject": "object"}
    scan = client.post("/v1/scans", params=params, content=head_file.read_bytes()).json()
    if name == "no TOML":
        return
    answer = client.post("/v1/designs", json={"scan_id": scan["id"], "rig": tomllib.loads(wrong)})
    assert 400 <= answer.status_code < 500
    assert "\n" not in answer.json()["detail"]
    assert client.get("/v1/designs").json()["items"] == []
