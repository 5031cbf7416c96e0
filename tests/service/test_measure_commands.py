"""``rigwright targets``, ``calibrate``, ``check`` and ``accept`` with pictures of a small rig."""

from __future__ import annotations

import io
import json
import shutil
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from held_targets import FACING, PLATE, PLATE_TOML, held, rig, shifted, shown, write_pictures
from service_helpers import (
    InThisProcess,
    TestClient,
    files_under,
    rigwright,
    rigwright_here,
    wait_for,
)

from calibration.targets.files import targets_text
from calibration.targets.kinds import RingCarrier, TargetPlace, TargetPlan
from geometry.arrays import Floats
from rig.design.designfile import placed_camera
from service.api.app import create_app
from service.api.context import Service
from service.kinds.queued import QUEUED
from service.settings import read_settings

JSON = dict[str, Any]
CAMERAS = rig()
KNOCK_MM = 0.5
slow = pytest.mark.slow


def run(folder: Path, *arguments: object, ends: int = 0) -> JSON:
    """What a command prints as JSON."""
    done = rigwright_here(*arguments, "--json", cwd=folder)
    assert done.returncode == ends, done.stderr
    document: JSON = json.loads(done.stdout)
    assert all((folder / path).is_file() for path in document["files"].values())
    return document


def packed(folder: Path, archive: Path) -> Path:
    with zipfile.ZipFile(archive, "w") as out:
        for path in files_under(folder):
            out.write(path, Path("all") / path.relative_to(folder))
    return archive


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a target set, pictures of it, and a calibration from them."""
    folder = tmp_path_factory.mktemp("work")
    (folder / "set.toml").write_text(PLATE_TOML)
    write_pictures(folder / "pictures", shown(PLATE, CAMERAS, held(7, 3)))
    design = {"schema": "rigwright.design/1", "cameras": [placed_camera(c) for c in CAMERAS]}
    (folder / "design.json").write_text(json.dumps(design))
    made = run(
        folder, "calibrate", "pictures", "--targets", "set.toml", "--name", "monday",
        "--out", "calibration",
    )  # fmt: skip
    result = made["result"]
    assert result["converged"]
    assert result["warnings"] == []
    assert set(made["files"]) == {
        "calibration.json", "detections.json", "report.html", "targets.toml",
    }  # fmt: skip
    return folder


def test_targets_are_printed(tmp_path: Path) -> None:
    (tmp_path / "set.toml").write_text(PLATE_TOML)
    made = run(tmp_path, "targets", "set.toml", "--page", "letter")
    assert set(made["files"]) == {"plate.pdf", "plate.png", "plate.svg", "targets.toml"}
    assert made["result"]["carriers"] == [{"name": "plate", "kind": "ChArUco plate", "targets": 20}]
    assert (tmp_path / "targets" / "plate.pdf").read_bytes().startswith(b"%PDF")
    again = rigwright_here("targets", "set.toml", cwd=tmp_path)
    assert (again.returncode, again.stdout) == (2, "")
    assert "is not empty; give another --out, or --force" in again.stderr
    # The ruler is measured, written into the set beside the sheets, and all is printed anew.
    ruled = (tmp_path / "targets" / "targets.toml").read_text()
    ruler = "# by anna\nruler = { drawn_mm = 100.0, measured_mm = 99.0 }\n"
    (tmp_path / "targets" / "targets.toml").write_text(ruled + ruler)
    run(tmp_path, "targets", "targets/targets.toml", "--force")
    text = (tmp_path / "targets" / "targets.toml").read_text()
    assert "# by anna" in text
    kept = tomllib.loads(text)
    assert kept["plates"][0]["ruler"]["measured_mm"] == 99.0


def check_cameras(result: JSON, *, in_frame: bool) -> None:
    """Focal lengths and baselines of the cameras that took the pictures."""
    for found, true in zip(result["cameras"], CAMERAS, strict=True):
        off = found["focal_length_px"] - true.camera.focal_length_px
        assert abs(off) < 4.0 * found["focal_sigma_px"]
    place = np.array([c["position_mm"] for c in result["cameras"]])
    true_place = np.array([c.pose.position_rig_mm for c in CAMERAS])
    sigma = max(c["position_sigma_mm"] for c in result["cameras"])
    ways, true_ways = (np.linalg.norm(p[:, None] - p, axis=2) for p in (place, true_place))
    # A way has the errors of its two ends: the root of two, four sigmas of it.
    assert np.abs(ways - true_ways).max() < 4.0 * np.sqrt(2.0) * sigma
    if in_frame:
        assert np.linalg.norm(place - true_place, axis=1).max() < 4.0 * np.sqrt(3.0) * sigma


@slow
def test_a_calibration_is_of_the_cameras(work: Path) -> None:
    made = json.loads((work / "calibration" / "calibration.json").read_text())
    assert made["name"] == "monday"
    assert {c["name"] for c in made["cameras"]} == {c.name for c in CAMERAS}


@slow
def test_calibrating_from_a_folder_or_an_archive_and_from_a_design(work: Path) -> None:
    packed(work / "pictures", work / "pictures.zip")
    by_folder = run(work, "calibrate", "pictures", "--targets", "set.toml", "--out", "a")
    asked = ("calibrate", "pictures.zip", "--targets", "set.toml", "--out")
    assert run(work, *asked, "b")["result"] == by_folder["result"]
    check_cameras(by_folder["result"], in_frame=False)
    known = ("--design", "design.json", "--poses-known-to", 0.5, 0.05)
    designed = run(work, *asked, "c", *known)
    check_cameras(designed["result"], in_frame=True)
    assert designed["result"]["datum"] != by_folder["result"]["datum"]
    held_back = run(work, *asked, "d", "--hold", "p1", "--hold", "p2")
    assert all(c["distortion"][2:4] == [0.0, 0.0] for c in held_back["result"]["cameras"])


@slow
def test_checks_are_green_then_red_and_collected(work: Path) -> None:
    fine = shown(PLATE, CAMERAS, held(3, 8), seed=77)
    knocked = [shifted(c, (KNOCK_MM, 0.0, 0.0)) if c.name == "cam03" else c for c in CAMERAS]
    write_pictures(work / "tuesday", fine)
    write_pictures(work / "wednesday", shown(PLATE, knocked, held(3, 9), seed=78))
    packed(work / "wednesday", work / "wednesday.zip")
    against = ("--reference", "calibration", "--history", "history", "--out")
    green = run(work, "check", "tuesday", *against, "check1")
    assert green["result"]["light"] == "green", green["result"]["text"]
    red = run(work, "check", "wednesday.zip", *against, "check2", ends=4)
    assert [(f["kind"], f["subjects"]) for f in red["result"]["findings"]] == [
        ("camera-moved", ["cam03"])
    ]
    effect = red["result"]["findings"][0]["effect_mm"]
    # The worst place of the face counts: seen by two cameras only, 233 mm apart at 900 mm, it moves
    # along its depth by 0.5 mm x 900 / 233; a place that all see moves by less than the knock.
    assert KNOCK_MM < effect < KNOCK_MM * 900.0 / 233.0
    assert len(list((work / "history").glob("check-*.json"))) == 2
    assert "over 2 checks" in (work / "history" / "history.html").read_text()
    said = rigwright("check", "wednesday", "--reference", "calibration/calibration.json",
        "--out", "check3", cwd=work)  # fmt: skip
    assert said.returncode == 4
    assert said.stdout.count("RED") == 1
    assert "cam03" in said.stdout


BAR_MM = np.array([0.0, 60.0, 125.0, 180.0, 240.0, 300.0])
LINES = (
    ((1.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    ((1.0, 0.0, 0.0), (0.0, 0.0, 70.0)),
    ((1.0, 0.0, 0.0), (0.0, 60.0, -70.0)),
    ((1.0, 0.0, 0.5), (0.0, 0.0, 0.0)),
    ((1.0, 0.0, -0.5), (0.0, 0.0, 0.0)),
    ((1.0, 0.4, 0.3), (0.0, 0.0, 0.0)),
    ((1.0, -0.4, -0.3), (0.0, 0.0, 0.0)),
)
VOLUME = ("--volume", 300, 180, 100)


def bar(scale: float = 1.0) -> RingCarrier:
    places = tuple(
        TargetPlace(k + 1, (float(x * scale), 0.0, 0.0), (0.005, 0.005, 0.005))
        for k, x in enumerate(BAR_MM)
    )
    return RingCarrier("bar", 6.0, places, bar=True)


def along(direction: tuple[float, float, float]) -> Floats:
    """Attitude of a bar along a direction of the rig that faces the cameras."""
    x = np.array(direction) / np.linalg.norm(direction)
    z = FACING[:, 2] - x * float(FACING[:, 2] @ x)
    z /= np.linalg.norm(z)
    return np.stack([x, np.cross(z, x), z], axis=1)


@pytest.fixture(scope="module")
def bars(work: Path) -> Path:
    """Pictures of a bar along seven lines, and its file, right and 0.2 % wrong."""
    lines = [(along(way), np.array(place)) for way, place in LINES]
    write_pictures(work / "bars", shown(bar(), CAMERAS, lines, seed=5))
    for name, scale in (("bar.toml", 1.0), ("wrong.toml", 1.002)):
        (work / name).write_text(targets_text(TargetPlan("bar", (bar(scale),))))
    return work


@slow
def test_acceptance_at_the_terminal(bars: Path) -> None:
    against = ("--reference", "calibration", *VOLUME, "--limit", 60, 100, 100)
    words = ("--rig", "small", "--operator", "me", "--temperature", 21.5)
    passed = run(bars, "accept", "bars", *against, *words, "--targets", "bar.toml", "--out", "p")
    assert passed["result"]["outcome"] == "passed", passed["result"]["text"]
    assert passed["result"]["lines"] == 7
    assert len(passed["result"]["lengths"]) == 35
    assert (bars / "p" / "certificate.pdf").read_bytes().startswith(b"%PDF")
    failed = run(bars, "accept", "bars", *against, "--targets", "wrong.toml", "--out", "f", ends=4)
    assert failed["result"]["outcome"] == "failed"
    # The bar is said to be 0.2 % longer than it is.
    off = failed["result"]["scale_ppm"] - passed["result"]["scale_ppm"]
    assert off == pytest.approx(-2000.0, abs=10.0)
    assert "certificate.pdf" in failed["files"]
    shutil.rmtree(bars / "p")
    told = rigwright_here(
        "accept", "bars", *against, "--targets", "bar.toml", "--out", "p", cwd=bars
    )
    assert told.returncode == 0
    assert "PASSED" in told.stdout.upper()


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    data = tmp_path_factory.mktemp("data")
    settings = read_settings(data_dir=data, workers_per_job=1)
    service = Service(settings, QUEUED, InThisProcess())
    with TestClient(create_app(service)) as opened:
        yield opened
    service.close()


def sent(client: TestClient, pictures: Path, targets: Path) -> JSON:
    archive = packed(pictures, pictures.with_suffix(".zip")).read_bytes()
    put = client.post("/v1/picture-sets", content=archive)
    made = client.post("/v1/target-sets", json=tomllib.loads(targets.read_text()))
    return {
        "target_set_id": made.json()["id"],
        "pictures": {"picture_set_id": put.json()["id"]},
    }


def done(client: TestClient, path: str, request: JSON) -> JSON:
    answer = client.post(path, json=request)
    assert answer.status_code == 201, answer.text

    def look() -> JSON | None:
        job: JSON = client.get(answer.headers["Location"]).json()
        return job if job["ended_at"] else None

    job = wait_for(look, 120.0)
    assert job["status"] == "completed", job["problem"]
    return job


@slow
def test_acceptance_over_http(bars: Path, client: TestClient) -> None:
    asked = sent(client, bars / "pictures", bars / "set.toml")
    made = done(client, "/v1/calibrations", asked)
    request = {
        "calibration_id": made["id"],
        "limit": {"a_um": 60.0, "k_um_per_m": 100.0, "b_um": 100.0},
        "volume": {"width_mm": 300.0, "height_mm": 180.0, "depth_mm": 100.0},
    }
    outcomes = {}
    for name in ("bar.toml", "wrong.toml"):
        job = done(client, "/v1/acceptances", request | sent(client, bars / "bars", bars / name))
        outcomes[name] = job["result"]["outcome"]
        paper = client.get(f"{job['links']['self']}/certificate")
        assert paper.headers["content-type"] == "application/pdf"
        assert paper.content.startswith(b"%PDF")
    assert outcomes == {"bar.toml": "passed", "wrong.toml": "failed"}
    history = client.get(f"{made['links']['self']}/history")
    assert history.status_code == 200
    packed_rig = client.get(f"{made['links']['self']}/exports/opencv").content
    with zipfile.ZipFile(io.BytesIO(packed_rig)) as archive:
        assert archive.namelist()
