"""Rolls: what is allowed is nearest, started from, kept to the last digit, and judged by name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import rigs

from geometry.camera import RigCamera
from geometry.frames import Pose
from solver.constraints.builders.rolls import roll_constraints
from solver.constraints.table import constraint_table
from solver.design import design
from solver.limits import (
    ROLL_TOLERANCE_DEG,
    BaseHeight,
    Coverage,
    CoverageTier,
    Limits,
    Roll,
)
from solver.problem import Problem
from solver.quality import evaluate
from solver.result import Design
from solver.search.candidates import placed
from solver.starts import kmeans_start, strips, turned

OFF = Limits(frame=None, depth_of_field=False, body_clearance_mm=None, sight_line_clearance_mm=None)
LEVEL = (0.0,)
PORTRAIT = (90.0, -90.0)
ALLOWED = {Roll.LEVEL: LEVEL, Roll.PORTRAIT: PORTRAIT, Roll.LEVEL_OR_PORTRAIT: LEVEL + PORTRAIT}


def rolls(cameras: tuple[RigCamera, ...]) -> np.ndarray:
    return np.array([c.pose.pan_tilt_roll_deg[2] for c in cameras])


def off(cameras: tuple[RigCamera, ...], roll: Roll) -> float:
    """The largest distance in degrees of any camera's roll from the nearest allowed one."""
    away = rolls(cameras)[:, None] - np.array(ALLOWED[roll])
    return float(np.abs((away + 180.0) % 360.0 - 180.0).min(axis=1).max())


@pytest.mark.parametrize(
    ("roll", "turned_deg", "expected"),
    [
        (Roll.FREE, 37.0, 37.0),
        (Roll.LEVEL, 170.0, 0.0),
        (Roll.PORTRAIT, 1.0, 90.0),
        (Roll.PORTRAIT, -1.0, -90.0),
        (Roll.PORTRAIT, 179.0, 90.0),
        (Roll.LEVEL_OR_PORTRAIT, 44.0, 0.0),
        (Roll.LEVEL_OR_PORTRAIT, 46.0, 90.0),
        (Roll.LEVEL_OR_PORTRAIT, -46.0, -90.0),
    ],
)
def test_the_nearest_allowed_roll(roll: Roll, turned_deg: float, expected: float) -> None:
    assert roll.nearest_deg(turned_deg) == expected


def camera(
    roll_deg: float, forward: tuple[float, float, float], *, fixed: bool = False
) -> RigCamera:
    position = -800.0 * np.array(forward) / np.linalg.norm(forward)
    pose = Pose.looking_at(position, np.zeros(3), roll_deg)
    return RigCamera(f"r{roll_deg:g}", rigs.compact_camera(), pose, 900.0, fixed=fixed)


def told(roll: Roll, *cameras: RigCamera):  # noqa: ANN201
    """The rows about roll by name."""
    subject = rigs.face(30, 60)
    problem = Problem(subject, cameras, replace(OFF, roll=roll), origin=np.zeros(3))
    rows = constraint_table(problem, [np.ones((len(cameras), 60), dtype=np.bool_)], ())
    return {r.name: r for r in rows if r.family == "roll"}


AHEAD, ASKEW = (0.0, 1.0, 0.0), (0.4, 1.0, -0.5)


@pytest.mark.parametrize("forward", [AHEAD, ASKEW])
def test_a_roll_is_judged_against_the_nearest_allowed_one(
    forward: tuple[float, float, float],
) -> None:
    found = told(Roll.LEVEL_OR_PORTRAIT, camera(3.0, forward), camera(-90.2, forward))
    broken, kept = found["roll/r3"], found["roll/r-90.2"]
    assert (broken.limit, broken.unit, broken.satisfied) == (0.0, "deg", False)
    assert broken.value == pytest.approx(3.0)
    assert broken.slack == pytest.approx(ROLL_TOLERANCE_DEG - 3.0)
    assert (kept.limit, kept.satisfied, kept.active) == (-90.0, True, False)
    assert kept.slack == pytest.approx(ROLL_TOLERANCE_DEG - 0.2)


