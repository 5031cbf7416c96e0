"""Matchable pairs: counted by hand, groups that were planted, points that nobody could match."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import rigs

from common.errors import InputError
from geometry.camera import RigCamera
from geometry.frames import Pose
from geometry.raycast import Occluder
from geometry.subject import Subject
from geometry.surface import SurfacePoints
from solver.coverage.matchable import Matchable, MatchableViews, lacks
from solver.coverage.views import judge
from solver.coverage.visibility import cast_rays
from solver.limits import Box, HalfSpace, Limits, MotionBox, Sphere, Zones
from solver.matching import Matching, PairTier
from solver.problem import Problem
from solver.quality import Observations, evaluate

MATCHING = Matching(max_angle_deg=25.0, max_incidence_deg=50.0, max_scale_ratio=1.2)


@cache
def network() -> tuple[Subject, tuple[RigCamera, ...], Limits]:
    """Five cameras 15 degrees apart, one of them farther away and one out of focus."""
    subject, limits = rigs.face(20, 60), rigs.face_limits(matching=MATCHING)
    cameras = []
    for k, (turn_deg, away_mm, focus_mm) in enumerate(
        [(-30.0, 780.0, 710.0), (-15.0, 780.0, 710.0), (0.0, 1000.0, 930.0),
         (15.0, 780.0, 710.0), (30.0, 780.0, 640.0)]
    ):  # fmt: skip
        turn = np.radians(turn_deg)
        place = away_mm * np.array([np.sin(turn), -np.cos(turn), 0.1 * (k % 2)])
        pose = Pose.looking_at(place, np.zeros(3))
        cameras.append(RigCamera(f"c{k}", rigs.compact_camera(), pose, focus_mm))
    return subject, tuple(cameras), limits


def pairs_by_hand(
    subject: Subject, cameras: tuple[RigCamera, ...], limits: Limits
) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of each point and points of each pair, one ray at a time."""
    problem = Problem(subject, cameras, limits)
    sharp = Observations.of(problem, problem.visibility_positions[0]).sharp
    source, matching = subject.check_points, limits.matching
    of_point = np.zeros(len(source), dtype=int)
    of_pair = np.zeros((len(cameras), len(cameras)))
    for q, (point, normal) in enumerate(zip(source.points_mm, source.normals, strict=True)):
        for i, one in enumerate(cameras):
            for k, other in enumerate(cameras[:i]):
                rays = [c.pose.position_rig_mm - point for c in (one, other)]
                u, v = (r / np.linalg.norm(r) for r in rays)
                pixels = [c.pose.to_camera(point[None])[0, 2] for c in (one, other)]
                if (
                    sharp[i, q]
                    and sharp[k, q]
                    and np.degrees(np.arccos(u @ v)) <= matching.max_angle_deg
                    and max(np.degrees(np.arccos([u @ normal, v @ normal])))
                    <= matching.max_incidence_deg
                    and max(pixels) / min(pixels) <= matching.max_scale_ratio
                ):
                    of_point[q] += 1
                    of_pair[i, k] = of_pair[k, i] = of_pair[i, k] + 1
    return of_point, of_pair / len(source)


def test_pairs_are_those_that_a_plain_reading_finds() -> None:
    found = evaluate(*network()).matchable
    of_point, of_pair = pairs_by_hand(*network())
    assert 0 < np.count_nonzero(of_point) < len(of_point)
    np.testing.assert_array_equal(found.pairs_of_point, of_point)
    np.testing.assert_allclose(found.shared, of_pair, atol=1e-12)


@pytest.mark.parametrize(
    "wider",
    [
        replace(MATCHING, max_angle_deg=60.0),
        replace(MATCHING, max_incidence_deg=69.0),
        replace(MATCHING, max_scale_ratio=3.0),
    ],
)
def test_each_criterion_has_its_say(wider: Matching) -> None:
    subject, cameras, limits = network()
    more = evaluate(subject, cameras, replace(limits, matching=wider)).matchable
    few = evaluate(subject, cameras, limits).matchable
    assert (more.pairs_of_point >= few.pairs_of_point).all()
    assert more.pairs_of_point.sum() > few.pairs_of_point.sum()


