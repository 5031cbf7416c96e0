"""The whole job on an ellipsoid face: feasible, better, repeatable, cancellable, honest."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
import rigs

from common.errors import CancelledError, InputError
from common.progress import Progress
from geometry.frames import Pose
from solver.beginnings import best_strip, unknown_to_search
from solver.design import _better_given, design
from solver.limits import (
    BaseHeight,
    Box,
    CoverageTier,
    HalfSpace,
    Limits,
    MotionBox,
    Spacing,
    Sphere,
    StandOff,
    Symmetry,
    Zones,
)
from solver.problem import Problem, camera_at
from solver.quality import evaluate
from solver.result import Design, Status
from solver.search import exchange
from solver.search.candidates import placed
from solver.strategy import Strategy


@pytest.fixture(scope="module", autouse=True)
def coarser_candidates() -> Iterator[None]:
    """Fewer candidates and shakes than the search's own, for speed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(exchange, "SHAKES", 10)
        patch.setattr(exchange, "FINER_SHAKES", 5)
        patch.setattr(exchange, "FINER", ((3.0, 20),))
        patch.setattr("solver.design.placed", partial(placed, step_deg=10.0))
        yield


@cache
def standard(strategy: Strategy, workers: int = 1, seed: int = 0) -> Design:
    return design(
        rigs.face(),
        rigs.compact_camera(),
        rigs.face_limits(),
        count=5,
        starts=1 if strategy is Strategy.EXCHANGE else 3,
        seed=seed,
        workers=workers,
        strategy=strategy,
    )


def place(limits: Limits, count: int = 4, starts: int = 2, **more: object) -> Design:
    """By the classical starts, which are quicker, unless told otherwise."""
    given = {"strategy": Strategy.K_MEANS} | more
    return design(rigs.face(), rigs.compact_camera(), limits, count=count, starts=starts, **given)


@pytest.mark.parametrize(
    "strategy", [Strategy.EXCHANGE, pytest.param(Strategy.K_MEANS, marks=pytest.mark.slow)]
)
def test_design_is_feasible_and_better_than_start_and_strip(strategy: Strategy) -> None:
    found = standard(strategy)
    assert found.feasible, found.quality.violated
    assert found.solver.status is Status.CONVERGED
    assert found.solver.kkt_error < 1e-4
    strip = best_strip(rigs.face(), rigs.compact_camera(), rigs.face_limits(), rigs.names(5))
    assert found.quality.cost_mm2 < found.start_quality.cost_mm2
    assert found.quality.cost_mm2 < evaluate(rigs.face(), strip, rigs.face_limits()).cost_mm2
    assert found.quality.in_focus_share == 1.0
    assert found.quality.in_frame_share == 1.0


def test_result_carries_its_evidence() -> None:
    found = standard(Strategy.K_MEANS)
    assert len(found.solver.starts) == 3
    assert {"k-means", "strip", "k-means, jittered"} == {s.kind for s in found.solver.starts}
    assert found.solver.why_stopped
    assert any(row.active for row in found.quality.constraints)
    points = found.quality.points
    assert points.covariance_mm2.shape == (len(points.points), 3, 3)
    np.testing.assert_allclose(
        points.sigma_mm**2, np.linalg.eigvalsh(points.covariance_mm2)[:, -1], rtol=1e-9
    )
    norm = np.linalg.norm(points.covariance_mm2, axis=(1, 2))
    assert found.quality.cost_mm2 == pytest.approx(norm.mean(), rel=1e-12)


def test_the_search_beats_the_classical_starts() -> None:
    found = standard(Strategy.EXCHANGE)
    assert {"exchange"} == {s.kind for s in found.solver.starts}
    assert found.solver.starts_note == ""
    assert found.quality.cost_mm2 < standard(Strategy.K_MEANS).quality.cost_mm2
    assert found.start_quality.feasible


