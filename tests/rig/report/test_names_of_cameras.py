"""Names in the first view of a rig: over their bodies, or under them where that is taken."""

from __future__ import annotations

import numpy as np
from mounted import placed

from geometry.camera import RigCamera
from geometry.frames import Pose
from rig.report.rigview import name_places

TARGET = np.array([0.0, 0.0, 1500.0])


def cameras_at(*places: list[float]) -> tuple[RigCamera, ...]:
    return tuple(
        placed(f"cam{k}", Pose.looking_at(np.array(place), TARGET))
        for k, place in enumerate(places)
    )


def test_a_name_goes_below_a_body_that_another_stands_over() -> None:
    """The name of the lower of two cameras was behind the body of the upper one."""
    far = [600.0, -500.0, 1500.0]
    upper, lower = [-600.0, -500.0, 1540.0], [-600.0, -500.0, 1450.0]
    at, sides = name_places(cameras_at(upper, lower, far))
    assert sides == ["top center", "bottom center", "top center"]
    assert at[0, 2] > upper[2] and at[1, 2] < lower[2] and at[2, 2] > far[2]


def test_one_camera_alone_has_its_name_above() -> None:
    assert name_places(cameras_at([0.0, -700.0, 1500.0]))[1] == ["top center"]
