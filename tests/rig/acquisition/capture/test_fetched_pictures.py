"""Bodies that keep their pictures until they are asked: bursts told over their bus."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import cast

import pytest

from common.errors import DeviceError
from rig.acquisition.cameras.base import (
    CameraCapabilities,
    CameraDevice,
    CameraHealth,
    Frame,
    FrameStatus,
    TimestampKind,
    TriggerKind,
)
from rig.acquisition.capture import collect
from rig.acquisition.capture.collect import Collected, Collector, Want
from rig.acquisition.capture.judging import _command_times
from rig.acquisition.synchrony.cameraframes import CameraFrames, Pairing
from rig.acquisition.synchrony.faults import FaultKind
from rig.acquisition.synchrony.pairing import pair

INTERVAL_S = 0.2
BODY = CameraCapabilities(TriggerKind.SOFTWARE, TimestampKind.NONE, False, fetched=True)


class Body:
    """Gives a picture only while somebody waits; its process ends at one command."""

    def __init__(self, dies_at: int = 0, download_s: float = 0.0) -> None:
        self.capabilities = BODY
        self._dies_at, self._download_s = dies_at, download_s
        self._made = 0
        self._frames: list[Frame] = []

    def software_trigger(self) -> None:
        if self._made + 1 == self._dies_at:
            self._made = -1
            raise DeviceError("camera-gone", "its process ended", "check its cable")
        self._made += 1

    def wait_frames(self, count: int, timeout_s: float) -> Sequence[Frame]:
        if len(self._frames) < self._made:
            time.sleep(self._download_s)
            at, shot = time.monotonic_ns(), str(len(self._frames) + 1)
            made = Frame("b", at, FrameStatus.OK, encoded=b"x", metadata={"truth": shot})
            self._frames.append(made)
        elif len(self._frames) < count:
            time.sleep(timeout_s)
        return tuple(self._frames)

    def health(self) -> CameraHealth:
        return CameraHealth(connected=self._made >= 0)


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(collect, "FETCH_INTERVAL_S", INTERVAL_S)
    monkeypatch.setattr(collect, "FETCH_ROOM_S", INTERVAL_S / 4)


def burst(body: Body, interval_s: float = INTERVAL_S, deadline_s: float = 5.0) -> Collected:
    start = threading.Event()
    start.set()
    want = Want(3, lambda: 3, interval_s, 0.0, deadline_s, 0.0, start, threading.Event())
    return Collector(cast("CameraDevice", body), want).run()


def paired(got: Collected, deadline_s: float) -> Pairing:
    told = CameraFrames("b", BODY, got.frames, _command_times(got), 0, deadline_s=deadline_s)
    return pair(replace(told, asked_host_ns=got.asked_ns))


def test_a_body_that_dies_in_a_burst_keeps_its_earlier_shots() -> None:
    result = paired(burst(Body(dies_at=3)), 5.0)
    assert {one.shot: one.frame.metadata["truth"] for one in result.pairs} == {1: "1", 2: "2"}


def test_a_picture_is_late_from_when_it_was_asked_for() -> None:
    """Shots too near to fetch between them: the first is asked for 0.2 s after its shot."""
    deadline_s = INTERVAL_S / 2
    got = burst(Body(), interval_s=deadline_s)
    assert len(got.asked_ns) == 1, "once, after the last shot"
    asked, first = got.asked_ns[0], got.frames[0]
    assert asked - got.sent[0].at.middle_ns > deadline_s * 1e9
    assert not paired(got, deadline_s).faults
    slow = replace(first, arrived_host_ns=asked + round(2 * deadline_s * 1e9))
    late = paired(
        replace(
            got,
            frames=(
                slow,
                *(replace(f, arrived_host_ns=slow.arrived_host_ns) for f in got.frames[1:]),
            ),
        ),
        deadline_s,
    )
    assert {fault.kind for fault in late.faults} == {FaultKind.LATE}


def test_a_download_that_holds_up_a_shot_is_not_repeated() -> None:
    got = burst(Body(download_s=1.7 * INTERVAL_S))
    assert len(got.frames) == 3
    assert len(got.asked_ns) == 2, "after the first shot and after the last"


def test_a_body_that_is_gone_is_not_asked_again_and_again() -> None:
    class Gone(Body):
        """Its process ended after the first shot; whoever asks it is answered at once."""

        asked = 0

        def wait_frames(self, count: int, timeout_s: float) -> Sequence[Frame]:  # noqa: ARG002
            self.asked += 1
            return ()

        def health(self) -> CameraHealth:
            return CameraHealth(connected=False)

    body = Gone()
    burst(body, deadline_s=0.1)
    assert body.asked < 10
