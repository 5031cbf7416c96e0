"""Heads and chains: the angles a builder sets are those that give the pose."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import InputError
from geometry.frames import Pose, rotation_from_pan_tilt_roll
from rig.build.mounts.kinematics import (
    ANGLES,
    head_angles,
    head_links,
    pose_jacobian,
    reach,
    rotated,
    standing,
    turned_over,
)
from rig.build.mounts.settings import Link, Motion, chain_pose

FACES = ([0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0])
AXES = np.eye(3)


def chain_on(face: list[float]) -> tuple[Link, ...]:
    base = rotated(standing(np.array(face), AXES[1]), np.array([10.0, 20.0, 30.0]))
    slides = tuple(
        Link(np.eye(4), Motion.SLIDE, AXES[k], name) for k, name in enumerate(("x", "y", "z"))
    )
    return slides + head_links(base, 36.0, 60.0, np.array([0.0, 22.5, -28.5]))


def test_at_zero_a_camera_on_a_standing_head_is_level_and_over_it() -> None:
    pose = chain_pose(chain_on(FACES[0]), dict.fromkeys(("x", "y", "z", *ANGLES), 0.0))
    assert np.allclose(pose.rotation_rig_to_camera, rotation_from_pan_tilt_roll(np.zeros(3)))
    # Thread 22.5 below and 28.5 behind the centre, its mouth 60 over the base at (10, 20, 30).
    assert np.allclose(pose.position_rig_mm, [10.0, 48.5, 112.5])


@given(
    st.sampled_from(FACES),
    st.floats(-170.0, 170.0),
    st.floats(-40.0, 40.0),
    st.floats(-170.0, 170.0),
)
def test_angles_read_from_a_pose_give_the_pose(
    face: list[float], pan: float, tilt: float, roll: float
) -> None:
    wanted = rotation_from_pan_tilt_roll(np.array([pan, tilt, roll]))
    chain = chain_on(face)
    base = standing(np.array(face), AXES[1])
    angles = dict(zip(ANGLES, head_angles(wanted, base), strict=True))
    pose = chain_pose(chain, {"x": 0.0, "y": 0.0, "z": 0.0} | angles)
    # arcsin near +-90 degrees halves the digits: sqrt(2e-16) = 1.5e-8.
    assert np.abs(pose.rotation_rig_to_camera - wanted).max() < 1e-7


@pytest.mark.parametrize("face", FACES)
def test_all_six_settings_are_found_for_a_pose(face: list[float]) -> None:
    wanted = Pose(np.array([1.0, 2.0, 3.0]), rotation_from_pan_tilt_roll(np.array([20, -30, 25])))
    chain, names = chain_on(face), ["x", "y", "z", *ANGLES]
    start = dict.fromkeys(names, 0.0)
    near = head_angles(wanted.rotation_rig_to_camera, standing(np.array(face), AXES[1])) + 4.0
    found = reach(chain, start | dict(zip(ANGLES, near, strict=True)), names, wanted)
    pose = chain_pose(chain, found)
    # The search stops at 1e-9 mm; at its lever of 300 mm that is 3e-12 rad.
    assert np.abs(pose.position_rig_mm - wanted.position_rig_mm).max() < 1e-8
    assert np.abs(pose.rotation_rig_to_camera - wanted.rotation_rig_to_camera).max() < 1e-10


def test_a_pose_out_of_reach_is_one_line() -> None:
    chain = (Link(np.eye(4), Motion.SLIDE, AXES[0], "x"),)
    with pytest.raises(InputError, match=r"7\.0 mm short"):
        reach(chain, {"x": 0.0}, ["x"], Pose(np.array([1.0, 7.0, 0.0]), np.eye(3)))


def test_derivatives_are_those_of_the_pose() -> None:
    chain, names = chain_on(FACES[2]), ["x", "y", "z", *ANGLES]
    values = dict(zip(names, (3.0, -2.0, 5.0, 20.0, -15.0, 40.0), strict=True))
    exact = pose_jacobian(chain, values, names, with_rotation=False)
    for column, name in enumerate(names):
        ends = [
            chain_pose(chain, values | {name: values[name] + d}).position_rig_mm
            for d in (1e-4, -1e-4)
        ]
        # Central differences: error of order step^2 times the third derivative, 1e-8 here.
        assert np.abs((ends[0] - ends[1]) / 2e-4 - exact[:, column]).max() < 1e-7


def test_a_carriage_on_a_bent_rail_is_set_in_millimetres() -> None:
    radius = 1000.0
    link = Link(np.eye(4), Motion.TURN, AXES[2], "along", per_unit=np.degrees(1.0 / radius))
    assert np.allclose(link.matrix(radius * np.pi / 2.0)[:3, 0], AXES[1])


def test_turning_a_camera_over_keeps_its_axis() -> None:
    pose = Pose(np.zeros(3), rotation_from_pan_tilt_roll(np.array([10.0, 20.0, 30.0])))
    over = turned_over(pose)
    assert np.allclose(over.axis_rig, pose.axis_rig)
    assert np.allclose(over.rotation_rig_to_camera[0], -pose.rotation_rig_to_camera[0])
