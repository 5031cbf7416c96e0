"""Fires many captures through a bad line: no pulse doubled, no outcome wrong.

``python -m benchmarks.fires --fires 10000 --seed 1`` fires fake boxes through fault proxies,
counts the pulses that were really made at the outputs (not what any log says) and compares
them with what the driver reported. ``--write docs/explanation/trigger.md`` puts the table into
the docs.
"""

from __future__ import annotations

import argparse
import multiprocessing
import random
import re
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

from common.errors import RigwrightError
from rig.acquisition.trigger.box import ArmRequest, FireOutcome, FireReport, Pulse
from rig.acquisition.trigger.driver import BoxAddress, SerialTriggerBox
from rig.acquisition.trigger.endpoint import PtyEndpoint
from rig.acquisition.trigger.fake.device import FakeSettings
from rig.acquisition.trigger.fake.program import FakeTrigger, start_fake
from rig.acquisition.trigger.faultscript import FaultRates, ProxyScript
from rig.acquisition.trigger.proxy import FaultProxy

FAULT_RATE = 0.05
MISHAP_RATE = 0.01
"""Fires at which the cable is pulled for a moment, or the box is reset, or loses its power."""
NAMED_WITHIN_S = 2.0
CALL_SLACK_S = 0.15
"""What a busy computer may add to a time-out of the driver."""

Rises = Mapping[int, int]
"""Pulses really made, by output."""


@dataclass
class Tally:
    """What came of many fires."""

    fires: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    errors: Counter[str] = field(default_factory=Counter)
    faults: Counter[str] = field(default_factory=Counter)
    extra_pulses: int = 0
    missing_pulses: int = 0
    wrong: list[str] = field(default_factory=list)
    slowest_s: float = 0.0
    """The longest that any call took, or that a failure took to be named."""

    def add(self, other: Tally) -> None:
        """Put two together."""
        self.fires += other.fires
        self.outcomes += other.outcomes
        self.errors += other.errors
        self.faults += other.faults
        self.extra_pulses += other.extra_pulses
        self.missing_pulses += other.missing_pulses
        self.wrong += other.wrong
        self.slowest_s = max(self.slowest_s, other.slowest_s)

    @property
    def sound(self) -> bool:
        """Whether the driver kept all its promises."""
        in_time = self.slowest_s <= NAMED_WITHIN_S + CALL_SLACK_S
        return not self.wrong and self.extra_pulses == 0 and in_time


class Shooter:
    """Fires one box again and again and keeps what was asked and what was reported."""

    def __init__(self, box: SerialTriggerBox, name: str, seed: int) -> None:
        self.tally = Tally()
        self.asked: dict[str, ArmRequest] = {}
        self.reports: dict[str, FireReport] = {}
        self._box = box
        self._name = name
        self._chance = random.Random(seed)  # noqa: S311 - not for secrets

    def fire(self, mishap: Callable[[], None] | None = None) -> None:
        """One capture, whatever comes of it; ``mishap`` happens somewhere around FIRE."""
        capture = f"{self._name}-{len(self.asked)}"
        request = self._request(capture)
        self.asked[capture] = request
        if not self._call(lambda: self._box.arm(request)):
            time.sleep(0.05)
            return
        timer = threading.Timer(self._chance.random() * 0.01, mishap) if mishap else None
        if timer:
            timer.start()
        self.tally.fires += 1
        self._call(lambda: self._box.fire(capture))
        began = time.monotonic()
        report = self._box.wait_done(capture, NAMED_WITHIN_S)
        self._took(time.monotonic() - began)
        self.reports[capture] = report
        self.tally.outcomes[report.outcome.value] += 1
        if timer:
            timer.join()

    def _request(self, capture: str) -> ArmRequest:
        chance = self._chance
        shutter = Pulse(chance.choice([0.0, 100.0, 250.0]), chance.choice([100.0, 300.0]))
        outputs = chance.sample(range(1, 13), 3)
        shots = chance.choice([1, 1, 1, 2, 3])
        return ArmRequest(
            capture,
            dict.fromkeys(outputs, shutter) | {13: Pulse(50.0, 20.0)},
            shots=shots,
            interval_us=3000.0 if shots > 1 else 0.0,
            lead_us=1000.0,
        )

    def _call(self, call: Callable[[], None]) -> bool:
        began = time.monotonic()
        try:
            call()
        except RigwrightError as error:
            self.tally.errors[error.code] += 1
            return False
        finally:
            self._took(time.monotonic() - began)
        return True

    def _took(self, seconds: float) -> None:
        self.tally.slowest_s = max(self.tally.slowest_s, seconds)


def judge(shooter: Shooter, made: Callable[[str], Rises]) -> None:
    """Compare reports with the pulses that were ``made`` for each capture."""
    tally = shooter.tally
    for capture, request in shooter.asked.items():
        rises = made(capture)
        extra = sum(rises.values())
        lacking = 0
        for output in request.pulses:
            extra -= min(rises.get(output, 0), request.shots)
            lacking += max(request.shots - rises.get(output, 0), 0)
        tally.extra_pulses += extra
        report = shooter.reports.get(capture)
        said = report.outcome if report is not None else FireOutcome.NOT_FIRED
        none_made = not any(rises.values())
        wrong = {
            FireOutcome.FIRED: lacking > 0,
            FireOutcome.NOT_FIRED: not none_made,
            FireOutcome.PARTIAL: False,
            FireOutcome.UNKNOWN: False,
        }[said]
        if said is FireOutcome.FIRED:
            tally.missing_pulses += lacking
        if wrong:
            tally.wrong.append(f"{capture}: {said.value}, but {dict(rises)} of {request.shots}")


