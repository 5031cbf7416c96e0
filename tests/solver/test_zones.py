"""Zones about the head and about the rig frame's origin."""

from __future__ import annotations

import numpy as np
import pytest
from rigs import ellipsoid_mesh, ellipsoid_points, face

from geometry.raycast import Occluder
from geometry.subject import Subject
from geometry.surface import SurfacePoints
from solver.limits import Box, HalfSpace, Sphere, ZoneOrigin, Zones
from solver.zones import in_rig_frame, origin_of

EVERY = (
    Box([-1.0, -2.0, -3.0], [1.0, 2.0, 3.0]),
    Sphere([1.0, 2.0, 3.0], 5.0),
    HalfSpace([0.0, -2.0, 0.0], 150.0),
)


def moved(by_mm: np.ndarray) -> Subject:
    points, (vertices, faces) = ellipsoid_points(50, 1), ellipsoid_mesh(20, 40)
    shifted = SurfacePoints(points.points_mm + by_mm, points.normals)
    return Subject(shifted, shifted, Occluder(vertices + by_mm, faces))


def test_zones_about_the_head_go_with_it() -> None:
    by = np.array([40.0, 900.0, -3000.0])
    here, there = moved(np.zeros(3)), moved(by)
    # The foremost point of the ellipsoid is at (0, -95, 0), one of its vertices.
    assert np.allclose(there.foremost_mm - here.foremost_mm, by)
    for zone in EVERY:
        one = in_rig_frame(Zones((zone,), (), ZoneOrigin.HEAD), here).allowed[0]
        other = in_rig_frame(Zones((), (zone,), ZoneOrigin.HEAD), there).forbidden[0]
        if isinstance(one, Box) and isinstance(other, Box):
            assert np.allclose(other.low_mm - one.low_mm, by)
            assert np.allclose(other.high_mm - one.high_mm, by)
        elif isinstance(one, Sphere) and isinstance(other, Sphere):
            assert np.allclose(other.centre_mm - one.centre_mm, by) and other.radius_mm == 5.0
        elif isinstance(one, HalfSpace) and isinstance(other, HalfSpace):
            assert one.offset_mm == pytest.approx(150.0 + 95.0)
            assert other.offset_mm - one.offset_mm == pytest.approx(-900.0)


def test_zones_about_the_origin_stay() -> None:
    there = moved(np.array([0.0, 900.0, 0.0]))
    for zones in (Zones(EVERY, (), ZoneOrigin.RIG), Zones()):
        assert in_rig_frame(zones, there) is zones


def test_what_zones_are_about_that_do_not_say_it() -> None:
    zones = Zones(EVERY)
    # The ellipsoid reaches 75 mm to either side, its surroundings 100 mm farther.
    assert origin_of(zones, moved(np.zeros(3))) is ZoneOrigin.RIG
    assert origin_of(zones, moved(np.array([170.0, 0.0, 0.0]))) is ZoneOrigin.RIG
    assert origin_of(zones, moved(np.array([180.0, 0.0, 0.0]))) is ZoneOrigin.HEAD
    bare = Subject(face().design_points, face().check_points, Occluder.none())
    assert origin_of(zones, bare) is ZoneOrigin.RIG
