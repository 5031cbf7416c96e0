"""What a capture proves: lags, skews, levels and the verdict."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st
from memorybench import BenchMaker
from memoryrig import CameraScript, memory_station, with_camera, with_policy

from common.errors import InputError
from rig.acquisition.cameras.base import (
    CameraCapabilities,
    CameraInfo,
    CameraSettings,
    Frame,
    FrameStatus,
    Image,
    TimestampKind,
    TriggerKind,
)
from rig.acquisition.station.pulses import arm_request
from rig.acquisition.station.spec import LightPlan, Station
from rig.acquisition.synchrony.cameraframes import CameraFrames, Method, Pair, Pairing
from rig.acquisition.synchrony.capturedata import CameraPart, CaptureData
from rig.acquisition.synchrony.clocks import TriggerTime, TriggerTimeSource, clock_jumped
from rig.acquisition.synchrony.evidence import Passed, against, stamp_evidence, sync_class
from rig.acquisition.synchrony.lags import estimate_lags, new_timings
from rig.acquisition.synchrony.verdict import Board, Level, SyncState, gather
from rig.acquisition.trigger.box import Edge, FireOutcome, FireReport

START = 5 * 10**11
DEVICE = CameraCapabilities(TriggerKind.EDGE, TimestampKind.DEVICE, True)
MUTE = CameraCapabilities(TriggerKind.EDGE, TimestampKind.NONE, False)
PTP = CameraCapabilities(TriggerKind.EDGE, TimestampKind.PTP, True)


def captured(
    station: Station,
    lags_us: Sequence[Sequence[float]],
    exposure_us: float | None = 4000.0,
    half_us: float = 10.0,
    capabilities: CameraCapabilities = DEVICE,
) -> CaptureData:
    """Captures as pairing leaves them, with these lags by camera and shot."""
    shots = len(lags_us[0])
    request = arm_request(station, station.cameras, "box", shots, 50_000.0)
    edges = tuple(
        Edge(k + 1, output, True, p.delay_us, START + round((p.delay_us + k * 5e4) * 1000), 0.5)
        for k in range(shots)
        for output, p in request.pulses.items()
    )
    report = FireReport("box", FireOutcome.FIRED, shots, shots, edges, 5.0)
    parts = []
    for plan, lags in zip(station.cameras, lags_us, strict=True):
        trigger_times = tuple(
            TriggerTime(e.shot, e.at_host_ns, 5.0, TriggerTimeSource.EDGE_LOG)
            for e in report.rising_edges(plan.output or 0)
        )
        pairs = tuple(
            pair_of(plan.id, i, lag, exposure_us, half_us, capabilities)
            for i, lag in zip(trigger_times, lags, strict=True)
        )
        received = CameraFrames(
            plan.name, capabilities, tuple(p.frame for p in pairs), trigger_times, START
        )
        info = CameraInfo(plan.id, "memory")
        pairing = Pairing(plan.name, pairs, ())
        parts.append(CameraPart(plan, info, CameraSettings(), received, pairing))
    now = datetime(2026, 11, 22, tzinfo=UTC)
    return CaptureData("c", shots, 5e4, now, START, request, report, shots, tuple(parts))


def pair_of(
    camera: str,
    trigger_time: TriggerTime,
    lag_us: float,
    exposure_us: float | None,
    half_us: float,
    capabilities: CameraCapabilities,
) -> Pair:
    at = trigger_time.at_host_ns + round(lag_us * 1000)
    stamped = capabilities.timestamps is TimestampKind.DEVICE
    frame = Frame(
        camera,
        at + 10**7,
        FrameStatus.OK,
        device_ns=at - 7 if capabilities.timestamps is not TimestampKind.NONE else None,
        exposure_us=exposure_us,
    )
    if stamped:
        return Pair(trigger_time.shot, frame, Method.TIMESTAMP, at, half_us)
    return Pair(trigger_time.shot, frame, Method.ARRIVAL)


def test_lags_and_skews_of_three_cameras() -> None:
    station = memory_station()
    evidence = gather(station, captured(station, [[100.0, 110.0], [200.0, 190.0], [900.0, 905.0]]))
    lags = {c.camera: c.lag_us for c in evidence.stamps.cameras}
    assert lags == pytest.approx({"cam01": 105.0, "cam02": 195.0, "cam03": 902.5})
    worst = {c.camera: c.skew_us for c in evidence.stamps.cameras}
    # From the median camera, in each camera's worst shot.
    assert worst == pytest.approx({"cam01": -100.0, "cam02": 0.0, "cam03": 715.0})
    assert {s.shot: s.spread_us for s in evidence.stamps.shots} == {1: 800.0, 2: 795.0}
    # Shutters of 4 ms that open 0.8 ms apart are open together for 3.2 ms.
    assert evidence.stamps.shots[0].overlap_us == pytest.approx(3200.0)
    # A lag carries the doubt of the box's clock (5) and of the camera's (10); a spread only
    # those of two cameras: the box's clock is common to all.
    assert evidence.stamps.cameras[0].lag_uncertainty_us == pytest.approx(15.0)
    assert evidence.stamps.shots[0].spread_uncertainty_us == pytest.approx(20.0)
    verdict = evidence.verdict
    assert (verdict.state, verdict.level) == (SyncState.SYNCHRONISED, Level.STAMPS)
    assert verdict.within_us == pytest.approx(820.0)
    assert verdict.lacking == ("C: no timing board was looked for",)


@pytest.mark.parametrize(
    ("limit", "state", "passed"),
    [
        (1000.0, SyncState.SYNCHRONISED, Passed.PASS),
        (810.0, SyncState.UNDECIDED, Passed.PASS),
        (300.0, SyncState.NOT_SYNCHRONISED, Passed.FAIL),
    ],
)
def test_a_limit_is_kept_only_for_certain(limit: float, state: SyncState, passed: Passed) -> None:
    station = with_policy(memory_station(), skew_limit_us=limit)
    evidence = gather(station, captured(station, [[100.0], [200.0], [900.0]]))
    assert evidence.verdict.state is state
    assert evidence.stamps.cameras[2].passed is passed
    assert evidence.stamps.cameras[1].passed is Passed.PASS


@given(st.floats(0.0, 1e4), st.floats(0.0, 1e3), st.floats(1.0, 1e4))
def test_pass_and_fail_are_both_certain(value: float, doubt: float, limit: float) -> None:
    verdict = against(limit, value, doubt)
    for truth in (value - doubt, value, value + doubt):
        if verdict is Passed.PASS:
            assert truth <= limit * (1 + 1e-12)
        if verdict is Passed.FAIL:
            assert truth >= limit * (1 - 1e-12)
    assert against(limit, math.nan, doubt) is None


def test_middles_count_where_exposures_differ() -> None:
    """Two shutters that open together and close 2 ms apart are 1 ms apart in the middle."""
    station = memory_station(2)
    shot = captured(station, [[100.0], [100.0]])
    long = shot.parts[1].pairing.pairs[0]
    longer = replace(long, frame=replace(long.frame, exposure_us=6000.0))
    pairing = replace(shot.parts[1].pairing, pairs=(longer,))
    mixed = replace(shot, parts=(shot.parts[0], replace(shot.parts[1], pairing=pairing)))
    (timing,) = stamp_evidence(mixed, 500.0).shots
    assert timing.spread_us == pytest.approx(1000.0) and timing.middles
    unknown = gather(station, captured(station, [[100.0], [150.0]], exposure_us=None))
    (starts,) = unknown.stamps.shots
    assert starts.spread_us == pytest.approx(50.0) and not starts.middles
    assert math.isnan(starts.overlap_us)


def test_level_a_alone_proves_nothing_of_the_cameras() -> None:
    station = memory_station()
    evidence = gather(station, captured(station, [[0.0]] * 3, capabilities=MUTE))
    assert evidence.edges is not None and evidence.edges.error_us == pytest.approx(0.5)
    assert (evidence.verdict.state, evidence.verdict.level) == (SyncState.UNPROVEN, Level.EDGES)
    assert "made its edges to 0.5 us" in evidence.verdict.text
    assert "B: no usable time stamps of cam01, cam02, cam03" in evidence.verdict.lacking


def test_without_an_edge_log_there_is_nothing() -> None:
    station = memory_station()
    shot = captured(station, [[0.0]] * 3, capabilities=MUTE)
    assert shot.report is not None
    evidence = gather(station, replace(shot, report=replace(shot.report, edges=())))
    assert (evidence.verdict.state, evidence.verdict.level) == (SyncState.UNPROVEN, Level.NONE)
    assert "A: no edge log of a trigger box" in evidence.verdict.lacking


def test_cameras_on_one_clock_are_compared_without_the_hosts() -> None:
    station = memory_station()
    evidence = gather(station, captured(station, [[0.0], [40.0], [90.0]], capabilities=PTP))
    assert evidence.stamps.shots[0].spread_us == pytest.approx(90.0)
    assert all(math.isnan(c.lag_us) for c in evidence.stamps.cameras)
    assert evidence.verdict.state is SyncState.SYNCHRONISED


def test_one_camera_is_always_together() -> None:
    station = memory_station(1)
    verdict = gather(station, captured(station, [[500.0]])).verdict
    assert verdict.state is SyncState.SYNCHRONISED and verdict.within_us == 0.0


@pytest.mark.parametrize(
    ("trigger", "stamps", "output", "name"),
    [
        (TriggerKind.EDGE, TimestampKind.DEVICE, 1, "hardware"),
        (TriggerKind.EDGE, TimestampKind.DEVICE, None, "none"),
        (TriggerKind.SOFTWARE, TimestampKind.PTP, None, "ptp"),
        (TriggerKind.SOFTWARE, TimestampKind.DEVICE, None, "software"),
        (TriggerKind.NONE, TimestampKind.NONE, 1, "none"),
    ],
)
def test_every_camera_has_a_class(
    trigger: TriggerKind, stamps: TimestampKind, output: int | None, name: str
) -> None:
    assert sync_class(CameraCapabilities(trigger, stamps, False), output).value == name


@dataclass(frozen=True)
class Reading:
    mid_us: float
    exposure_us: float
    mid_sigma_us: float = 2.0
    exposure_sigma_us: float = 3.0


def board(readings: Sequence[Reading | None], range_us: float = 1e6) -> Board:
    """A board that gives these readings, one picture after the other."""
    left = list(readings)

    def read(picture: Image, exposure_us: float | None) -> Reading:  # noqa: ARG001
        found = left.pop(0)
        if found is None:
            raise InputError("board-not-seen", "the board is not seen", "turn it")
        return found

    return Board(read, range_us)


def pictured(shot: CaptureData) -> CaptureData:
    """The same with pixels to look at."""
    import numpy as np

    pixels = np.zeros((4, 4), np.uint8)
    parts = []
    for part in shot.parts:
        pairs = tuple(replace(p, frame=replace(p.frame, pixels=pixels)) for p in part.pairing.pairs)
        parts.append(replace(part, pairing=replace(part.pairing, pairs=pairs)))
    return replace(shot, parts=tuple(parts))


LIT = memory_station(3, leds=(LightPlan(15, 0.0, 1000.0),))


def test_the_timing_board_is_the_highest_level() -> None:
    """Exposures of 4 ms with lags of 100, 250 and 400 us: middles at 2100, 2250 and 2400."""
    readings = [Reading(2100.0, 4000.0), Reading(2250.0, 4000.0), Reading(2400.0, 4000.0)]
    shot = pictured(captured(LIT, [[0.0]] * 3, capabilities=MUTE))
    evidence = gather(LIT, shot, board(readings))
    assert evidence.optical is not None
    assert [r.lag_us for r in evidence.optical.readings] == pytest.approx([100.0, 250.0, 400.0])
    assert evidence.optical.spread_us == pytest.approx(300.0)
    assert evidence.verdict.level is Level.OPTICAL
    # 300 us, and three sigmas of 2 us of each of two readings.
    assert evidence.verdict.within_us == pytest.approx(312.0)


def test_a_board_that_one_camera_cannot_see_is_no_proof_for_all() -> None:
    shot = pictured(captured(LIT, [[0.0]] * 3))
    readings = [Reading(2100.0, 4000.0), None, Reading(2400.0, 4000.0)]
    evidence = gather(LIT, shot, board(readings))
    assert evidence.verdict.level is Level.STAMPS
    assert "C: the timing board was not read by cam02" in evidence.verdict.lacking
    assert evidence.optical is not None
    assert evidence.optical.unread == {"cam02": "the board is not seen"}


def test_a_counter_that_has_gone_round_gives_the_lag_that_is_expected() -> None:
    station = with_camera(LIT, "cam01", expected_lag_us=114_000.0)
    shot = pictured(captured(station, [[0.0]] * 3))
    # A board of 65.536 ms shows 114.3 ms of lag as 48.764 ms.
    reading = Reading((114_300.0 + 2000.0) % 65_536.0, 4000.0)
    evidence = gather(station, shot, board([reading, None, None], 65_536.0))
    assert evidence.optical is not None
    assert evidence.optical.readings[0].lag_us == pytest.approx(114_300.0)


def test_lags_of_several_captures_and_the_delays_they_ask_for() -> None:
    station = memory_station()
    captures = [
        gather(station, captured(station, [[100.0 + j], [400.0 - j], [900.0 + 2 * j]]))
        for j in (-10.0, 0.0, 10.0)
    ]
    lags = estimate_lags(captures)
    assert {n: e.lag_us for n, e in lags.items()} == pytest.approx(
        {"cam01": 100.0, "cam02": 400.0, "cam03": 900.0}
    )
    # The median absolute deviation of -10, 0, 10 is 10.
    assert lags["cam01"].jitter_us == pytest.approx(14.826)
    assert lags["cam01"].count == 3 and lags["cam01"].source == "timestamps"
    timings = new_timings(station, lags)
    assert {n: t.delay_us for n, t in timings.items()} == pytest.approx(
        {"cam01": 800.0, "cam02": 500.0, "cam03": 0.0}
    )
    assert timings["cam02"].expected_lag_us == pytest.approx(400.0)


def test_delays_bring_middles_together_not_starts() -> None:
    station = memory_station(2)
    shot = captured(station, [[100.0], [100.0]])
    long = shot.parts[1].pairing.pairs[0]
    longer = replace(long, frame=replace(long.frame, exposure_us=6000.0))
    pairing = replace(shot.parts[1].pairing, pairs=(longer,))
    mixed = replace(shot, parts=(shot.parts[0], replace(shot.parts[1], pairing=pairing)))
    timings = new_timings(station, estimate_lags([gather(station, mixed)]))
    assert timings["cam01"].delay_us - timings["cam02"].delay_us == pytest.approx(1000.0)


def test_the_board_is_believed_before_the_stamps() -> None:
    shot = pictured(captured(LIT, [[0.0]] * 3))
    readings = [Reading(2100.0, 4000.0), None, Reading(2400.0, 4000.0)]
    lags = estimate_lags([gather(LIT, shot, board(readings))])
    assert {n: e.source for n, e in lags.items()} == {
        "cam01": "optical",
        "cam02": "timestamps",
        "cam03": "optical",
    }


def test_no_delays_without_every_cameras_lag() -> None:
    station = memory_station()
    lags = estimate_lags([gather(station, captured(station, [[1.0], [2.0], [3.0]]))])
    del lags["cam02"]
    with pytest.raises(InputError, match="the lag of cam02 could not be measured"):
        new_timings(station, lags)


def test_a_synchronisation_check_finds_the_lags_and_mends_them(bench: BenchMaker) -> None:
    """Lags of 0.2, 1.0 and 3.0 ms: found to 0.1 ms, made up for, and then all expose as one."""
    true_us = {"cam01": 200.0, "cam02": 1000.0, "cam03": 3000.0}
    scripts = {name: CameraScript(lag_us=lag, jitter_us=5.0) for name, lag in true_us.items()}
    made = bench(scripts=scripts)
    before = made.rig.capture(made.session, "before").record
    assert before.verdict.state == "not-synchronised"
    check = made.rig.sync_check(4, pause_s=0.0)
    assert {n: e.lag_us for n, e in check.lags.items()} == pytest.approx(true_us, abs=100.0)
    assert check.timings is not None and not check.faults
    made.rig.adopt(check.timings)
    after = made.rig.capture(made.session, "after").record
    assert after.verdict.state == "synchronised"
    # Jitter of 5 us, and readings of clocks a few microseconds wide.
    assert max(abs(c.skew_us or 0.0) for c in after.cameras) < 50.0
    assert len(made.session.index.records) == 2, "the check files nothing"


def test_a_clock_that_is_set_back_is_seen() -> None:
    from rig.acquisition.cameras.base import ClockSample

    def samples(*device_ms: float) -> list[ClockSample]:
        return [
            ClockSample(k * 10**7, round(ms * 1e6), k * 10**7 + 10**5)
            for k, ms in enumerate(device_ms)
        ]

    assert not clock_jumped(samples(500.0, 510.0, 520.0))
    assert not clock_jumped(samples(500.0, 510.04, 520.0)), "half a percent and the round trip"
    assert clock_jumped(samples(500.0, 510.0, 3.0))
    assert clock_jumped(samples(500.0, 510.0, 900.0))
    assert not clock_jumped([])
