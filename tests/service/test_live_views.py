"""Live views over HTTP: what a camera sees, and how to turn it towards a target at the datum."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from PIL import Image
from service_helpers import TestClient, running
from stations import write_station

from rig.acquisition.capture import liveview

# Turned away by half a degree, which is 480 / 23.1 mm * f * tan(0.5 degrees) pixels.
OFF_DEG = 0.5
TARGET = """
[[simulation.scene.targets]]
kind = "aruco"
size_mm = 60.0
marker_id = 7
place = { position_rig_mm = [0.0, 0.0, 0.0] }

[simulation.faults.cam02]
turned_deg = [0.0, 0.5, 0.0]
"""
MARKER = {
    "schema": "rigwright.targets/1",
    "name": "datum",
    "markers": [
        {
            "name": "datum",
            "dictionary": "DICT_4X4_50",
            "size_mm": 60.0,
            "targets": [{"number": 7, "position_mm": [0.0, 0.0, 0.0]}],
        }
    ],
}


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    folder = tmp_path_factory.mktemp("live")
    station = write_station(folder / "rig", more=TARGET)
    larger(station.with_name("design.json"))
    with running(folder / "data", station) as client:
        yield client


def larger(design: Path) -> None:
    """Pictures in which a marker is found: five times as fine."""
    document = json.loads(design.read_text())
    for camera in document["cameras"]:
        camera["image_size_px"] = [480, 320]
        camera["lens"]["pixel_pitch_mm"] /= 5.0
        (fx, _, cx), (_, fy, cy), last = camera["camera_matrix"]
        cx, cy = (5.0 * (centre + 0.5) - 0.5 for centre in (cx, cy))
        camera["camera_matrix"] = [[5.0 * fx, 0.0, cx], [0.0, 5.0 * fy, cy], last]
    design.write_text(json.dumps(document))


def look(rig: TestClient, camera: str, **asked: object) -> dict[str, Any]:
    answer = rig.get(f"/v1/rigs/studio/cameras/{camera}/preview", params=asked)
    assert answer.status_code == 200, answer.text
    seen: dict[str, Any] = answer.json()
    return seen


def test_a_camera_is_looked_through(rig: TestClient) -> None:
    status = rig.get("/v1/rigs/studio").json()
    assert [camera["previews"] for camera in status["cameras"]] == [True, True]
    seen = look(rig, "cam01")
    assert seen["image_size_px"] == [480, 320]
    assert 0.2 < seen["blur_px"] < 1.5  # the marker's edges, through a lens of half a pixel
    assert seen["aim"]["expected_px"] == pytest.approx([239.5, 159.5], abs=1e-6)
    picture = rig.get(seen["links"]["picture"])
    assert picture.headers["content-type"] == "image/jpeg"
    assert picture.headers["cache-control"] == "no-store"
    assert Image.open(io.BytesIO(picture.content)).size == (480, 320)
    assert rig.get("/v1/captures").json()["items"] == []


def test_a_target_at_the_datum_tells_how_to_turn(
    rig: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(liveview, "LEAST_INTERVAL_S", 0.0)
    added = rig.post("/v1/target-sets", json=MARKER)
    assert added.status_code == 201, added.text
    known = {"target_set_id": added.json()["id"]}
    straight, turned = look(rig, "cam01", **known)["aim"], look(rig, "cam02", **known)["aim"]
    assert straight["found_by"] == turned["found_by"] == "target"
    # A marker's middle is found to a tenth of a pixel, which sees 23.1 / 480 mm over f = 43 mm
    # or so: 0.07 degrees; the same once more for what the knock does to it.
    assert straight["pan_deg"] == pytest.approx(0.0, abs=0.05)
    assert straight["text"] == "The datum is where it should be."
    assert abs(turned["pan_deg"]) == pytest.approx(OFF_DEG, abs=0.05)
    assert turned["tilt_deg"] == pytest.approx(0.0, abs=0.05)
    way = "left" if turned["pan_deg"] < 0 else "right"
    assert turned["right_px"] * turned["pan_deg"] > 0
    assert turned["text"].endswith(f"degrees to the {way}.")
    placed = look(rig, "cam01", x=0.25, y=0.5)["aim"]
    assert (placed["found_by"], placed["found_px"]) == ("person", [119.5, 159.5])
    assert placed["right_px"] == pytest.approx(-120.0, abs=1e-6)


@pytest.mark.parametrize(
    ("path", "problem"),
    [
        ("other/preview", "not-found/camera"),
        ("cam01/preview?x=0.5", "input/preview-place"),
        ("cam01/preview?x=2&y=0", "input/request-invalid"),
        ("cam01/preview?target_set_id=none", "not-found/target-set"),
        ("other/preview.jpg", "not-found/camera"),
    ],
)
def test_what_cannot_be_is_told(rig: TestClient, path: str, problem: str) -> None:
    answer = rig.get(f"/v1/rigs/studio/cameras/{path}")
    assert answer.json()["type"] == f"/problems/{problem}"
