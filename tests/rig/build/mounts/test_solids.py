"""Solids of what is mounted: where their corners are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mounted import placed
from scipy.spatial import ConvexHull

from geometry.camera import Body
from geometry.frames import Pose, rotation_from_pan_tilt_roll
from rig.build.mounts.kinematics import rotated
from rig.build.mounts.settings import shift, turn
from rig.build.mounts.solids import (
    CABLE_MM,
    SIDES,
    bar,
    box,
    camera_solids,
    carried,
    lens_front,
    round_part,
)

X, Y, Z = np.eye(3)


def pose() -> Pose:
    return Pose(np.array([10.0, 20.0, 30.0]), rotation_from_pan_tilt_roll(np.array([25, -15, 40])))


def test_carrying_turns_and_then_moves() -> None:
    at = rotated(turn(Z, 90.0), np.array([1.0, 2.0, 3.0]))
    assert carried(at, np.array([[1.0, 0.0, 0.0]])) == pytest.approx(np.array([[1.0, 3.0, 3.0]]))


def test_a_box_reaches_from_corner_to_corner_of_its_frame() -> None:
    at = rotated(turn(X, 30.0), np.array([5.0, 0.0, 0.0]))
    solid = box("a", "member", at, np.array([-1.0, 0.0, 2.0]), np.array([3.0, 4.0, 8.0]))
    back = carried(np.linalg.inv(at), solid.corners_mm)
    assert back.min(axis=0) == pytest.approx([-1.0, 0.0, 2.0], abs=1e-9)
    assert back.max(axis=0) == pytest.approx([3.0, 4.0, 8.0], abs=1e-9)
    assert ConvexHull(solid.corners_mm).volume == pytest.approx(4.0 * 4.0 * 6.0)


def test_a_round_part_is_never_smaller_than_it_is() -> None:
    solid = round_part("a", "head", shift(5.0 * X), 20.0, -3.0, 7.0)
    hull = ConvexHull(solid.corners_mm)
    angles = np.linspace(0.0, 2.0 * np.pi, 97)
    for z in (-3.0, 7.0):
        circle = np.column_stack(
            [5.0 + 10.0 * np.cos(angles), 10.0 * np.sin(angles), 0 * angles + z]
        )
        inside = circle @ hull.equations[:, :3].T + hull.equations[:, 3]
        assert inside.max() < 1e-9
    # Circumscribed: SIDES tan(pi / SIDES) / pi of the circle's area, 2.4 % too much.
    share = SIDES * np.tan(np.pi / SIDES) / np.pi
    assert hull.volume == pytest.approx(share * np.pi * 100.0 * 10.0)


@pytest.mark.parametrize("end", [[0.0, 0.0, 100.0], [60.0, 80.0, 0.0], [-30.0, 20.0, -60.0]])
def test_a_bar_has_its_width_across_and_its_length_along(end: list[float]) -> None:
    start, tip = np.array([1.0, 2.0, 3.0]), np.array([1.0, 2.0, 3.0]) + end
    along = np.array(end) / np.linalg.norm(end)
    across = np.cross(along, [0.3, -0.2, 0.9])
    across /= np.linalg.norm(across)
    solid = bar("a", "member", start, tip, across, (20.0, 40.0))
    local = (solid.corners_mm - start) @ np.stack([across, np.cross(along, across), along], axis=1)
    assert np.ptp(local, axis=0) == pytest.approx([20.0, 40.0, np.linalg.norm(end)])
    assert local.min(axis=0) == pytest.approx([-10.0, -20.0, 0.0], abs=1e-9)


def test_a_camera_has_body_lens_and_cable_in_its_own_axes() -> None:
    camera = placed("eye", pose())
    body, lens, cable = camera_solids(camera)
    assert [s.kind for s in (body, lens, cable)] == ["camera", "lens", "cable"]
    assert {s.owner for s in (body, lens, cable)} == {"eye"}
    shape = camera.camera.body
    local = camera.pose.to_camera(body.corners_mm)
    assert np.ptp(local, axis=0) == pytest.approx(shape.size_mm)
    assert (local.max(axis=0) + local.min(axis=0)) / 2.0 == pytest.approx(shape.centre_camera_mm)
    front = camera.pose.to_camera(lens.corners_mm)[:, 2]
    assert front.min() == pytest.approx(shape.front_z_mm)
    assert front.max() == pytest.approx(shape.front_z_mm + shape.lens_length_mm)
    plug = camera.pose.to_camera(cable.corners_mm)
    # From 7 mm inside the back, for the plug's depth, to where the cable may bend.
    assert plug[:, 2].min() == pytest.approx(
        local[:, 2].min() - CABLE_MM[0] / 2.0 - CABLE_MM[1], abs=7.1
    )
    assert np.ptp(plug[:, :2], axis=0) == pytest.approx([CABLE_MM[0]] * 2)


def test_a_camera_without_a_lens_has_none() -> None:
    camera = placed("eye", pose())
    bare = Body(camera.camera.body.size_mm, camera.camera.body.centre_camera_mm, 0.0, 0.0)
    blind = replace(camera, camera=replace(camera.camera, body=bare))
    assert [s.kind for s in camera_solids(blind)] == ["camera", "cable"]
    assert blind.pose.to_camera(lens_front(blind)[None])[0] == pytest.approx(
        [0, 0, bare.front_z_mm]
    )


def test_the_front_of_a_lens_lies_on_the_axis() -> None:
    camera = placed("eye", pose())
    body = camera.camera.body
    away = lens_front(camera) - camera.pose.position_rig_mm
    assert away == pytest.approx((body.front_z_mm + body.lens_length_mm) * camera.pose.axis_rig)
