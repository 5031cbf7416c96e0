"""Pictures and shots: every fault named, never a wrong pair."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.acquisition.cameras.base import (
    CameraCapabilities,
    Frame,
    FrameStatus,
    TimestampKind,
    TriggerKind,
)
from rig.acquisition.synchrony.cameraframes import CameraFrames, Method
from rig.acquisition.synchrony.clocks import TriggerTime, TriggerTimeSource
from rig.acquisition.synchrony.counters import steps
from rig.acquisition.synchrony.faults import FaultKind
from rig.acquisition.synchrony.pairing import pair

MS = 1_000_000
START = 10**12
LAG_US, TOLERANCE_US = 300.0, 2000.0
INTERVAL_NS = 20 * MS


@dataclass(frozen=True)
class ShiftedClock:
    """A clock that is off by a known amount, known to ``half_us``."""

    offset_ns: int
    half_us: float = 20.0

    def host_ns(self, device_ns: int) -> int:
        return device_ns + self.offset_ns

    def uncertainty_us(self, device_ns: int) -> float:  # noqa: ARG002
        return self.half_us


CLOCK = ShiftedClock(123_456_789)
CAMERA = CameraCapabilities(
    TriggerKind.EDGE, TimestampKind.DEVICE, True, 65535, frame_counter_skips_zero=True
)
MUTE = CameraCapabilities(TriggerKind.EDGE, TimestampKind.NONE, frame_counter=False)


def frame(
    exposed_ns: int, counter: int | None = None, truth: int = 0, arrives_ms: float = 8.0
) -> Frame:
    return Frame(
        camera_id="SN",
        arrived_host_ns=exposed_ns + round(arrives_ms * MS),
        status=FrameStatus.OK,
        encoded=b"a picture",
        counter=counter,
        device_ns=exposed_ns - CLOCK.offset_ns,
        metadata={"truth": str(truth)},
    )


def trigger_times(count: int, interval_ns: int = INTERVAL_NS) -> tuple[TriggerTime, ...]:
    return tuple(
        TriggerTime(k + 1, START + k * interval_ns, 5.0, TriggerTimeSource.EDGE_LOG)
        for k in range(count)
    )


def received(frames: Sequence[Frame], shots: int = 3, **changes: object) -> CameraFrames:
    values: dict[str, object] = {
        "camera": "cam01",
        "capabilities": CAMERA,
        "frames": tuple(frames),
        "trigger_times": trigger_times(shots),
        "armed_host_ns": START - 50 * MS,
        "clock": CLOCK,
        "lag_us": LAG_US,
        "lag_tolerance_us": TOLERANCE_US,
    }
    return CameraFrames(**{**values, **changes})


def burst(shots: int = 3, first_counter: int = 65534, off_us: float = 0.0) -> list[Frame]:
    """One sound picture of every shot, over the counter's wrap."""
    counters = [65534, 65535, *range(1, 200)]
    begin = counters.index(first_counter)
    lag_ns = round((LAG_US + off_us) * 1000)
    return [
        frame(START + k * INTERVAL_NS + lag_ns, counters[begin + k], k + 1) for k in range(shots)
    ]


def kinds(result: object) -> set[FaultKind]:
    return {fault.kind for fault in result.faults}


def truths(result: object) -> dict[int, str]:
    return {one.shot: one.frame.metadata["truth"] for one in result.pairs}


ALL_RIGHT = {1: "1", 2: "2", 3: "3"}


def test_a_sound_burst_is_paired_whatever_order_it_arrives_in() -> None:
    result = pair(received(list(reversed(burst()))))
    assert truths(result) == ALL_RIGHT
    assert not result.faults
    assert {one.method for one in result.pairs} == {Method.TIMESTAMP}


def test_the_first_to_arrive_is_not_the_first_shot() -> None:
    """The classic: the first picture is lost, and order of arrival shifts all the others."""
    result = pair(received(burst()[1:]))
    assert truths(result) == {2: "2", 3: "3"}
    (fault,) = result.faults
    assert (fault.kind, fault.shot) == (FaultKind.MISSING, 1)


def test_a_picture_lost_on_the_way_is_told_from_one_never_made() -> None:
    lost = pair(received([burst()[0], burst()[2]]))
    assert kinds(lost) == {FaultKind.MISSING, FaultKind.COUNTER_GAP}
    assert any("lost on the way" in fault.text for fault in lost.faults)
    first, third = burst()[0], burst()[2]
    never = pair(received([first, replace(third, counter=65535)]))
    assert kinds(never) == {FaultKind.MISSING}
    assert truths(never) == truths(lost) == {1: "1", 3: "3"}