def test_a_picture_upside_down_is_not_level() -> None:
    assert abs(told(Roll.LEVEL, camera(180.0, ASKEW))["roll/r180"].value) == pytest.approx(180.0)
    assert not told(Roll.LEVEL, camera(180.0, ASKEW))["roll/r180"].satisfied
    assert not told(Roll.PORTRAIT, camera(0.0, AHEAD))["roll/r0"].satisfied


def test_who_has_no_roll_or_may_not_be_turned_is_not_judged() -> None:
    down = camera(0.0, (0.0, 1e-3, -1.0))
    assert told(Roll.PORTRAIT, down, camera(20.0, AHEAD, fixed=True)) == {}
    assert told(Roll.FREE, camera(20.0, AHEAD)) == {}


def test_rows_say_how_steeply_the_level_axis_rises() -> None:
    cameras = (camera(3.0, ASKEW), camera(-87.0, AHEAD), camera(9.0, AHEAD, fixed=True))
    problem = Problem(rigs.face(30, 60), cameras, replace(OFF, roll=Roll.LEVEL_OR_PORTRAIT))
    state = problem.unknowns.state(problem.start_values())
    (rows,) = roll_constraints(problem, state)
    tilt = np.radians(cameras[0].pose.pan_tilt_roll_deg[1])
    expected = np.sin(np.radians(3.0)) * np.array([np.cos(tilt), 1.0])
    np.testing.assert_allclose(np.abs(rows.block.value(state)), expected, atol=1e-12)
    np.testing.assert_allclose(rows.block.violation(state), expected, atol=1e-12)
    free = replace(problem, limits=OFF)
    assert roll_constraints(free, state) == []


@pytest.mark.parametrize("roll", ALLOWED)
def test_starts_and_candidates_keep_to_what_is_allowed(roll: Roll) -> None:
    subject, limits = rigs.face(), rigs.face_limits(roll=roll)
    kind, names = rigs.compact_camera(), rigs.names(3)
    networks = [kmeans_start(subject, kind, limits, names, 0, jitter=1.0)]
    networks += strips(subject, kind, limits, names)[:1]
    networks.append(placed(subject, kind, limits, step_deg=40.0).cameras)
    for cameras in networks:
        assert off(cameras, roll) < 1e-9
    askew = Pose.looking_at(np.array([100.0, -700.0, 200.0]), np.zeros(3), 200.0)
    given = turned(askew, limits)
    assert off((RigCamera("c", kind, given, 700.0),), roll) < 1e-9
    np.testing.assert_allclose(given.axis_rig, askew.axis_rig, atol=1e-12)
    assert turned(given, limits) is given


@pytest.mark.slow
def test_a_design_holds_its_rolls_to_the_last_digit() -> None:
    subject, coverage = rigs.face(40, 120), Coverage((CoverageTier(2, 0.9),))
    free = rigs.face_limits(coverage=coverage, base_height=BaseHeight(min=0.15, max=0.5))
    limits = replace(free, roll=Roll.LEVEL_OR_PORTRAIT)
    start = [
        Pose.looking_at(np.array(p), np.zeros(3), r)
        for p, r in (((-150.0, -700.0, 60.0), 30.0), ((150.0, -700.0, -60.0), -75.0))
    ]

    def place(limits: Limits) -> Design:
        kind = rigs.compact_camera()
        return design(subject, kind, limits, count=2, starts=1, start=tuple(start))

    found, without = place(limits), place(free)
    assert found.feasible, found.quality.violated
    # Rows are met to 2e-6 at worst before refinement, which is 1e-4 degrees.
    assert off(found.cameras, Roll.LEVEL_OR_PORTRAIT) < 1e-4
    assert {f"roll/{c.name}" for c in found.cameras} <= {r.name for r in found.quality.constraints}
    np.testing.assert_allclose(found.quality.cameras.roll_deg, rolls(found.cameras))
    # Left alone, these cameras stay as they were put, and evaluating them says so.
    broken = evaluate(subject, without.cameras, limits).violated
    assert {r.family for r in broken} == {"roll"}
