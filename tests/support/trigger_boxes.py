"""Boxes that one suite runs over: the fake one, and the firmware on whatever simulator is here."""

from __future__ import annotations

import importlib.util
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from common.errors import RigwrightError
from rig.acquisition.trigger.box import ArmRequest, FireOutcome, Pulse, TriggerState
from rig.acquisition.trigger.driver import BoxAddress, SerialTriggerBox
from rig.acquisition.trigger.fake.device import FakeSettings
from rig.acquisition.trigger.fake.program import FakeTrigger, start_fake

ONE_EACH = {1: 1, 2: 1, 13: 1}
"""The pulses of one shot of :func:`request_for`."""
PROMPT_S = 2.0
SLACK_S = 0.2
GONE = (TriggerState.DISCONNECTED, TriggerState.OPENING)


@dataclass(frozen=True)
class AnyBox:
    """A box to talk to, and what a hand and a logic analyser can do to it.

    ``rises`` counts the pulses made so far, by output.
    """

    url: str
    set_interlock: Callable[[bool], None]
    reset: Callable[[], None]
    rises: Callable[[], Counter[int]]


def box_kinds() -> list[str]:
    """The fake, and the simulators that the tests of the firmware bring along."""
    if importlib.util.find_spec("firmware_sim") is None:
        return ["fake"]
    return ["fake", "avr8js", "simavr"]


@contextmanager
def any_box(kind: str, folder: Path) -> Iterator[AnyBox]:
    """A fresh one; skips where its simulator is not installed."""
    if kind == "fake":
        with start_fake(FakeSettings(drift_ppm=800.0)) as fake:
            yield of_fake(fake)
    else:
        with simulated(kind, folder) as box:
            yield box


def of_fake(fake: FakeTrigger) -> AnyBox:
    def set_interlock(closed: bool) -> None:
        fake.box.set_interlock(closed)
        fake.server.wake()

    def reset() -> None:
        fake.box.reset()
        fake.server.wake()

    def rises() -> Counter[int]:
        fake.box.advance()
        return Counter(edge.output for edge in fake.box.edges if edge.rising)

    return AnyBox(fake.url, set_interlock, reset, rises)


@contextmanager
def simulated(kind: str, folder: Path) -> Iterator[AnyBox]:
    from firmware_sim import FirmwareSim, Reset, Simulator, SimulatorMissing

    try:
        sim = FirmwareSim(Simulator(kind), folder / "edges.log")
    except SimulatorMissing as problem:
        pytest.skip(str(problem))
    with sim:
        sim.pace("real")

        def rises() -> Counter[int]:
            return Counter(edge.output for edge in sim.edges() if edge.level)

        yield AnyBox(
            sim.url,
            lambda closed: sim.interlock(closed=closed),
            lambda: sim.reset(Reset.EXTERNAL),
            rises,
        )


@contextmanager
def opened(url: str, **address: str) -> Iterator[SerialTriggerBox]:
    """A driver that is closed again."""
    box = SerialTriggerBox(BoxAddress(url, **address))
    box.open()
    try:
        yield box
    finally:
        box.close()


def wait_until(true: Callable[[], bool], within_s: float = 3.0) -> None:
    """Until something is so; fails when it does not come."""
    deadline = time.monotonic() + within_s
    while not true():
        assert time.monotonic() < deadline, "it did not happen in time"
        time.sleep(0.005)


def request_for(
    capture: str, shots: int = 1, lead_us: float = 1000.0, late_us: float = 0.0
) -> ArmRequest:
    """Two shutters and a strobe; ``late_us`` draws the shot out by a third shutter."""
    pulses = {1: Pulse(0.0, 300.0), 2: Pulse(100.0, 200.0), 13: Pulse(100.0, 50.0)}
    if late_us:
        pulses[3] = Pulse(late_us, 100.0)
    interval_us = late_us + 5000.0 if shots > 1 else 0.0
    return ArmRequest(capture, pulses, shots=shots, interval_us=interval_us, lead_us=lead_us)


def rises(fake: FakeTrigger) -> Counter[int]:
    return of_fake(fake).rises()


@contextmanager
def named_in_time(kind: type[RigwrightError], code: str) -> Iterator[None]:
    """What is inside fails with a code, within two seconds."""
    began = time.monotonic()
    with pytest.raises(kind) as caught:
        yield
    assert caught.value.code == code
    assert time.monotonic() - began < PROMPT_S + SLACK_S


def fire_whole(driver: SerialTriggerBox, capture: str) -> None:
    driver.arm(request_for(capture))
    driver.fire(capture)
    assert driver.wait_done(capture, 2.0).outcome is FireOutcome.FIRED