def test_a_stale_picture_at_the_start_is_left_out() -> None:
    stale = frame(START - 80 * MS, 65533)
    result = pair(received([stale, *burst()]))
    assert truths(result) == ALL_RIGHT
    assert kinds(result) == {FaultKind.EXTRA_AT_START}


def test_many_stale_pictures_are_no_free_run() -> None:
    """Late pictures of the last burst were exposed before this one was armed."""
    stale = [frame(START - (200 - k) * MS, 65500 + k) for k in range(4)]
    result = pair(received([*stale, *burst()]))
    assert truths(result) == ALL_RIGHT
    assert FaultKind.FREE_RUNNING not in kinds(result)


def test_a_picture_delivered_twice_is_kept_once() -> None:
    one, two, three = burst()
    result = pair(received([one, two, two, three]))
    assert truths(result) == ALL_RIGHT
    assert kinds(result) == {FaultKind.DUPLICATE}
    broken = replace(two, status=FrameStatus.INCOMPLETE)
    assert pair(received([one, broken, two, three])).pair(2).frame.status is FrameStatus.OK


def test_two_exposures_about_one_shot_cannot_be_told_apart() -> None:
    one, two, three = burst()
    other = frame(START + INTERVAL_NS + round(LAG_US * 1000) + MS, 1)
    result = pair(received([one, two, other, replace(three, counter=2)]))
    assert truths(result) == {1: "1", 3: "3"}
    assert kinds(result) == {FaultKind.AMBIGUOUS}


def test_a_free_running_camera_gives_nothing() -> None:
    frames = [frame(START + k * 7 * MS, 65500 + k) for k in range(-5, 8)]
    result = pair(received(frames))
    assert not result.pairs
    assert FaultKind.FREE_RUNNING in kinds(result)
    assert any("not triggered from outside" in fault.text for fault in result.faults)


def test_one_picture_too_many_is_named() -> None:
    stray = frame(START + 2 * INTERVAL_NS + 9 * MS, 2)
    result = pair(received([*burst(), stray]))
    assert truths(result) == ALL_RIGHT
    assert kinds(result) == {FaultKind.EXTRA}


def test_late_and_incomplete_pictures_are_paired_and_named() -> None:
    one, two, three = burst()
    result = pair(
        received(
            [
                replace(one, status=FrameStatus.LATE),
                replace(two, status=FrameStatus.INCOMPLETE),
                replace(three, arrived_host_ns=three.arrived_host_ns + 2000 * MS),
            ],
            deadline_s=1.0,
        )
    )
    assert truths(result) == ALL_RIGHT
    named = {(fault.kind, fault.shot) for fault in result.faults}
    assert named == {(FaultKind.LATE, 1), (FaultKind.INCOMPLETE, 2), (FaultKind.LATE, 3)}


def test_a_lag_nobody_expected_is_named_with_its_length() -> None:
    """A body with 114 ms of lag in a station that expects 0.3 ms, bursts 20 ms apart."""
    for shots in (1, 3):
        result = pair(received(burst(shots, off_us=113_700.0), shots))
        assert not result.pairs
        assert FaultKind.LAG_OFF in kinds(result)
        assert any("114.0 ms" in fault.text for fault in result.faults)


def test_shots_faster_than_the_lag_is_known_are_not_guessed() -> None:
    result = pair(received(burst()[1:], lag_tolerance_us=20_000.0))
    assert not result.pairs
    assert kinds(result) == {FaultKind.AMBIGUOUS}
    # A camera exposes in the order of its shots: with one each nothing is left to guess.
    assert truths(pair(received(burst(), lag_tolerance_us=20_000.0))) == ALL_RIGHT


def frozen(frames: Sequence[Frame], uncertain: frozenset[int] = frozenset({3})) -> CameraFrames:
    """Five shots told over a bus: the third was told within 12 ms, the others at once."""
    told = [
        replace(at, uncertainty_us=6000.0 if at.shot in uncertain else 5.0)
        for at in trigger_times(5, 4 * MS)
    ]
    return received(frames, trigger_times=tuple(told))


def frozen_burst() -> list[Frame]:
    lag_ns = round(LAG_US * 1000)
    return [frame(START + k * 4 * MS + lag_ns, k + 1, k + 1) for k in range(5)]


def test_a_command_that_took_long_costs_no_other_shot_its_picture() -> None:
    frames = frozen_burst()
    assert truths(pair(frozen(frames))) == {k: str(k) for k in range(1, 6)}
    # Only shots between which its picture may lie are in doubt where one is lost.
    result = pair(frozen([*frames[:2], *frames[3:]]))
    assert truths(result) == {1: "1"}
    assert {f.shot for f in result.faults if f.kind is FaultKind.AMBIGUOUS} == {2, 3, 4, 5}


