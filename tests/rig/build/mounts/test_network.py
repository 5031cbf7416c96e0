"""What one camera's move does to the network, beside an evaluation of everything."""

from __future__ import annotations

from functools import cache

import pytest
from mounted import row
from rigs import face, face_cameras, face_limits

from geometry.camera import RigCamera
from geometry.frames import Pose
from rig.build.mounts.network import MountNetwork, Score, relative_slack, size_of
from solver.limits import BaseHeight, Coverage, CoverageTier, Limits
from solver.quality import evaluate
from solver.result import Sense


@cache
def limits() -> Limits:
    return face_limits(
        base_height=BaseHeight(min=0.05, neighbour_max=0.6),
        coverage=Coverage((CoverageTier(2, 0.9),)),
    )


@cache
def cameras() -> tuple[RigCamera, ...]:
    return face_cameras(face(100, 300), 6, limits())


def network() -> MountNetwork:
    return MountNetwork(face(100, 300), limits(), cameras())


def away(index: int, offset_mm: tuple[float, float, float]) -> RigCamera:
    camera = cameras()[index]
    pose = Pose(camera.pose.position_rig_mm + offset_mm, camera.pose.rotation_rig_to_camera)
    return camera.moved_to(pose)


def with_one(index: int, camera: RigCamera) -> tuple[RigCamera, ...]:
    return tuple(camera if k == index else c for k, c in enumerate(cameras()))


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (30.0, 0.0, 0.0), (0.0, -40.0, 25.0)])
@pytest.mark.parametrize("index", [0, 3, 5])
def test_rows_of_a_moved_camera_are_those_of_an_evaluation(
    index: int, offset: tuple[float, float, float]
) -> None:
    moved = away(index, offset)
    found = network().rows(index, moved)
    whole = evaluate(face(100, 300), with_one(index, moved), limits()).constraints
    true = {r.name: r for r in whole}
    assert len(found) > 5 and set(found) <= set(true)
    for name, one in found.items():
        assert one.value == pytest.approx(true[name].value, rel=1e-9, abs=1e-9)
        assert one.satisfied == true[name].satisfied


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (400.0, 0.0, 0.0), (0.0, 520.0, 0.0)])
def test_what_is_broken_is_what_an_evaluation_finds_broken(
    offset: tuple[float, float, float],
) -> None:
    for index in range(len(cameras())):
        moved = away(index, offset)
        told = network().broken(index, moved)
        quality = evaluate(face(100, 300), with_one(index, moved), limits())
        names = {r.name for r in quality.violated}
        if told:
            assert told in names
        else:
            assert not {n for n in names if moved.name in n or n.startswith("coverage")}


def test_moving_for_good_is_the_same_as_starting_there() -> None:
    moved = away(2, (20.0, 10.0, -15.0))
    walked = network()
    walked.move(2, moved)
    fresh = MountNetwork(face(100, 300), limits(), with_one(2, moved))
    for index in (0, 2, 4):
        camera = walked.cameras[index]
        a, b = walked.score(index, camera), fresh.score(index, camera)
        assert (a.breach, a.lack) == pytest.approx((b.breach, b.lack), abs=1e-9)
        # Sums of information are kept up to date: only rounding may differ.
        assert a.cost_mm2 == pytest.approx(b.cost_mm2, rel=1e-9)
    assert walked.cameras[2] is moved


def test_the_cost_follows_that_of_an_evaluation() -> None:
    index, net = 1, network()
    here = evaluate(face(100, 300), cameras(), limits()).cost_mm2
    at = net.score(index, cameras()[index]).cost_mm2
    for offset in ((150.0, 0.0, 0.0), (0.0, -300.0, 0.0)):
        moved = away(index, offset)
        there = evaluate(face(100, 300), with_one(index, moved), limits()).cost_mm2
        # 300 of 300 points are sampled; the evaluation counts blur besides, which is small here.
        assert net.score(index, moved).cost_mm2 / at == pytest.approx(there / here, rel=0.1)


def test_a_margin_that_is_not_kept_lacks_without_breaking() -> None:
    net = network()
    free = net.score(0, cameras()[0])
    rows = net.rows(0, cameras()[0]).items()
    name, tight = min(rows, key=lambda item: abs(relative_slack(item[1]) - 0.2))
    net.margins = {name: tight.slack + 0.5 * size_of(tight)}
    asked = net.score(0, cameras()[0])
    # What is broken already lacks besides.
    assert asked.lack - free.lack == pytest.approx(0.5, abs=2e-4)
    assert (asked.breach, asked.cost_mm2) == (free.breach, free.cost_mm2)


def test_scores_are_compared_by_breach_then_lack_then_cost() -> None:
    assert Score(0.0, 9.0, 9.0) < Score(0.1, 0.0, 0.0)
    assert Score(0.1, 0.0, 9.0) < Score(0.1, 0.1, 0.0)
    assert Score(0.1, 0.1, 1.0) < Score(0.1, 0.1, 2.0)


def test_focus_is_set_where_near_and_far_are_equally_sharp() -> None:
    net, camera = network(), cameras()[0]
    focused = net.focused(0, camera)
    distance = focused.focus_distance_mm
    points = net._depth_points[0]
    depth = (points - camera.pose.position_rig_mm) @ camera.pose.axis_rig
    near, far = depth.min(), depth.max()
    # The circle of blur grows as |1/z - 1/focus|: equal at both ends.
    assert 1.0 / near - 1.0 / distance == pytest.approx(1.0 / distance - 1.0 / far, rel=1e-9)
    fixed = RigCamera("f", camera.camera, camera.pose, 777.0, fixed=True)
    assert net.focused(0, fixed).focus_distance_mm == 777.0


def test_the_size_of_a_row_is_its_limit_or_its_tolerance() -> None:
    assert size_of(row("a", 1.0, limit=-40.0)) == 40.0
    assert size_of(row("a", 1.0, limit=0.0)) == 1e-3
    assert size_of(row("even", 0.5, limit=0.0, sense=Sense.EQUAL)) == 2.0
    assert relative_slack(row("a", -2.0)) == -0.2
