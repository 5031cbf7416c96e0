"""Rounding and tolerances: what the plan says is what an evaluation finds."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from rigs import compact_camera, face, face_limits

from geometry.camera import RigCamera
from geometry.frames import Pose
from rig.build.mounts.linear import LinearModel
from rig.build.mounts.making import make_plan
from rig.build.mounts.network import MountNetwork, relative_slack
from rig.build.mounts.plan import MountPlan
from rig.build.mounts.systemfile import parse_system
from solver.limits import BaseHeight, Coverage, CoverageTier, Limits
from solver.problem import camera_at
from solver.quality import evaluate
from solver.result import ConstraintRow, Sense


@cache
def limits() -> Limits:
    return face_limits(
        base_height=BaseHeight(min=0.05, neighbour_max=0.5),
        coverage=Coverage((CoverageTier(2, 0.9),)),
    )


@cache
def cameras() -> tuple[RigCamera, ...]:
    """Four cameras a metre away, which keep all limits with a little to spare."""
    target, points = face().design_points.centroid_mm, face().check_points.points_mm
    places = ((-320.0, 120.0, 10.0), (-110.0, -160.0, 0.0), (110.0, 150.0, 95.0), (330.0, -90.0, 0))
    return tuple(
        camera_at(
            compact_camera(),
            f"cam{k:02d}",
            Pose.looking_at(target + np.array([x, -950.0, z]), target, roll),
            points,
        )
        for k, (x, z, roll) in enumerate(places, 1)
    )


@cache
def plan() -> MountPlan:
    return make_plan(cameras(), face(), limits(), parse_system('kind = "t-slot"'), trials=3)


@pytest.mark.slow
def test_what_is_built_keeps_the_limits() -> None:
    price = plan().price
    assert price.designed.feasible
    assert price.built.broken == ()
    assert price.built.feasible
    assert price.sigma_loss < 0.05


def test_a_tolerance_ends_where_a_limit_breaks() -> None:
    mounts = {mount.name: mount for mount in plan().mounts}
    tried = 0
    for tolerance in plan().tolerances:
        mount = mounts[tolerance.camera]
        for way, reach in ((1.0, tolerance.plus), (-1.0, tolerance.minus)):
            if not np.isfinite(reach) or reach == 0.0:
                continue
            # Known to 5 % of itself and to a tenth of half a step, rounded down.
            inside, outside = 0.98 * reach, 1.07 * reach + 0.1
            held = [
                evaluate(
                    face(),
                    tuple(
                        (m.moved({tolerance.setting: m.values()[tolerance.setting] + way * off})
                         if m is mount else m).camera
                        for m in plan().mounts
                    ),
                    limits(),
                ).feasible
                for off in (inside, outside)
            ]  # fmt: skip
            assert held == [True, False], tolerance
            tried += 1
    assert tried > 6


def test_the_quick_rows_are_those_of_the_evaluation() -> None:
    network = MountNetwork(face(), limits(), cameras())
    whole = {row.name: row for row in evaluate(face(), cameras(), limits()).constraints}
    seen = 0
    for index, camera in enumerate(cameras()):
        for name, row in network.rows(index, camera).items():
            assert row.value == pytest.approx(whole[name].value, rel=1e-9, abs=1e-9)
            seen += 1
    assert seen > 20


def _row(name: str, slack: float, sense: Sense = Sense.AT_LEAST) -> dict[str, ConstraintRow]:
    value = 10.0 + slack if sense is Sense.AT_LEAST else 2.0 - slack
    limit = 10.0 if sense is Sense.AT_LEAST else 0.0
    return {name: ConstraintRow(name, value, limit, sense, "mm", slack, False, slack >= 0.0)}


def test_the_least_move_gains_what_a_limit_lacks() -> None:
    model = LinearModel()
    model.rows(_row("a/x", -1.0))
    model.move(_row("a/x", -1.0), _row("a/x", 0.0), 0.5)
    move = model.made().least_move({})
    # Two of slack per mm; the weight against moving leaves (3 mm * 300 * 0.2)^-2, 0.003 %.
    assert move == pytest.approx([0.5], rel=1e-3)


def test_margins_do_not_reach_past_the_middle_of_a_tolerance() -> None:
    model = LinearModel()
    near, far = _row("c/x", 0.0, Sense.EQUAL), _row("c/x", 1.0, Sense.EQUAL)
    model.rows(near)
    model.error(near, far, 1.0, 100.0)
    model.move(near, far, 1.0)
    linear = model.made()
    margins = linear.margins(1.0)
    # The tolerance is 2: at most 0.9 of it is asked for, short of the middle.
    assert margins == {"c/x": pytest.approx(1.8)}
    assert linear.least_move(margins) == pytest.approx([1.8], rel=1e-3)


def test_slack_is_told_as_a_share_of_the_tolerance() -> None:
    assert relative_slack(_row("c/x", 0.5, Sense.EQUAL)["c/x"]) == pytest.approx(0.25)
