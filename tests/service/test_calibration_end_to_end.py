"""Targets, captures, calibration, a knock, the check that names it: all over HTTP."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calibration_rigs import FACE_WIDTH_MM, TARGETS, four_cameras, write_plate_station
from service_helpers import TestClient, wait_for

from service.api.app import create_app
from service.api.context import Service
from service.kinds.queued import QUEUED
from service.settings import read_settings

JSON = dict[str, Any]
CALIBRATING, CHECKING = 12, 4
KNOCK_MM = 0.1
FAULTS = f"""
[simulation.faults.cam03]
moved_mm = [{KNOCK_MM}, 0.0, 0.0]
knocked_at_shot = {CALIBRATING + CHECKING + 1}
"""

pytestmark = pytest.mark.slow


@contextmanager
def serving(data: Path, *stations: Path) -> Iterator[TestClient]:
    service = Service(read_settings(data_dir=data, stations=list(stations)), QUEUED)
    with TestClient(create_app(service)) as client:
        yield client
    service.close()


def done(client: TestClient, answer: Any, seconds: float = 200.0) -> JSON:  # noqa: ANN401
    """The job that a request began, once it is completed."""
    assert answer.status_code == 201, answer.text
    path = answer.headers["Location"]

    def ended() -> JSON | None:
        job: JSON = client.get(path).json()
        return job if job["ended_at"] else None

    job = wait_for(ended, seconds)
    assert job["status"] == "completed", job["problem"]
    return job


def capture(client: TestClient, session: str, count: int) -> None:
    for number in range(count):
        request = {"capture_id": f"{session}-{number}", "session": session}
        done(client, client.post("/v1/rigs/studio/captures", json=request))


def test_a_knocked_camera_is_named(tmp_path: Path) -> None:
    with serving(tmp_path / "data") as client:
        made = client.post("/v1/target-sets", json=TARGETS)
        assert made.status_code == 201, made.text
        targets = made.json()
        assert targets["carriers"] == {"plate": 48}
        sheets = client.get(targets["links"]["sheets"]).json()["items"]
        files = {s["name"]: client.get(s["href"]).content for s in sheets}
    assert files["plate.pdf"].startswith(b"%PDF")
    face = tmp_path / "plate.png"
    face.write_bytes(files["plate.png"])

    station = write_plate_station(tmp_path / "station", face, FAULTS)
    with serving(tmp_path / "data", station) as client:
        wait_for(lambda: client.get("/v1/rigs/studio").json()["status"] == "ready")
        capture(client, "monday", CALIBRATING)
        asked = {"target_set_id": targets["id"], "pictures": {"session": "monday"}}
        calibration = done(client, client.post("/v1/calibrations", json=asked))
        check_calibration(calibration["result"])
        own = calibration["links"]["self"]

        def verdict(session: str) -> JSON:
            capture(client, session, CHECKING)
            request = {"calibration_id": calibration["id"], "pictures": {"session": session}}
            job = done(client, client.post("/v1/checks", json=request))
            assert b"<html" in client.get(f"{job['links']['self']}/report").content
            return dict(job["result"])

        fine = verdict("tuesday")
        assert fine["light"] == "green", fine["text"]
        assert {c["verdict"] for c in fine["cameras"]} == {"fine"}
        # The smallest shift that 95 of 100 checks report is below the knock that follows.
        by_name = {c["name"]: c for c in fine["cameras"]}
        assert by_name["cam03"]["smallest_shift_um"][0] < 1000.0 * KNOCK_MM

        knocked = verdict("wednesday")
        assert knocked["light"] == "red", knocked["text"]
        assert [(f["kind"], f["subjects"]) for f in knocked["findings"]] == [
            ("camera-moved", ["cam03"])
        ]
        # A point that cam03 and its neighbour alone see moves along their rays by the knock over
        # their base/height ratio, 233 mm at 905 mm; one that all four see by a quarter of it.
        effect_mm = knocked["findings"][0]["effect_mm"]
        assert KNOCK_MM / 4.0 < effect_mm < 1.2 * KNOCK_MM * 905.0 / 233.0

        page = client.get(f"{own}/history")
        assert page.status_code == 200
        assert "cam03" in page.text
        packed = client.get(f"{own}/exports/colmap-text").content
        with zipfile.ZipFile(io.BytesIO(packed)) as archive:
            assert any(name.endswith("cameras.txt") for name in archive.namelist())


def check_calibration(result: JSON) -> None:
    """The cameras of the simulation, within what is stated."""
    assert result["converged"]
    assert result["warnings"] == []
    assert result["rms_px"] < 0.05
    truth = {c.name: c for c in four_cameras()}
    for camera in result["cameras"]:
        focal = truth[camera["name"]].camera.focal_length_px
        assert abs(camera["focal_length_px"] - focal) < 4.0 * camera["focal_sigma_px"]
    place = np.array([c["position_mm"] for c in result["cameras"]])
    true = np.array([truth[c["name"]].pose.position_rig_mm for c in result["cameras"]])
    sigma = max(c["position_sigma_mm"] for c in result["cameras"])
    # Baselines do not depend on where the rig's frame is; the face is 190 mm as printed.
    ways = np.linalg.norm(place[:, None] - place, axis=2) - np.linalg.norm(
        true[:, None] - true, axis=2
    )
    assert np.abs(ways).max() < 4.0 * np.sqrt(2.0) * sigma + 1e-3 * FACE_WIDTH_MM