def views(usable: list[list[int]], *x_mm: float, least: float = 0.25) -> MatchableViews:
    """Cameras side by side, 1 m before points at the origin."""
    seen = np.array(usable, dtype=bool)
    centres = np.array([[x, -1000.0, 0.0] for x in x_mm])
    points = np.zeros((seen.shape[1], 3))
    return MatchableViews(Matching(least_shared=least), seen, centres, points, np.ones(seen.shape))


def test_cameras_hang_together_directly_or_through_others() -> None:
    everything = [1, 1, 1, 1]
    chain = views([everything] * 4, -900.0, -300.0, 300.0, 900.0)
    # 33 degrees between neighbours in the middle, 25 at the ends, more than 40 to the others.
    assert chain.groups == ((0, 1, 2, 3),)
    apart = views([everything] * 4, -900.0, -300.0, 900.0, 2500.0)
    assert apart.groups == ((0, 1), (2, 3))
    little = views([everything, [1, 0, 0, 0], everything], 0.0, 10.0, 20.0, least=0.5)
    assert little.groups == ((0, 2), (1,))
    assert little.shared[0].tolist() == [0.0, 0.25, 1.0]
    assert views([everything], 0.0).groups == ((0,),)


def test_the_worst_head_position_counts() -> None:
    subject, cameras, limits = network()
    moving = replace(limits, motion=MotionBox(x_mm=15.0, yaw_deg=10.0))
    still, moved = (evaluate(subject, cameras, x).matchable for x in (limits, moving))
    assert len(moved.positions) == 9
    np.testing.assert_array_equal(still.pairs_of_point, moved.pairs_of_point)
    assert moved.share(1) < still.share(1)


def pit() -> Subject:
    """A plate that looks along -Y with two points on it, one of them at the bottom of a tube."""
    points = SurfacePoints([[0.0, 0, 0], [150.0, 0, 0]], [[0.0, -1, 0]] * 2)
    turn = np.linspace(0.0, 2.0 * np.pi, 33)[:-1]
    ring = 5.0 * np.stack([np.cos(turn), np.zeros(32), np.sin(turn)], axis=1)
    vertices = np.concatenate([ring, ring + np.array([0.0, -100.0, 0.0])])
    k = np.arange(32)
    after = (k + 1) % 32
    faces = np.concatenate(
        [np.stack([k, after, k + 32], axis=1), np.stack([after, after + 32, k + 32], axis=1)]
    )
    return Subject(points, points, Occluder(vertices, faces))


def reachable(limits: Limits, subject: Subject) -> list[bool]:
    usable = np.zeros((2, 2), dtype=bool)
    nobody = MatchableViews(
        limits.matching, usable, np.eye(3)[:2], subject.check_points.points_mm, np.ones((2, 2))
    )
    return Matchable(subject, limits, (nobody,)).reachable.tolist()


def test_what_nobody_could_match_is_left_out_of_the_share() -> None:
    # From the bottom of the tube one looks out within atan(5 / 100) = 3 degrees, too narrow for
    # two places 6 degrees apart.
    assert reachable(Limits(), pit()) == [False, True]
    cameras = tuple(
        RigCamera(f"c{k}", rigs.compact_camera(), Pose.looking_at(np.array(p), np.zeros(3)), 800.0)
        for k, p in enumerate([(-100.0, -790.0, 0.0), (100.0, -790.0, 0.0)])
    )
    found = evaluate(pit(), cameras, Limits()).matchable
    assert (found.reachable_share, found.share(1), found.share(2)) == (0.5, 1.0, 0.0)


@pytest.mark.parametrize(
    "zones",
    [
        Zones(allowed=(HalfSpace(np.array([0.0, 1.0, 0.0]), 0.0),)),
        Zones(allowed=(Sphere(np.zeros(3), 100.0),)),
        Zones(forbidden=(Box(np.full(3, -2000.0), np.full(3, 2000.0)),)),
    ],
)
def test_places_that_no_camera_may_take_reach_nothing(zones: Zones) -> None:
    assert reachable(Limits(zones=zones), pit()) == [False, False]