def test_a_given_start_is_returned_where_what_was_found_is_worse() -> None:
    found, limits = standard(Strategy.K_MEANS), rigs.face_limits()
    good = Problem(rigs.face(), found.cameras, limits)
    poor = Problem(rigs.face(), found.start_cameras, limits)
    begin = evaluate(rigs.face(), poor.cameras, limits)
    problem, quality = _better_given(good, poor, begin, begin)
    assert problem is good
    assert quality.cost_mm2 == pytest.approx(found.quality.cost_mm2, rel=1e-9)
    assert _better_given(poor, good, found.quality, found.quality) == (good, found.quality)


def test_where_the_search_finds_nothing_the_classical_starts_are_tried(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("solver.beginnings.search_networks", lambda *_: [])
    found = place(rigs.face_limits(), count=3, starts=1, strategy=Strategy.EXCHANGE)
    assert {s.kind for s in found.solver.starts} == {"k-means"}
    assert "found no network" in found.solver.starts_note


def test_what_the_search_does_not_know_is_named() -> None:
    assert unknown_to_search(rigs.face_limits()) == ()
    limits = rigs.face_limits(
        spacing=Spacing(450.0, 5.0), base_height=BaseHeight(min=0.1, mean_max=0.4)
    )
    assert unknown_to_search(limits) == ("spacing", "mean base/height")
    assert unknown_to_search(rigs.wall_limits()) == (
        "bounds about a start",
        "mean incidence",
        "mean base/height",
    )


@pytest.mark.slow
def test_same_seed_same_bits_whatever_the_workers() -> None:
    one, two = (standard(Strategy.EXCHANGE, workers=n) for n in (1, 2))
    for a, b in zip(one.cameras, two.cameras, strict=True):
        assert a.pose.position_rig_mm.tobytes() == b.pose.position_rig_mm.tobytes()
        assert a.pose.rotation_rig_to_camera.tobytes() == b.pose.rotation_rig_to_camera.tobytes()
        assert a.focus_distance_mm == b.focus_distance_mm


@pytest.mark.slow
def test_another_seed_explores_elsewhere() -> None:
    first = standard(Strategy.K_MEANS).cameras[0].pose.position_rig_mm
    assert not np.array_equal(
        first, standard(Strategy.K_MEANS, seed=5).cameras[0].pose.position_rig_mm
    )


def test_cancel_takes_effect_within_a_second() -> None:
    cancel = threading.Event()
    asked: list[float] = []

    def on_progress(progress: Progress) -> None:
        if progress.stage == "solve" and not asked:
            asked.append(time.monotonic())
            cancel.set()

    with pytest.raises(CancelledError):
        place(rigs.face_limits(), count=6, starts=4, progress=on_progress, cancel=cancel)
    assert time.monotonic() - asked[0] < 1.0


def test_progress_never_falls_and_ends_at_one() -> None:
    seen: list[Progress] = []
    place(rigs.face_limits(), count=3, progress=seen.append)
    fractions = [p.fraction for p in seen]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
    assert {p.stage for p in seen} >= {"start", "solve", "choose", "done"}
    assert any(np.isfinite(p.cost) and np.isfinite(p.violation) for p in seen)


@pytest.mark.slow
def test_fixed_cameras_stay_and_count() -> None:
    subject = rigs.face()
    pose = Pose.looking_at(np.array([0.0, -1000.0, 0.0]), subject.design_points.centroid_mm)
    camera = rigs.compact_camera(focus_distance_mm=960.0)
    old = replace(camera_at(camera, "old", pose, np.zeros(3)), fixed=True)
    found = place(rigs.face_limits(), count=3, fixed=(old,), strategy=Strategy.EXCHANGE)
    assert found.cameras[0] is old
    assert len(found.cameras) == 4
    assert found.feasible, found.quality.violated


@pytest.mark.slow
def test_zones_are_respected_by_whole_bodies() -> None:
    zones = Zones(
        allowed=(Box(np.array([-700.0, -1300.0, -250.0]), np.array([700.0, -200.0, 600.0])),),
        forbidden=(
            Sphere(np.array([0.0, -900.0, 0.0]), 150.0),
            HalfSpace(np.array([0.0, 0.0, 1.0]), 350.0),
        ),
    )
    found = place(rigs.face_limits(zones=zones))
    assert found.feasible, found.quality.violated
    for camera in found.cameras:
        size = camera.camera.body.size_mm / 2.0
        corners = np.array(np.meshgrid(*[(-s, s) for s in size])).reshape(3, -1).T
        body = camera.pose.to_rig(corners + camera.camera.body.centre_camera_mm)
        assert (body >= zones.allowed[0].low_mm).all()
        assert (body[:, 2] <= 350.0).all()
        assert (np.linalg.norm(body - [0.0, -900.0, 0.0], axis=1) >= 150.0).all()


@pytest.mark.slow
def test_design_holds_for_the_head_anywhere_in_its_box() -> None:
    box = MotionBox(x_mm=15.0, y_mm=10.0, z_mm=15.0, yaw_deg=5.0)
    found = place(
        rigs.face_limits(
            motion=box,
            coverage=replace(rigs.face_limits().coverage, tiers=(CoverageTier(2, 0.95),)),
        )
    )
    assert found.feasible, found.quality.violated
    rng = np.random.default_rng(4)
    subject = rigs.face()
    middle = subject.design_points.centroid_mm
    for _ in range(20):
        yaw = np.radians(rng.uniform(-5.0, 5.0))
        turn = np.array(
            [[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1.0]]
        )
        shift = rng.uniform(-1.0, 1.0, 3) * [15.0, 10.0, 15.0]
        points = (subject.check_points.points_mm - middle) @ turn.T + middle + shift
        normals = subject.check_points.normals @ turn.T
        for camera in found.cameras:
            way = camera.pose.position_rig_mm - points
            facing = np.einsum("pk,pk->p", normals, way) > np.cos(
                np.radians(60.0)
            ) * np.linalg.norm(way, axis=1)
            pixels, _ = camera.camera.project(camera.pose, points[facing])
            assert (pixels > 19.0).all()
            assert (pixels < np.array(camera.camera.image_size_px) - 19.0).all()


@pytest.mark.slow
def test_spacing_and_symmetry_of_eqs_13_to_15() -> None:
    limits = rigs.face_limits(
        spacing=Spacing(450.0, 5.0),
        symmetry=Symmetry("x", 5.0, 5.0),
        coverage=replace(rigs.face_limits().coverage, tiers=()),
    )
    found = place(limits, count=5)
    assert found.feasible, found.quality.violated
    x = (
        np.array([c.pose.position_rig_mm[0] for c in found.cameras])
        - rigs.face().design_points.centroid_mm[0]
    )
    assert abs(x.mean() - np.median(x)) <= 5.0 + 1e-3
    assert abs(x.mean()) <= 5.0 + 1e-3
    row = next(r for r in found.quality.constraints if r.family == "spacing")
    assert abs(row.value - 450.0) <= 5.0 + 1e-3


@pytest.mark.slow
def test_contradicting_limits_are_named_with_what_each_would_have_to_give() -> None:
    limits = rigs.face_limits(
        stand_off=StandOff(400.0, 450.0),
        base_height=BaseHeight(min=0.15),
        coverage=replace(rigs.face_limits().coverage, tiers=()),
    )
    found = place(limits)
    assert found.solver.status is Status.INFEASIBLE
    assert not found.feasible
    named = {c.family: c for c in found.solver.conflicts}
    # 450 mm away the depth of the ellipsoid cannot be sharp at f/16 and 2 px, nor fit the frame.
    assert {"stand_off_max", "depth_of_field"} & set(named)
    assert any(c.amount > 0.0 for c in named.values())
    alone = named["stand_off_max"].amount_alone
    assert alone is not None
    wider = replace(limits, stand_off=StandOff(400.0, 450.0 + 1.2 * alone))
    assert place(wider).feasible


@pytest.mark.parametrize(
    ("change", "detail"),
    [
        ({"count": 0}, "no-cameras"),
        ({"starts": 0}, "starts"),
        ({"count": 2}, "limits-contradict"),
        ({"start": (Pose.looking_at(np.array([0.0, -900.0, 0.0]), np.zeros(3)),)}, "start-count"),
    ],
)
def test_bad_orders_are_refused(change: dict[str, object], detail: str) -> None:
    with pytest.raises(InputError) as caught:
        place(rigs.face_limits(), **change)
    assert caught.value.detail == detail
