"""What a mount keeps clear of: the person's way in, the views, the floor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mounted import placed
from rigs import SEMI_AXES_MM, face, face_limits

from geometry.frames import Pose
from geometry.raycast import Occluder
from rig.build.mounts.surroundings import HEAD_ENTRY, Surroundings, Zone, head_entry
from rig.solids.convex import signed_distance


def around() -> Surroundings:
    return Surroundings(face(), face_limits(), (), -1200.0, 2.0)


def test_a_person_comes_in_from_behind_and_from_the_floor() -> None:
    zone = head_entry(face(), -1300.0)
    half = SEMI_AXES_MM
    assert zone.name == HEAD_ENTRY
    # The tessellated ellipsoid touches its poles only: within 0.2 mm across.
    assert zone.low_mm == pytest.approx([-half[0] - 150.0, -half[1] - 20.0, -1300.0], abs=0.2)
    assert zone.high_mm == pytest.approx(
        [half[0] + 150.0, half[1] + 1000.0, half[2] + 150.0], abs=0.2
    )


def test_a_zone_is_never_empty_although_the_floor_is_high() -> None:
    zone = head_entry(face(), 500.0)
    assert zone.low_mm[2] == pytest.approx(-SEMI_AXES_MM[2] - 1.0, abs=0.2)


def test_without_a_head_the_points_count() -> None:
    subject = replace(face(), occluder=Occluder.none())
    points = subject.check_points.points_mm
    zone = head_entry(subject, -1200.0)
    assert zone.low_mm[:2] == pytest.approx(points.min(axis=0)[:2] - [150.0, 20.0])


def test_the_shape_of_a_zone_is_its_box() -> None:
    zone = Zone("door", np.array([-1.0, 2.0, 3.0]), np.array([4.0, 6.0, 9.0]))
    assert zone.shape.low_mm.tolist() == [-1.0, 2.0, 3.0]
    assert zone.shape.high_mm.tolist() == [4.0, 6.0, 9.0]


def test_the_datum_is_the_foremost_point() -> None:
    datum = around().datum_mm
    assert datum[1] == pytest.approx(face().check_points.points_mm[:, 1].min(), abs=2.0)
    assert around().centroid_mm == pytest.approx(face().design_points.centroid_mm)


def test_a_view_holds_every_line_of_sight() -> None:
    camera = placed("eye", Pose.looking_at(np.array([200.0, -900.0, 100.0]), np.zeros(3)))
    view = around().view(camera)
    assert view is not None
    points = face().check_points
    towards = camera.pose.position_rig_mm - points.points_mm
    cosine = (towards * points.normals).sum(axis=1) / np.linalg.norm(towards, axis=1)
    # Well within the limit of 70 degrees, on a convex face: certainly seen.
    seen = points.points_mm[cosine > np.cos(np.radians(60.0))]
    assert len(seen) > 50
    for share in (0.3, 0.6, 0.95):
        for point in seen[::10]:
            spot = camera.pose.position_rig_mm + share * (point - camera.pose.position_rig_mm)
            assert signed_distance(view.corners_mm, spot[None]) < 1e-6


def test_a_camera_that_sees_nothing_has_no_view() -> None:
    back = Pose.looking_at(np.array([0.0, -900.0, 0.0]), np.array([0.0, -2000.0, 0.0]))
    assert around().view(placed("eye", back)) is None


def test_views_are_kept_clear_by_what_the_limits_say() -> None:
    assert around().view_clearance_mm == 0.0
    limits = replace(face_limits(), sight_line_clearance_mm=12.0)
    assert replace(around(), limits=limits).view_clearance_mm == 12.0
