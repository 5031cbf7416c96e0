"""Settings, links and mounts: what is set is what exists, and gives the pose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mounted import slider
from scipy.spatial.transform import Rotation

from common.errors import InputError
from geometry.frames import Pose
from rig.build.mounts.settings import (
    CameraMount,
    Link,
    Motion,
    Setting,
    chain_pose,
    pose_of,
    rig_from_camera,
    shift,
    turn,
)

STEPS = st.sampled_from([0.1, 0.25, 0.5, 1.0, 2.0, 5.0])


@given(st.floats(-50.0, 50.0), STEPS, st.floats(-20.0, 0.0), st.floats(1.0, 30.0), st.floats(0, 1))
def test_a_rounded_setting_exists_and_none_is_nearer(
    value: float, step: float, low: float, span: float, origin: float
) -> None:
    high = low + step + span
    rounded = Setting("s", "mm", value, step, low, high, "here", origin).rounded()
    assert rounded.exists and rounded.rounded() == rounded
    assert low - 1e-9 <= rounded.value <= high + 1e-9
    off = (rounded.value - origin) / step
    assert off == pytest.approx(round(off), abs=1e-6)
    for k in (-1, 1):
        other = replace(rounded, value=rounded.value + k * step)
        if other.exists:
            assert abs(rounded.value - value) <= abs(other.value - value) + 1e-9


def test_what_is_made_to_the_figure_is_kept_but_for_its_range() -> None:
    made = Setting("s", "deg", 12.345, 0.0, -10.0, 20.0, "here")
    assert made.rounded() == made and made.exists
    beyond = replace(made, value=31.0)
    assert beyond.rounded().value == 20.0 and not beyond.exists


@pytest.mark.parametrize(
    "wrong", [{"unit": "in"}, {"low": 2.0, "high": 1.0}, {"step": -1.0}, {"low": float("nan")}]
)
def test_a_setting_that_makes_no_sense_is_refused(wrong: dict[str, object]) -> None:
    fields = {"name": "s", "unit": "mm", "value": 0.0, "step": 1.0, "low": -1.0, "high": 1.0}
    fields["measured_from"] = "here"
    with pytest.raises(InputError, match="setting s"):
        Setting(**(fields | wrong))


@given(st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3), st.floats(-360.0, 360.0))
def test_a_turn_is_that_of_the_library(axis: list[float], angle: float) -> None:
    length = float(np.linalg.norm(axis))
    if length < 1e-3:
        return
    unit = np.array(axis) / length
    wanted = Rotation.from_rotvec(np.radians(angle) * unit).as_matrix()
    assert np.abs(turn(unit, angle) - wanted).max() < 1e-12


def test_a_link_slides_or_turns_after_its_transform() -> None:
    start = shift(np.array([1.0, 2.0, 3.0]))
    slide = Link(start, Motion.SLIDE, np.array([0.0, 0.0, 5.0]), "up", per_unit=2.0)
    assert slide.matrix(10.0)[:3, 3].tolist() == [1.0, 2.0, 23.0]
    turned = Link(start, Motion.TURN, np.array([0.0, 0.0, 2.0]), "pan", per_unit=0.5)
    assert turned.matrix(180.0)[:3, 0] == pytest.approx([0.0, 1.0, 0.0])
    assert turned.matrix(180.0)[:3, 3].tolist() == [1.0, 2.0, 3.0]
    assert Link(start).matrix(99.0).tolist() == start.tolist()


@pytest.mark.parametrize("wrong", [{"axis": None}, {"setting": ""}])
def test_a_link_that_moves_needs_axis_and_setting(wrong: dict[str, object]) -> None:
    fields = {"transform": np.eye(4), "motion": Motion.SLIDE, "axis": np.eye(3)[0], "setting": "x"}
    with pytest.raises(InputError, match="lacks axis or setting"):
        Link(**(fields | wrong))


def test_a_pose_survives_its_matrix() -> None:
    pose = Pose.looking_at(np.array([300.0, -800.0, 200.0]), np.zeros(3), 25.0)
    back = pose_of(rig_from_camera(pose))
    assert np.allclose(back.position_rig_mm, pose.position_rig_mm)
    assert np.allclose(back.rotation_rig_to_camera, pose.rotation_rig_to_camera, atol=1e-14)


def test_a_mount_must_give_the_pose_of_its_camera() -> None:
    mount = slider(values={"x": 100.0, "pan": 10.0})
    assert mount.values()["x"] == 100.0 and mount.name == "cam01"
    away = Pose(mount.camera.pose.position_rig_mm + 0.01,
                mount.camera.pose.rotation_rig_to_camera)  # fmt: skip
    with pytest.raises(InputError, match="do not give its pose"):
        replace(mount, camera=mount.camera.moved_to(away))


def test_moving_a_mount_moves_its_camera_and_nothing_else() -> None:
    mount = slider(values={"x": 100.0, "pan": 10.0, "tilt": -5.0})
    moved = mount.moved({"x": 90.0, "unknown": 3.0})
    assert moved.values() == mount.values() | {"x": 90.0}
    assert moved.camera.pose.position_rig_mm.tolist() == [90.0, 0.0, 0.0]
    assert moved.camera.focus_distance_mm == mount.camera.focus_distance_mm
    assert moved.wanted is mount.wanted and moved.chain is mount.chain
    assert isinstance(moved, CameraMount)
    assert mount.pose({"y": 4.0}).position_rig_mm.tolist() == [100.0, 4.0, 0.0]


def test_a_chain_multiplies_from_the_rig_to_the_camera() -> None:
    chain = (
        Link(np.eye(4), Motion.TURN, np.eye(3)[2], "turn"),
        Link(shift(np.array([10.0, 0.0, 0.0])), Motion.SLIDE, np.eye(3)[0], "out"),
    )
    pose = chain_pose(chain, {"turn": 90.0, "out": 5.0})
    assert pose.position_rig_mm == pytest.approx([0.0, 15.0, 0.0], abs=1e-12)
    assert pose.rotation_rig_to_camera.T[:, 0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)
