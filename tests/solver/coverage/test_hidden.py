"""What stays hidden: the cones that keep points out of view, over walls and beyond the limit."""

from __future__ import annotations

import numpy as np
import pytest
import rigs

from geometry.frames import Pose
from geometry.raycast import Occluder
from geometry.subject import Subject
from geometry.surface import SurfacePoints
from solver.constraints.builders.coverage import hidden_constraints
from solver.coverage.hidden import KeptHidden, kept_hidden
from solver.coverage.views import framed_at
from solver.limits import Incidence, MotionBox
from solver.problem import Problem, camera_at
from solver.variables import NetworkState

WALL = Occluder(
    np.array(
        [[-1e3, -100.0, -1e3], [1e3, -100.0, -1e3], [1e3, -100.0, 100.0], [-1e3, -100.0, 100.0]]
    ),
    np.array([[0, 1, 2], [0, 2, 3]]),
)
"""100 mm high and 100 mm before the point: its edge is 45 degrees up."""


def scene(occluder: Occluder, motion: MotionBox | None = None) -> Problem:
    """A camera and a point that faces up, seen up to 60 degrees from that: from 30 degrees up."""
    points = SurfacePoints(np.array([[0.0, 0.0, 0.0], [0.0, 200.0, 0.0]]), np.eye(3)[[2, 2]])
    pose = Pose.looking_at(eye(20.0), np.zeros(3))
    camera = camera_at(rigs.compact_camera(), "a", pose, np.zeros((1, 3)))
    limits = rigs.face_limits(motion=motion, incidence=Incidence(ray_max_deg=60.0))
    return Problem(Subject(points, points, occluder), (camera,), limits, origin=np.zeros(3))


def eye(elevation_deg: float) -> np.ndarray:
    angle = np.radians(elevation_deg)
    return 600.0 * np.array([0.0, -np.cos(angle), np.sin(angle)])


def state_at(problem: Problem, elevation_deg: float) -> NetworkState:
    values = problem.start_values()
    values[3:6] = problem.scaled(eye(elevation_deg)[None])[0]
    return problem.unknowns.state(values)


def came_into_view(problem: Problem, before_deg: float, after_deg: float) -> KeptHidden:
    before, after = state_at(problem, before_deg), state_at(problem, after_deg)
    assert not framed_at(problem, before)[0, 0]
    return kept_hidden(problem, before, after, np.array([0]), np.array([0]))


@pytest.mark.parametrize(
    ("occluder", "before_deg", "edge_deg"),
    # The wall's edge is found to a few hundredths of a degree, and 0.06 are kept from it.
    [(WALL, 35.0, 45.0), (Occluder.none(), 20.0, 30.0)],
    ids=["over a wall", "within the limit of incidence"],
)
def test_a_point_that_came_into_view_is_kept_out_of_it(
    occluder: Occluder, before_deg: float, edge_deg: float
) -> None:
    problem = scene(occluder)
    kept = came_into_view(problem, before_deg, edge_deg + 8.0)
    assert (kept.camera.tolist(), kept.point.tolist()) == ([0], [0])
    (rows,) = hidden_constraints(problem, kept, state_at(problem, before_deg))
    for elevation in np.r_[before_deg - 4.0, before_deg, edge_deg + np.array([-0.2, 0.1, 5.0])]:
        state = state_at(problem, elevation)
        holds = rows.block.violation(state)[0] == 0.0
        assert holds == (elevation < edge_deg)
        assert framed_at(problem, state)[0, 0] == (elevation > edge_deg)


def test_rows_hold_where_the_network_stands_however_near() -> None:
    problem = scene(Occluder.none())
    kept = came_into_view(problem, 20.0, 40.0)
    near = state_at(problem, 30.0 - 1e-7)
    (rows,) = hidden_constraints(problem, kept, near)
    assert rows.block.violation(near)[0] <= 1e-15


def test_every_position_of_the_head_from_which_it_came_into_view_has_its_cone() -> None:
    problem = scene(WALL, MotionBox(z_mm=20.0))
    # The head moves before a wall that moves with it: 20 mm up or down are 2 degrees from 600 mm.
    kept = came_into_view(problem, 35.0, 60.0)
    heights = np.unique(np.round(kept.tip[:, 2] * problem.length_mm, 6))
    np.testing.assert_allclose(heights, [-20.0, 0.0, 20.0], atol=1e-9)


def test_what_a_camera_sees_now_is_no_longer_kept_from_it() -> None:
    kept = came_into_view(scene(WALL), 35.0, 60.0)
    both = KeptHidden.none().joined(kept).joined(kept)
    assert len(both.camera) == 2
    assert len(both.but(np.zeros((1, 2), dtype=bool)).camera) == 2
    assert len(both.but(np.array([[True, False]])).camera) == 0
