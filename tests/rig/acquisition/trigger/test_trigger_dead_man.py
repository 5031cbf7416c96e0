"""Bursts whose host is killed, frozen or unplugged, on the fake box with the real driver."""

from __future__ import annotations

import contextlib
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import burst_host
import pytest
from trigger_boxes import opened, wait_until

from common.errors import InputError
from rig.acquisition.trigger.box import ArmRequest, FireOutcome, Pulse
from rig.acquisition.trigger.fake.program import FakeTrigger, start_fake

PULSES = {1: Pulse(0.0, 300.0)}
LATE_BY_S = 0.1


Ending = Callable[[subprocess.Popen[str], list[FakeTrigger]], None]


def lose(end: Ending, boxes: int, seed: int) -> None:
    """Fire bursts from a program, lose it, and hold each box's last edge against what it heard."""
    draw = random.Random(seed)  # noqa: S311 - repeatable moments
    with contextlib.ExitStack() as stack:
        fakes = [stack.enter_context(start_fake()) for _ in range(boxes)]
        host = subprocess.Popen(
            [sys.executable, burst_host.__file__, str(seed), *(fake.url for fake in fakes)],
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[4])},
        )
        stack.callback(host.wait)
        stack.callback(host.kill)
        assert host.stdout is not None
        stack.enter_context(host.stdout)
        assert host.stdout.readline() == "firing\n"
        time.sleep(draw.uniform(0.0, 1.0))
        end(host, fakes)
        time.sleep(burst_host.DEAD_MAN_S + LATE_BY_S)
        for fake in fakes:
            fake.box.advance()
            capture = fake.box.captures.last
            assert capture is not None
            assert (capture.result, capture.why) == ("PARTIAL", "silence")
            assert 0 < len(capture.shots) < burst_host.SHOTS
            last = max(edge.ticks for edge in fake.box.edges)
            assert last <= fake.box.heard + burst_host.DEAD_MAN_S * 2_000_000


def killed(host: subprocess.Popen[str], _: list[FakeTrigger]) -> None:
    host.kill()


def frozen(host: subprocess.Popen[str], _: list[FakeTrigger]) -> None:
    host.send_signal(signal.SIGSTOP)


def unplugged(_: subprocess.Popen[str], fakes: list[FakeTrigger]) -> None:
    for fake in fakes:
        fake.server.unplug()


@pytest.mark.parametrize("end", [killed, frozen, unplugged])
def test_a_burst_without_its_host_stops(end: Ending) -> None:
    lose(end, 3, seed=1)


@pytest.mark.slow
@pytest.mark.parametrize("end", [killed, frozen, unplugged])
def test_bursts_lost_at_200_moments(end: Ending) -> None:
    # Each box of a program was fired at another moment, so each is another moment of its burst.
    for seed in range(4):
        lose(end, 17, seed)


def test_the_driver_keeps_a_burst_alive_and_says_why_one_ended() -> None:
    request = ArmRequest("a", PULSES, shots=12, interval_us=100_000.0, dead_man_s=0.5)
    with start_fake() as fake, opened(fake.url) as driver:
        driver.arm(request)
        driver.fire("a")
        report = driver.wait_done("a", 5.0)
        assert (report.outcome, report.shots_done) == (FireOutcome.FIRED, 12)


def test_a_program_started_again_sees_what_happened() -> None:
    with start_fake() as fake:
        with opened(fake.url) as driver:
            driver.arm(ArmRequest("lost", PULSES, 99, 50_000.0, dead_man_s=0.5))
            driver.fire("lost")
            fake.server.unplug()
            wait_until(lambda: fake.box.state == "IDLE")
        fake.server.replug()
        with opened(fake.url) as driver:
            assert "heard nothing of its host" in driver.health().last_problem
            report = driver.wait_done("lost", 1.0)
            assert report.outcome is FireOutcome.PARTIAL
            assert 0 < report.shots_done < 99
            assert "heard nothing of its host" in report.why


@pytest.mark.parametrize("seconds", [0.1, 60.0])
def test_a_dead_man_s_time_that_cannot_be(seconds: float) -> None:
    with (
        start_fake() as fake,
        opened(fake.url) as driver,
        pytest.raises(InputError, match=r"give 0\.5 to 30 s, or 0"),
    ):
        driver.arm(ArmRequest("a", PULSES, dead_man_s=seconds))


def test_a_strobe_without_rest_is_refused_before_anything_is_sent() -> None:
    pulses = {13: Pulse(0.0, 50_000.0)}
    with start_fake() as fake, opened(fake.url) as driver:
        with pytest.raises(InputError, match="leave 200000 us or more"):
            driver.arm(ArmRequest("a", pulses, shots=2, interval_us=100_000.0))
        driver.arm(ArmRequest("b", pulses, shots=2, interval_us=200_000.0))


def test_a_strobe_s_rest_between_captures_is_waited_for() -> None:
    pulses = {13: Pulse(0.0, 50_000.0)}
    with start_fake() as fake, opened(fake.url) as driver:
        for name in ("a", "b", "c"):
            driver.arm(ArmRequest(name, pulses))
            driver.fire(name)
            assert driver.wait_done(name, 2.0).outcome is FireOutcome.FIRED
        rises = [edge.host_ns for edge in fake.box.edges if edge.rising]
        falls = [edge.host_ns for edge in fake.box.edges if not edge.rising]
        rests = [(up - down) / 1e6 for down, up in zip(falls, rises[1:], strict=False)]
        assert min(rests) >= 150.0
