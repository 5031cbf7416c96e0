"""Mounts that cannot be, and designs that say too little, through both doors."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rigs import face, face_cameras
from scanfiles import plain_head
from scipy.spatial.transform import Rotation
from service_helpers import (
    InThisProcess,
    TestClient,
    files_under,
    one_line_and_nothing_left,
    rigwright_here,
    wait_for,
)

from geometry.camera import RigCamera
from geometry.frames import Pose
from geometry.head import synthetic_head
from rig.design.designfile import placed_camera
from rig.specification.examples import example_text
from service.api.app import create_app
from service.api.context import Service
from service.kinds.queued import QUEUED
from service.settings import read_settings
from service.tasks.designing import write_scan

JSON = dict[str, Any]
SLOT = 'kind = "t-slot"\n'
ARC = 'kind = "arc"\n'


@lru_cache(maxsize=1)
def cameras() -> tuple[RigCamera, ...]:
    return face_cameras(face(), 3)


def rolled() -> tuple[RigCamera, ...]:
    turn = Rotation.from_euler("z", 45.0, degrees=True).as_matrix()
    return tuple(
        replace(c, pose=Pose(c.pose.position_rig_mm, turn @ c.pose.rotation_rig_to_camera))
        for c in cameras()
    )


def from_above() -> tuple[RigCamera, ...]:
    pose = Pose.looking_at(np.array([0.0, 0.0, 900.0]), np.array([0.0, 1.0, 0.0]))
    return (replace(cameras()[0], pose=pose),)


def design(placed: tuple[RigCamera, ...]) -> JSON:
    """What a plan needs of a design file."""
    return {
        "schema": "rigwright.design/1",
        "cameras": [placed_camera(camera) for camera in placed],
        "rig": tomllib.loads(example_text("face")),
    }


# What is wrong is found while the file is read, so over HTTP the request is refused at once.
FILES = {
    "a misspelt head": (SLOT + 'head = "manfroto-405"', "did you mean manfrotto-405"),
    "a misspelt profile": (SLOT + 'profile = "2021"', "did you mean 2020"),
    "a misspelt stand": ('kind = "tripods"\nstand = "tripd-1800"', "did you mean tripod-1800"),
    "no such head": (SLOT + 'head = "zzz"', "rigwright catalogue"),
    "posts that would turn": ('kind = "plate"\nprofile = "2020"', "choose 2040"),
    "a misspelt key": (SLOT + 'profil = "2020"', "did you mean profile"),
    "an unknown kind": ('kind = "t-slut"', "'t-slot', 'plate', 'arc' or 'tripods'"),
    "no kind": ('name = "frame"', "kind"),
    "a zone inside out": (
        SLOT + "[[zone]]\nlow_mm = [0.0, 0.0, 0.0]\nhigh_mm = [0.0, 1.0, 1.0]",
        "give low_mm below high_mm",
    ),
}

# These are found as the mount is planned.
MOUNTS = {
    "a head without roll": (
        SLOT + 'head = "generic-pan-tilt"',
        rolled,
        "roll 0.0: choose head ",
    ),
    "a plate under a ceiling": ('kind = "plate"', from_above, "choose a frame or an arc"),
    "too small an arc": (ARC + "radius_mm = 50.0", cameras, "or more, or leave it out"),
    "too large an arc": (ARC + "radius_mm = 50000.0", cameras, "give a radius_mm of about"),
    "a floor over the cameras": (SLOT + "floor_z_mm = 900.0", cameras, "give a floor_z_mm well"),
    "a price of nothing": (SLOT + '[prices]\n"2021" = 3.0', cameras, "did you mean 2020"),
    "a negative price": (SLOT + '[prices]\n"2020" = -3.0', cameras, "zero or more"),
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "in"
    folder.mkdir()
    plain_head().export(folder / "head.ply")
    (folder / "design.json").write_text(json.dumps(design(cameras())))
    (folder / "mount.toml").write_text(SLOT)
    return folder


def planned(folder: Path, *more: str, here: bool = True) -> str:
    return one_line_and_nothing_left(
        folder, "plan", "design.json", "--mount", "mount.toml", *more, here=here
    )


@pytest.mark.parametrize("name", FILES)
def test_system_files_that_cannot_be(folder: Path, name: str) -> None:
    text, words = FILES[name]
    (folder / "mount.toml").write_text(text)
    assert words in planned(folder, "--scan", "head.ply")


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=() if n == "a head without roll" else pytest.mark.slow) for n in MOUNTS],
)
def test_mounts_that_cannot_be_built(folder: Path, name: str) -> None:
    text, placed, words = MOUNTS[name]
    (folder / "mount.toml").write_text(text)
    (folder / "design.json").write_text(json.dumps(design(placed())))
    assert words in planned(folder, "--scan", "head.ply")


def test_what_a_plan_needs_besides(folder: Path) -> None:
    scan = ("--scan", "head.ply")
    assert "is not beside it; give --scan" in planned(folder)
    assert "there is no file gone.ply" in planned(folder, "--scan", "gone.ply")
    assert "give A4 or A3" in planned(folder, *scan, "--paper", "A5")
    whole = (folder / "design.json").read_text()
    (folder / "design.json").write_text(whole[: len(whole) // 2])
    assert "design.json is not JSON" in planned(folder, *scan)
    without = {k: v for k, v in json.loads(whole).items() if k != "rig"}
    (folder / "design.json").write_text(json.dumps(without))
    assert "does not say its limits" in planned(folder, *scan)
    (folder / "design.json").write_text(json.dumps(without | {"scan": {"name": "head.ply"}}))
    assert "; " in planned(folder)
    (folder / "mount.toml").write_text("kind =")
    assert "write it as TOML" in planned(folder, *scan)
    (folder / "design.json").unlink()
    assert "design.json" in planned(folder, *scan)


def test_a_plan_that_would_replace_its_design(folder: Path) -> None:
    before = files_under(folder)
    asked = ("plan", "design.json", "--mount", "mount.toml", "--scan", "head.ply", "--force")
    done = rigwright_here(*asked, "--out", ".", cwd=folder)
    assert done.returncode == 2
    assert "would be lost; give another --out" in done.stderr
    assert files_under(folder) == before


@pytest.mark.slow
def test_a_plan_that_cannot_be_from_the_shell(folder: Path) -> None:
    (folder / "mount.toml").write_text(SLOT + 'head = "generic-pan-tilt"')
    (folder / "design.json").write_text(json.dumps(design(rolled())))
    assert "cannot hold" in planned(folder, "--scan", "head.ply", here=False)


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    folder = tmp_path_factory.mktemp("service")
    opened = Service(
        read_settings(data_dir=folder / "data", workers_per_job=1), QUEUED, InThisProcess()
    )
    yield opened
    opened.close()


@pytest.fixture(scope="module")
def client(service: Service) -> Iterator[TestClient]:
    with TestClient(create_app(service)) as opened:
        yield opened


def told(problem: JSON) -> str:
    assert 400 <= problem["status"] < 500, problem
    assert "\n" not in problem["detail"]
    assert problem["remedy"]
    return str(problem["detail"])


def ended(client: TestClient, answer: Any) -> JSON:  # noqa: ANN401 - the client's own type
    assert answer.status_code == 201, answer.text

    def look() -> JSON | None:
        job: JSON = client.get(answer.headers["Location"]).json()
        return job if job["ended_at"] else None

    return wait_for(look, 120.0)


@pytest.mark.parametrize("name", ["a misspelt key", "an unknown kind", "no kind"])
def test_plans_that_cannot_be_asked_for(client: TestClient, name: str) -> None:
    text, words = FILES[name]
    request = {"design_id": "gone", "mount": tomllib.loads(text)}
    assert words in told(client.post("/v1/plans", json=request).json())
    request = {"design_id": "gone", "mount": {"kind": "arc"}}
    assert "gone" in told(client.post("/v1/plans", json=request).json())


def small_rig() -> JSON:
    rig = tomllib.loads(example_text("face"))
    rig["subject"] = {"design_points": 40, "check_points": 120}
    return rig | {"cameras": 3, "starts": 1, "strategy": "k-means"}


@pytest.mark.slow
def test_mounts_that_cannot_be_over_http(
    tmp_path: Path, client: TestClient, service: Service
) -> None:
    head = tmp_path / "head.ply"
    write_scan(synthetic_head(), head)
    scan = client.post("/v1/scans?filename=head.ply", content=head.read_bytes())
    assert scan.status_code == 201, scan.text
    asked = {"scan_id": scan.json()["id"], "rig": small_rig()}
    made = ended(client, client.post("/v1/designs", json=asked))
    assert made["status"] == "completed", made["problem"]
    for text, words in FILES.values():
        request = {"design_id": made["id"], "mount": tomllib.loads(text)}
        assert words in told(client.post("/v1/plans", json=request).json())
    for name in ("too small an arc", "a floor over the cameras", "a price of nothing"):
        text, _, words = MOUNTS[name]
        request = {"design_id": made["id"], "mount": tomllib.loads(text)}
        job = ended(client, client.post("/v1/plans", json=request))
        assert words in told(job["problem"])
        assert client.get(job["links"]["files"]).json()["items"] == []
    assert client.delete(f"/v1/scans/{scan.json()['id']}").status_code in (204, 409)
    assert not files_under(service.store.folder / "work")
