"""Rays cast against solids whose shadows are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
import rigs

from geometry.raycast import Occluder
from geometry.surface import SurfacePoints
from solver.coverage.visibility import Visibility, cast_rays, cosines, tangent_planes
from solver.limits import MotionBox
from solver.motion import HeadPosition, rest, visibility_positions

UP = np.array([0.0, 0.0, 1.0])
REST = (rest(np.zeros(3)),)


def wall(x_mm: float, top_mm: float) -> Occluder:
    """A plate in the plane x = ``x_mm``, from far below to ``top_mm``, 2 m wide."""
    low, wide = -1000.0, 1000.0
    corners = [[x_mm, -wide, low], [x_mm, wide, low], [x_mm, wide, top_mm], [x_mm, -wide, top_mm]]
    return Occluder(np.array(corners), np.array([[0, 1, 2], [0, 2, 3]]))


def one_point(normal: np.ndarray = UP) -> SurfacePoints:
    return SurfacePoints(np.zeros((1, 3)), np.array([normal]))


def eye(elevation_deg: float, distance_mm: float = 500.0) -> np.ndarray:
    angle = np.radians(elevation_deg)
    return distance_mm * np.array([np.cos(angle), 0.0, np.sin(angle)])


def test_cosines_are_those_of_the_angle_to_the_normal() -> None:
    for elevation in (90.0, 60.0, 10.0, -20.0):
        found = cosines(one_point(), eye(elevation, 37.0))
        # Two roundings of doubles of order one.
        np.testing.assert_allclose(found, [np.sin(np.radians(elevation))], atol=1e-15)


def test_cosines_do_not_depend_on_where_the_point_is() -> None:
    shift = np.array([10.0, -20.0, 30.0])
    moved = SurfacePoints(np.zeros((1, 3)) + shift, UP[None])
    np.testing.assert_allclose(
        cosines(moved, eye(40.0) + shift), cosines(one_point(), eye(40.0)), atol=1e-14
    )


@pytest.mark.parametrize(("elevation", "facing"), [(30.1, True), (29.9, False), (-60.0, False)])
def test_facing_ends_at_the_limit_of_incidence(elevation: float, facing: bool) -> None:
    found = cast_rays(one_point(), Occluder.none(), eye(elevation)[None], 60.0, REST)
    assert found.facing.tolist() == [[facing]]
    assert found.free.tolist() == [[facing]]
    assert found.seen.tolist() == [[facing]]


def test_a_wall_hides_what_lies_behind_its_top() -> None:
    # Seen from the point the top is 45 degrees up, less the lift of 0.05 mm over 100 mm.
    occluder = wall(100.0, 100.0)
    eyes = np.stack([eye(a) for a in (44.9, 45.1, 30.0, 60.0)])
    found = cast_rays(one_point(), occluder, eyes, 89.0, REST)
    assert found.facing.all()
    assert found.free[:, 0].tolist() == [False, True, False, True]
    assert found.seen[:, 0].tolist() == [False, True, False, True]


def test_a_wall_behind_the_eye_hides_nothing() -> None:
    found = cast_rays(one_point(), wall(100.0, 100.0), eye(30.0, 50.0)[None], 89.0, REST)
    assert found.seen.tolist() == [[True]]


def test_a_ray_counts_only_where_it_holds_in_every_head_position() -> None:
    positions = (*REST, HeadPosition(np.eye(3), np.array([0.0, 0.0, 40.0]), np.zeros(3)))
    centre = np.array([[100.0, 0.0, 60.0]])
    # 31 degrees above the point at rest, 11 when the head has come up by 40 mm.
    at_rest = cast_rays(one_point(), Occluder.none(), centre, 70.0, REST)
    anywhere = cast_rays(one_point(), Occluder.none(), centre, 70.0, positions)
    assert at_rest.seen.all()
    assert not anywhere.facing.any()
    assert not anywhere.seen.any()
    worst = np.sin(np.arctan2(20.0, 100.0))
    np.testing.assert_allclose(anywhere.cosine, [[worst]], atol=1e-12)


def test_the_wall_moves_with_the_head() -> None:
    box = MotionBox(x_mm=30.0)
    positions = visibility_positions(box, np.zeros(3))
    # 50 degrees at rest; with the head 30 mm nearer, the same eye is lower as seen from it.
    centre = eye(46.0, 150.0)[None]
    occluder = wall(100.0, 100.0)
    assert cast_rays(one_point(), occluder, centre, 89.0, REST).seen.all()
    assert cast_rays(one_point(), occluder, centre, 89.0, positions).facing.all()
    inside = np.array([[90.0, 0.0, 80.0]])
    assert cast_rays(one_point(), occluder, inside, 89.0, REST).seen.all()
    assert not cast_rays(one_point(), occluder, inside, 89.0, positions).seen.all()


def test_rays_that_do_not_face_are_not_cast() -> None:
    found = cast_rays(one_point(), Occluder.none(), eye(-45.0)[None], 89.0, REST)
    assert found.free.tolist() == [[False]]


def test_many_points_and_cameras_agree_with_one_by_one() -> None:
    subject = rigs.face(30, 60)
    centres = np.stack([c.pose.position_rig_mm for c in rigs.face_cameras(subject, 3)])
    points = subject.design_points
    together = cast_rays(points, subject.occluder, centres, 70.0, REST)
    for i, centre in enumerate(centres):
        for p in range(len(points)):
            alone = points.subset(np.array([p]))
            cosine = cosines(alone, centre)[0]
            hidden = subject.occluder.hidden(alone.points_mm, alone.normals, centre)[0]
            assert together.facing[i, p] == (cosine >= np.cos(np.radians(70.0)))
            assert together.seen[i, p] == (together.facing[i, p] and not hidden)
            assert together.cosine[i, p] == pytest.approx(cosine, abs=1e-15)


def test_seen_needs_both() -> None:
    facing, free = np.array([[True, True, False]]), np.array([[True, False, False]])
    assert Visibility(facing, free, np.ones((1, 3))).seen.tolist() == [[True, False, False]]


def planes_of(elevation_deg: float, opening: np.ndarray) -> tuple[np.ndarray, float]:
    found = tangent_planes(
        one_point(),
        wall(100.0, 100.0),
        np.array([0]),
        eye(elevation_deg)[None],
        opening[None],
    )
    np.testing.assert_array_equal(found.point_mm, np.zeros((1, 3)))
    assert np.linalg.norm(found.normal[0]) == pytest.approx(1.0, abs=1e-12)
    return found.normal[0], float(found.deficit_deg[0])


@pytest.mark.parametrize("elevation", [40.0, 20.0, 5.0])
def test_the_plane_over_a_wall_rises_to_its_top(elevation: float) -> None:
    normal, deficit = planes_of(elevation, UP)
    # Fourteen halvings of less than 90 degrees leave 0.006; the lift of 0.05 mm is 0.015 degrees.
    assert deficit == pytest.approx(45.0 - elevation, abs=0.03)
    # Eyes over the top are above the plane and those under it below, to the same accuracy.
    assert normal @ eye(45.1) > 0.0
    assert normal @ eye(44.9) < 0.0
    # The edge of the wall runs along y, so the plane does too.
    assert normal[1] == pytest.approx(0.0, abs=1e-6)


def test_the_opening_need_not_be_a_unit_vector() -> None:
    long, short = planes_of(20.0, 1000.0 * UP), planes_of(20.0, 0.01 * UP)
    np.testing.assert_allclose(long[0], short[0], atol=1e-9)
    assert long[1] == pytest.approx(short[1], abs=1e-9)


def test_a_point_hidden_even_where_it_should_be_open_has_no_deficit() -> None:
    _, deficit = planes_of(20.0, eye(30.0))
    assert np.isinf(deficit)


def test_the_plane_over_a_round_solid_touches_it() -> None:
    # A ball of 20 mm radius at 100 mm: its top is asin(20 / 100) above the line to its middle.
    ball = Occluder(
        rigs.ellipsoid_mesh(90, 180)[0] / rigs.SEMI_AXES_MM * 20.0 + [100.0, 0.0, 0.0],
        rigs.ellipsoid_mesh(90, 180)[1],
    )
    found = tangent_planes(one_point(), ball, np.array([0]), eye(2.0)[None], UP[None])
    limit = np.degrees(np.arcsin(0.2))
    # A facet of 2 degrees lies up to 20 mm (1 - cos 1 deg) = 0.003 mm inside the ball: 0.002 deg,
    # doubled at a grazing ray; the lift turns the ray by 0.03 degrees.
    assert found.deficit_deg[0] == pytest.approx(limit - 2.0, abs=0.06)
    tangent = np.array([-np.sin(np.radians(limit)), 0.0, np.cos(np.radians(limit))])
    # The facet's own normal differs from the ball's by up to 2 degrees.
    assert found.normal[0] @ tangent > np.cos(np.radians(3.0))


def test_rows_pick_the_points() -> None:
    points = SurfacePoints(np.array([[0.0, 0, 0], [50.0, 0, 0]]), np.array([UP, UP]))
    found = tangent_planes(
        points, wall(100.0, 100.0), np.array([1]), eye(20.0)[None], np.array([UP])
    )
    np.testing.assert_array_equal(found.point_mm, [[50.0, 0.0, 0.0]])
    # From 50 mm the top of 100 mm is atan 2 up; the eye is at (470, 171), atan(171 / 420) up.
    seen_at = np.degrees(np.arctan2(eye(20.0)[2], eye(20.0)[0] - 50.0))
    assert found.deficit_deg[0] == pytest.approx(np.degrees(np.arctan(2.0)) - seen_at, abs=0.06)