@pytest.mark.parametrize("angle_deg", [1.0, 10.0, 40.0])
def test_small_angles_reach_as_much_as_large_ones(angle_deg: float) -> None:
    matching = Matching(max_angle_deg=angle_deg)
    assert reachable(Limits(matching=matching), pit()) == [False, True]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("max_angle_deg", 0.0),
        ("max_angle_deg", 181.0),
        ("max_incidence_deg", 90.0),
        ("max_scale_ratio", 0.99),
        ("max_scale_ratio", float("nan")),
        ("least_shared", 0.0),
        ("least_shared", 1.01),
    ],
)
def test_what_no_pair_could_meet_is_refused_by_its_name(name: str, value: float) -> None:
    with pytest.raises(InputError, match=f"matching.{name}") as caught:
        Matching(**{name: value})
    assert caught.value.detail == "limit-value"


def asked(**changes: object) -> tuple[Subject, tuple[RigCamera, ...], Limits]:
    """The network with matching as a limit that it breaks in every way."""
    subject, cameras, limits = network()
    tiers = (PairTier(1, 0.9), PairTier(2, 0.5))
    strict = replace(
        MATCHING, **({"required": True, "tiers": tiers, "least_shared": 0.5} | changes)
    )
    return subject, cameras, replace(limits, matching=strict)


def test_what_is_asked_of_matching_is_judged_by_name() -> None:
    subject, cameras, limits = asked()
    quality = evaluate(subject, cameras, limits)
    rows = {r.name: r for r in quality.constraints}
    one, two, groups = rows["matchable_1/all"], rows["matchable_2/all"], rows["groups/all"]
    assert (one.value, one.limit) == (quality.matchable.share(1), 0.9)
    assert (two.value, two.limit) == (quality.matchable.share(2), 0.5)
    assert (groups.value, groups.limit) == (float(len(quality.matchable.groups)), 1.0)
    assert not (one.satisfied or two.satisfied or groups.satisfied)
    content = asked(least_shared=1e-6, tiers=(PairTier(1, one.value),))
    rows = {r.name: r for r in evaluate(*content).constraints}
    assert rows["matchable_1/all"].satisfied
    names = {r.family for r in evaluate(*asked(required=False)).constraints}
    assert not names & {"groups", "matchable_1"}


def test_the_solver_counts_what_lacks_as_it_is_judged() -> None:
    subject, cameras, limits = asked()
    # All in frame and sharp, as the solver takes them to be: other limits are for that.
    sharp = replace(cameras[0].camera, circle_of_confusion_mm=10.0, image_size_px=(9000, 9000))
    cameras = tuple(replace(c, camera=sharp) for c in cameras)
    problem = Problem(subject, cameras, limits)
    state, position = (
        problem.unknowns.state(problem.start_values()),
        problem.visibility_positions[0],
    )
    centres = np.stack([c.pose.position_rig_mm for c in cameras])
    found = cast_rays(subject.check_points, subject.occluder, centres, 70.0, (position,))
    quality = evaluate(subject, cameras, limits)
    lacking = lacks(problem, state, position, found)
    rows = {r.family: -r.slack for r in quality.violated}
    assert lacking
    assert lacking == {name: pytest.approx(rows[name]) for name in lacking}
    assert lacking.keys() == rows.keys() & {"matchable_1", "matchable_2", "groups"}
    assert judge(problem, state).shortfall >= max(lacking.values()) - 1e-12
    off = replace(problem, limits=replace(limits, matching=MATCHING))
    assert lacks(off, state, position, found) == {}


@pytest.mark.parametrize(("pairs", "share"), [(0, 0.5), (1, 0.0), (1, 1.01)])
def test_a_tier_of_pairs_that_means_nothing_is_refused(pairs: int, share: float) -> None:
    with pytest.raises(InputError, match="matching asks for"):
        PairTier(pairs, share)