def test_a_clock_that_is_vague_for_one_picture_costs_no_other_its_shot() -> None:
    class Vague(ShiftedClock):
        def uncertainty_us(self, device_ns: int) -> float:
            return 9000.0 if self.host_ns(device_ns) > START + 15 * MS else 20.0

    result = pair(replace(frozen(frozen_burst(), frozenset()), clock=Vague(CLOCK.offset_ns)))
    assert truths(result) == {k: str(k) for k in range(1, 6)}
    result = pair(replace(frozen(frozen_burst()[3:], frozenset()), clock=Vague(CLOCK.offset_ns)))
    assert "5" not in truths(result).values()


def test_a_frame_that_lost_its_packets_is_incomplete_and_says_why() -> None:
    one, two, three = burst()
    why = {"problem": "packets of it did not arrive"}
    lost = replace(two, encoded=None, status=FrameStatus.INCOMPLETE, metadata=why)
    result = pair(received([one, lost, three]))
    assert truths(result) == {1: "1", 3: "3"}
    (fault,) = result.faults
    assert (fault.kind, fault.shot) == (FaultKind.INCOMPLETE, 2)
    assert "lost on its way (packets of it did not arrive)" in fault.text


def test_without_stamps_what_came_before_the_next_shot_is_certain() -> None:
    frames = [replace(f, device_ns=None, counter=None) for f in burst(4)]
    mute = {"capabilities": MUTE, "clock": None}
    assert truths(pair(received(frames[:2], 4, **mute))) == {1: "1", 2: "2"}
    result = pair(received([frames[0], *frames[2:]], 4, **mute))
    assert truths(result) == {1: "1"}
    assert "after shot 1 it cannot be told which shots lack theirs" in result.faults[0].text


def test_a_counter_that_contradicts_the_stamps_gives_nothing() -> None:
    one, two, three = burst()
    crossed = [one, replace(two, counter=three.counter), replace(three, counter=two.counter)]
    result = pair(received(crossed))
    assert not result.pairs
    assert FaultKind.COUNTER_CONFLICT in kinds(result)


@pytest.mark.parametrize("jumped", [True, False])
def test_stamps_of_a_clock_that_was_reset_are_not_believed(jumped: bool) -> None:
    frames = burst()
    if not jumped:
        # Stamped after it arrived: the clock has been set forward.
        frames = [replace(f, device_ns=(f.device_ns or 0) + 10**10) for f in frames]
    result = pair(received(frames, clock_jumped=jumped))
    assert FaultKind.TIMESTAMP_RESET in kinds(result)
    assert {one.method for one in result.pairs} == {Method.ARRIVAL}


def test_without_stamps_the_order_counts_and_says_so() -> None:
    frames = [replace(f, device_ns=None, counter=None) for f in burst()]
    result = pair(received(frames, capabilities=MUTE, clock=None))
    assert truths(result) == ALL_RIGHT
    assert kinds(result) == set()
    assert {one.method for one in result.pairs} == {Method.ARRIVAL}, "said once, for the rig"
    lost = pair(received(frames[1:], capabilities=MUTE, clock=None))
    assert not lost.pairs
    assert "cannot be told" in lost.faults[0].text
    assert kinds(lost) == {FaultKind.MISSING}


def test_one_picture_that_no_shot_asked_for_is_called_that() -> None:
    one, two, three = burst()
    stray = frame(START + round(2.6 * INTERVAL_NS), 3)
    timed = pair(received([one, two, three, stray]))
    assert truths(timed) == ALL_RIGHT
    assert any("whether the camera runs freely" in fault.text for fault in timed.faults)
    frames = [replace(f, device_ns=None, counter=None) for f in (one, two, three, stray)]
    mute = pair(received(frames, capabilities=MUTE, clock=None))
    assert not mute.pairs
    assert "4 pictures came for 3 shots; none is taken. No shot asked for" in mute.faults[0].text


def test_without_stamps_a_counter_gap_stops_the_guess() -> None:
    """Three pictures for three shots, but one was lost and one nobody asked for."""
    mute = replace(MUTE, frame_counter=True)
    frames = [
        replace(f, device_ns=None, counter=c) for f, c in zip(burst(), (5, 6, 8), strict=True)
    ]
    result = pair(received(frames, capabilities=mute, clock=None))
    assert not result.pairs
    assert kinds(result) == {FaultKind.AMBIGUOUS}


def test_a_camera_that_runs_freely_without_stamps_is_named() -> None:
    frames = [
        replace(frame(START + k * 7 * MS), device_ns=None, counter=None) for k in range(-4, 6)
    ]
    result = pair(received(frames, capabilities=MUTE, clock=None))
    assert not result.pairs
    assert FaultKind.FREE_RUNNING in kinds(result)


