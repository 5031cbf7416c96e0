"""Which candidates look at each other: as the limit on sight lines judges pairs one by one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import rigs

from geometry.camera import Body, RigCamera
from geometry.frames import Pose, look_at_rotation
from solver.constraints.builders.bodies import body_constraints
from solver.limits import BaseHeight, Coverage, Limits
from solver.problem import Problem
from solver.search.candidates import Candidates
from solver.search.networks import Search
from solver.search.sight import in_each_others_view

CLEARANCE_MM = 5.0
BODY = Body([120.0, 90.0, 50.0], [0.0, 0.0, -40.0], 60.0, 50.0)
LIMITS = rigs.face_limits(coverage=Coverage(), sight_line_clearance_mm=CLEARANCE_MM)


def around(seed: int, count: int = 24) -> tuple[RigCamera, ...]:
    """Cameras all around the subject, some near and some far: many look at each other."""
    rng = np.random.default_rng(seed)
    kinds = (rigs.compact_camera(), replace(rigs.compact_camera(), body=BODY))
    out = []
    for k in range(count):
        away = rng.normal(size=3)
        place = away / np.linalg.norm(away) * rng.uniform(300.0, 900.0)
        pose = Pose(place, look_at_rotation(place, 40.0 * rng.normal(size=3), 30.0 * k))
        out.append(RigCamera(f"at{k}", kinds[k % 2], pose, float(np.linalg.norm(place))))
    return tuple(out)


def pool_of(cameras: tuple[RigCamera, ...], fixed: int) -> Candidates:
    """Candidates that see nothing, of which the last ``fixed`` stand already."""
    place = np.stack([c.pose.position_rig_mm for c in cameras])
    nothing, count = np.zeros((len(cameras), 6, 2)), len(cameras)
    seen = np.zeros((count, 2), dtype=np.bool_)
    share, away = np.full(2, 0.5), np.linalg.norm(place, axis=1)
    return Candidates(cameras, nothing, seen, share, 0.1, place, away, fixed)


def test_pairs_are_those_that_break_the_limit() -> None:
    cameras = around(3)
    problem = Problem(rigs.face(30, 60), cameras, LIMITS)
    state = problem.unknowns.state(problem.start_values())
    (rows,) = [r for r in body_constraints(problem, state) if r.block.family == "sight_line"]
    broken = rows.block.violation(state) > 0.0
    looks, seen = rows.block.columns[broken][:, 0] // 7, rows.block.columns[broken][:, 6] // 7
    expected = np.zeros((len(cameras), len(cameras)), dtype=np.bool_)
    expected[looks, seen] = True
    np.testing.assert_array_equal(in_each_others_view(cameras, CLEARANCE_MM), expected | expected.T)
    # A case in which nobody, or everybody, is in the way would show nothing.
    assert 0.05 < expected.mean() < 0.95


def test_a_network_holds_no_such_pair_unless_both_stand_already() -> None:
    cameras = around(3)
    found = in_each_others_view(cameras, CLEARANCE_MM)
    i, k = np.argwhere(np.triu(found))[0]
    order = [cameras[i], *cameras[5:9], cameras[k]]
    limits = replace(LIMITS, body_clearance_mm=None)
    limits = replace(limits, base_height=replace(limits.base_height, min=None))

    def too_close(fixed: int) -> bool:
        return bool(Search(pool_of(tuple(order), fixed), limits).too_close[0, 5])

    assert too_close(0)
    assert too_close(1)
    assert not too_close(6)


@pytest.mark.parametrize(
    "limits",
    [
        replace(LIMITS, sight_line_clearance_mm=None, body_clearance_mm=1e4),
        replace(LIMITS, sight_line_clearance_mm=None, base_height=BaseHeight(min=5.0)),
    ],
    ids=["bodies", "base/height"],
)
def test_cameras_that_stand_too_near_to_each_other_already_are_in_networks(limits: Limits) -> None:
    def too_close(fixed: int) -> bool:
        return bool(Search(pool_of(around(3, 6), fixed), limits).too_close[4, 5])

    assert too_close(1)
    assert not too_close(2)
