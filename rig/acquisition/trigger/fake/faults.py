"""A fake box that misbehaves, by seed: what it says is lost, late, doubled, drowned."""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, fields

from common.errors import InputError
from rig.acquisition.trigger.fake.line import FakeLine

_NOISE_BYTES = 40


@dataclass(frozen=True)
class FakeFaults:
    """What goes wrong, and how often.

    ``lost``, ``late``, ``duplicate``, ``garbage``: probability for each line said. ``late_s``:
    how late. ``slow_s``: every line is that late. ``silent_after``: lines heard before the box
    falls silent for good, -1 never. ``reset_in``: resets itself once, the first time it is in
    that state (``IDLE``, ``ARMED``, ``FIRING``). ``flood``: events a second that mean nothing.
    """

    lost: float = 0.0
    late: float = 0.0
    duplicate: float = 0.0
    garbage: float = 0.0
    late_s: float = 0.3
    slow_s: float = 0.0
    silent_after: int = -1
    reset_in: str = ""
    flood: float = 0.0

    @staticmethod
    def parse(text: str) -> FakeFaults:
        """From ``lost=0.05,reset_in=FIRING``; an empty text means none."""
        known = {each.name: each.type for each in fields(FakeFaults)}
        values: dict[str, float | int | str] = {}
        for word in filter(None, text.split(",")):
            name, _, value = word.partition("=")
            try:
                kind = {"float": float, "int": int, "str": str}[str(known[name])]
                values[name] = kind(value)
            except (KeyError, ValueError):
                raise InputError(
                    "fake-faults",
                    f"{word!r} is no fault of the fake box",
                    f"give name=value of {', '.join(known)}",
                ) from None
        return FakeFaults(**values)  # type: ignore[arg-type]


class FaultyLine:
    """A :class:`FakeLine` whose words go through :class:`FakeFaults`."""

    def __init__(
        self, line: FakeLine, faults: FakeFaults, seed: int, now_ns: Callable[[], int]
    ) -> None:
        self._line = line
        self._faults = faults
        self._now_ns = now_ns
        self._random = random.Random(seed)  # noqa: S311 - chance of faults
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._heard = 0
        self._reset_done = False
        self._next_flood_ns = now_ns()

    def receive(self, data: bytes) -> None:
        """Bytes have come from the host now."""
        self._heard += data.count(b"\n")
        self._line.receive(data)
        box = self._line.box
        if not self._reset_done and box.state == self._faults.reset_in:
            self._reset_done = True
            box.reset("WATCHDOG")

    def take(self) -> bytes:
        """What gets through now."""
        self._flood()
        now = self._now_ns()
        for said in self._line.take().splitlines(keepends=True):
            self._pass_on(said, now)
        out = b""
        while self._waiting and self._waiting[0][0] <= now:
            out += self._waiting.popleft()[1]
        silent = 0 <= self._faults.silent_after <= self._heard
        return b"" if silent else out

    def next_due_ns(self) -> int | None:
        """The next edge, late line or meaningless event."""
        due = [self._line.next_due_ns()]
        if self._waiting:
            due.append(self._waiting[0][0])
        if self._faults.flood:
            due.append(self._next_flood_ns)
        return min((each for each in due if each is not None), default=None)

    def _pass_on(self, said: bytes, now: int) -> None:
        chance = self._random.random
        if chance() < self._faults.lost:
            return
        late = self._faults.slow_s + self._faults.late_s * (chance() < self._faults.late)
        due = now + int(late * 1e9)
        if self._waiting:
            due = max(due, self._waiting[-1][0])
        if chance() < self._faults.garbage:
            said = self._random.randbytes(_NOISE_BYTES) + b"\n" + said
        copies = 2 if chance() < self._faults.duplicate else 1
        self._waiting.append((due, said * copies))

    def _flood(self) -> None:
        while self._faults.flood and self._next_flood_ns <= self._now_ns():
            self._next_flood_ns += int(1e9 / self._faults.flood)
            with self._line.box.lock:
                self._line.box.announce("NEWS", {"text": "nothing"})