@pytest.mark.parametrize(
    ("modulus", "first", "second", "apart"),
    [
        (None, 5, 9, 4),
        (None, 9, 5, -4),
        (65535, 65535, 1, 1),
        (65535, 65534, 2, 3),
        (65536, 65535, 0, 1),
        (65536, 3, 65530, -9),
    ],
)
def test_counters_go_round(modulus: int | None, first: int, second: int, apart: int) -> None:
    assert steps(replace(CAMERA, frame_counter_modulus=modulus), first, second) == apart


FATES = st.sampled_from(["sound", "sound", "sound", "drop", "miss", "twice", "late"])


@st.composite
def stories(draw: st.DrawFn) -> tuple[CameraFrames, dict[str, bool]]:
    """One camera's capture with any mix of faults, and what is true about it."""
    shots = draw(st.integers(1, 6))
    bias = draw(st.floats(0.0, 1600.0))
    modulus = draw(st.sampled_from([None, 16, 65535]))
    counter = draw(st.integers(1, 15))
    events: list[tuple[int, int, str]] = []
    for k in range(shots):
        lag_us = LAG_US + bias + draw(st.floats(-300.0, 300.0))
        events.append((START + k * INTERVAL_NS + round(lag_us * 1000), k + 1, draw(FATES)))
    strays = draw(st.lists(st.floats(-200.0, 150.0), max_size=3))
    events += [(START + round(off_ms * MS), 0, "sound") for off_ms in strays]
    frames: list[Frame] = []
    for at, shot, fate in sorted(events):
        if fate == "miss":
            continue
        counter = counter % modulus + 1 if modulus else counter + 1
        arrives = draw(st.floats(1.0, 60.0)) + (2000.0 if fate == "late" else 0.0)
        if fate != "drop":
            frames += [frame(at, counter, shot, arrives)] * (2 if fate == "twice" else 1)
    capabilities = replace(CAMERA, frame_counter_modulus=modulus)
    clean = all(fate == "sound" for _, _, fate in events) and len(events) == shots
    result = received(
        draw(st.permutations(frames)), shots, capabilities=capabilities, deadline_s=1.0
    )
    return result, {"clean": clean}


def in_a_window(story: CameraFrames, exposed: Frame) -> bool:
    at = CLOCK.host_ns(exposed.device_ns or 0)
    return any(
        (at - i.at_host_ns) / 1000.0 <= LAG_US + TOLERANCE_US + 25.0
        and (at - i.at_host_ns) / 1000.0 >= -25.0
        for i in story.trigger_times
    )


@pytest.mark.slow
@settings(max_examples=600, deadline=None)
@given(stories())
def test_no_picture_is_ever_given_to_the_wrong_shot(
    story: tuple[CameraFrames, dict[str, bool]],
) -> None:
    told, facts = story
    result = pair(told)
    for one in result.pairs:
        truth = int(one.frame.metadata["truth"])
        # A picture that nobody triggered, made within the tolerance of a shot whose own picture
        # is lost, is one of that instant all the same: its stamp is true.
        assert truth == one.shot or (truth == 0 and in_a_window(told, one.frame))
    paired = {one.shot for one in result.pairs}
    if facts["clean"]:
        assert paired == {i.shot for i in told.trigger_times}
        assert not result.faults
    if paired != {i.shot for i in told.trigger_times}:
        assert result.faults
        assert any(not fault.harmless for fault in result.faults)


@settings(max_examples=300, deadline=None)
@given(
    st.integers(1, 6),
    st.sets(st.integers(1, 6)),
    st.lists(st.floats(-100.0, -1.0), max_size=2),
    st.booleans(),
)
def test_order_of_arrival_gives_no_wrong_pair_when_pictures_are_lost_or_too_many(
    shots: int, lost: set[int], early_ms: list[float], counted: bool
) -> None:
    """With losses, or with extras before the start: either right or not at all."""
    frames = [
        replace(frame(START + k * INTERVAL_NS + MS, 100 + k, k + 1), device_ns=None)
        for k in range(shots)
        if k + 1 not in lost
    ]
    early = [replace(frame(START + round(ms * MS), 90, 0, 0.5), device_ns=None) for ms in early_ms]
    frames = [f if counted else replace(f, counter=None) for f in frames]
    result = pair(
        received(
            [*early, *frames], shots, capabilities=replace(MUTE, frame_counter=counted), clock=None
        )
    )
    for one in result.pairs:
        assert one.frame.metadata["truth"] == str(one.shot)