def made_by(fake: FakeTrigger) -> Callable[[str], Rises]:
    """The pulses that a fake box really made, by capture."""
    by_capture: dict[str, Counter[int]] = {}
    for edge in fake.box.edges:
        if edge.rising:
            by_capture.setdefault(edge.capture, Counter())[edge.output] += 1
    return lambda capture: by_capture.get(capture, Counter())


def fire_fake(fires: int, seed: int) -> Tally:
    """Fire one fake box through one proxy."""
    script = ProxyScript(FaultRates.all_at(FAULT_RATE), FaultRates.all_at(FAULT_RATE), seed=seed)
    settings = FakeSettings(serial_number=f"fake-{seed}", drift_ppm=(seed % 7 - 3) * 500.0)
    chance = random.Random(seed)  # noqa: S311 - not for secrets
    with (
        tempfile.TemporaryDirectory() as folder,
        start_fake(settings) as fake,
        # A stable name: a terminal that comes back may have another number, and the old number
        # may by then be another box's.
        FaultProxy(fake.url, PtyEndpoint(Path(folder) / "box"), script) as proxy,
    ):
        mishaps = [
            lambda: proxy.unplug(0.05),
            lambda: _reset(fake, keeps_power=True),
            lambda: _reset(fake, keeps_power=False),
        ]
        box = SerialTriggerBox(BoxAddress(proxy.url))
        shooter = Shooter(box, f"s{seed % 1000}", seed)
        box.open()
        try:
            while shooter.tally.fires < fires:
                struck = chance.random() < MISHAP_RATE
                shooter.fire(chance.choice(mishaps) if struck else None)
                shooter.tally.faults["mishap"] += struck
                if len(shooter.asked) > 2 * fires + 50:
                    raise RuntimeError(f"no way back: {box.health()}, {shooter.tally}")
        finally:
            box.close()
        fake.box.advance()
        shooter.tally.faults += proxy.done
    judge(shooter, made_by(fake))
    return shooter.tally


def _reset(fake: FakeTrigger, keeps_power: bool) -> None:
    fake.box.reset("EXTERNAL" if keeps_power else "POWER", keeps_power)
    fake.server.wake()


def fire_side_by_side(fires: int, seed: int, boxes: int) -> Tally:
    """Fire several fake boxes in threads of one process; most of the time is waiting."""
    each = [fires // boxes + (number < fires % boxes) for number in range(boxes)]
    total = Tally()
    with ThreadPoolExecutor(boxes) as pool:
        seeds = range(seed * 1000, seed * 1000 + boxes)
        for tally in pool.map(fire_fake, each, seeds):
            total.add(tally)
    return total


def fire_all(fires: int, seed: int, boxes: int = 16, processes: int = 2) -> Tally:
    """Fire over several processes."""
    total = Tally()
    shares = [fires // processes + (number < fires % processes) for number in range(processes)]
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, mp_context=context) as pool:
        seeds = [seed * 100 + number for number in range(processes)]
        for tally in pool.map(fire_side_by_side, shares, seeds, [boxes] * processes):
            total.add(tally)
    return total


def table(tally: Tally, seconds: float) -> str:
    """The figures as a Markdown table."""
    outcomes = ", ".join(f"{count} {name}" for name, count in sorted(tally.outcomes.items()))
    errors = ", ".join(f"{count} {name}" for name, count in sorted(tally.errors.items()))
    rows = [
        ("fires", f"{tally.fires} in {seconds:.0f} s"),
        ("faults put on the line", str(sum(tally.faults.values()))),
        ("of these: cable pulled, box reset, power lost", str(tally.faults["mishap"])),
        ("pulses beyond those asked for", str(tally.extra_pulses)),
        ("outcomes that were wrong", str(len(tally.wrong))),
        ("outcomes", outcomes),
        ("orders that ended in a named error", errors or "none"),
        ("longest until a call returned or a failure was named", f"{tally.slowest_s:.2f} s"),
    ]
    lines = ["| | |", "|---|---|", *(f"| {name} | {value} |" for name, value in rows)]
    return "\n".join(lines)


def write_table(path: Path, text: str) -> None:
    """Replace what stands between the marks in a page."""
    page = path.read_text(encoding="utf-8")
    marked = re.compile(r"(<!-- fires -->\n).*?(<!-- end -->)", re.DOTALL)
    page, found = marked.subn(lambda marks: f"{marks[1]}{text}\n{marks[2]}", page)
    if not found:
        raise SystemExit(f"{path} has no <!-- fires --> and <!-- end --> to write between")
    path.write_text(page, encoding="utf-8")


def main() -> int:
    """The command line; returns 1 when a promise was broken."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fires", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--boxes", type=int, default=16, help="side by side in each process")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--write", type=Path, help="page whose table is replaced")
    given = parser.parse_args()
    began = time.monotonic()
    tally = fire_all(given.fires, given.seed, given.boxes, given.processes)
    text = table(tally, time.monotonic() - began)
    print(text)
    for problem in tally.wrong:
        print("WRONG", problem)
    if given.write:
        write_table(given.write, text)
    return 0 if tally.sound else 1


if __name__ == "__main__":
    sys.exit(main())
