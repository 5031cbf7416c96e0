"""The turn that brings the datum to its place in a camera's picture."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from simulated_rigs import lens, placed

from common.errors import InputError
from geometry.camera import RigCamera
from geometry.frames import Pose, rotation_from_pan_tilt_roll
from rig.design.aiming import datum_pixel, turn_to
from rig.design.layoutfile import read_datum

DATUM = np.array([4.0, -60.0, 12.0])


def turned(camera: RigCamera, pan_deg: float, tilt_deg: float) -> RigCamera:
    angles = np.add(camera.pose.pan_tilt_roll_deg, [pan_deg, tilt_deg, 0.0])
    pose = Pose(camera.pose.position_rig_mm, rotation_from_pan_tilt_roll(angles))
    return camera.moved_to(pose)


def rolled(roll_deg: float, place_mm: tuple[float, float, float]) -> RigCamera:
    camera = placed(lens(400, distortion=(-0.1, 0.02, 0.0, 0.0, 0.0)), place_mm)
    angles = np.add(camera.pose.pan_tilt_roll_deg, [0.0, 0.0, roll_deg])
    return camera.moved_to(Pose(camera.pose.position_rig_mm, rotation_from_pan_tilt_roll(angles)))


@pytest.mark.parametrize("roll_deg", [0.0, 90.0, -35.0])
@pytest.mark.parametrize("place_mm", [(0.0, -930.0, 0.0), (500.0, -700.0, 450.0)])
@pytest.mark.parametrize("off_deg", [(0.3, 0.0), (-4.0, 2.5), (0.0, -1.0)])
def test_the_turn_undoes_how_a_camera_is_off(
    roll_deg: float, place_mm: tuple[float, float, float], off_deg: tuple[float, float]
) -> None:
    camera = rolled(roll_deg, place_mm)
    stands = turned(camera, *off_deg)
    seen = datum_pixel(stands, DATUM)
    assert seen is not None
    turn = turn_to(camera, DATUM, seen)
    # Exact but for where the solver stops: 1e-8 of a radian-sized step.
    assert (turn.pan_deg, turn.tilt_deg) == pytest.approx((-off_deg[0], -off_deg[1]), abs=1e-4)


def test_words_say_which_way() -> None:
    camera = placed(lens(400))
    expected = datum_pixel(camera, DATUM)
    assert expected is not None
    left = turn_to(camera, DATUM, (expected[0] - 14.0, expected[1]))
    assert left.text.startswith("The datum is 14 px left: pan ")
    assert left.text.endswith(" degrees to the left.")
    low = turn_to(camera, DATUM, (expected[0], expected[1] + 20.0))
    assert low.text.startswith("The datum is 20 px low: tilt ")
    assert low.text.endswith(" degrees down.")
    assert turn_to(camera, DATUM, expected).text == "The datum is where it should be."


def test_a_datum_out_of_view_has_no_place() -> None:
    camera = placed(lens(400))
    assert datum_pixel(camera, np.array([0.0, -2000.0, 0.0])) is None  # behind
    assert datum_pixel(camera, np.array([900.0, -60.0, 0.0])) is None  # aside
    near = replace(camera, camera=replace(camera.camera, image_size_px=(150, 150)))
    assert datum_pixel(near, np.array([0.0, -60.0, 0.0])) is None


def test_the_datum_is_that_of_the_layout(tmp_path: Path) -> None:
    path = tmp_path / "layout.json"
    assert read_datum(path) is None
    datum = {"position_mm": [1.0, -2.0, 3.5], "note": ""}
    path.write_text(json.dumps({"schema": "rigwright.layout/1", "datum": datum, "cameras": []}))
    found = read_datum(path)
    assert found is not None and found.tolist() == [1.0, -2.0, 3.5]
    for wrong in (
        '{"schema": "rigwright.layout/2"}',
        "[]",
        "{",
        '{"schema": "rigwright.layout/1"}',
    ):
        path.write_text(wrong)
        with pytest.raises(InputError, match="is no layout"):
            read_datum(path)
