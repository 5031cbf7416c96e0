"""A fake ESPER TriggerBox: letters in, ``tenFour`` out, and no word when it fires."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable

from rig.acquisition.trigger.esper import TEN_FOUR
from rig.acquisition.trigger.esper_program import MAX_MS, OUTPUTS
from rig.acquisition.trigger.fake.limits import PhysicalEdge

_LONGEST = 200


class FakeEsper:
    """The box and its end of the line. ``now_ns`` is the host's clock.

    ``edges`` are what its outputs really did. ``id`` and ``version`` are what it says of itself.
    """

    def __init__(self, now_ns: Callable[[], int], box_id: str = "34", version: str = "3.2") -> None:
        self.id = box_id
        self.version = version
        self.edges: list[PhysicalEdge] = []
        self.focus = False
        self._now_ns = now_ns
        self._lock = threading.Lock()
        self._delays_ms = [0] * OUTPUTS
        self._hold_ms = 100
        self._mask = "1" * OUTPUTS
        self._line = b""
        self._out = b""
        self._due: list[PhysicalEdge] = []

    def receive(self, data: bytes) -> None:
        """Bytes have come from the host now."""
        with self._lock:
            self._line += data
            *lines, self._line = self._line.split(b"\n")
            self._line = self._line[:_LONGEST]
            for line in lines:
                text = line.decode("ascii", "replace").strip("\r")
                if text == "S":
                    self._fire()
                elif text:
                    self._out += self._answer(text).encode() + b"\n"

    def take(self) -> bytes:
        """What it has said since; edges that are due are made first."""
        with self._lock:
            now = self._now_ns()
            while self._due and self._due[0].host_ns <= now:
                self.edges.append(self._due.pop(0))
            said, self._out = self._out, b""
            return said

    def next_due_ns(self) -> int | None:
        """The next edge."""
        with self._lock:
            return self._due[0].host_ns if self._due else None

    def _answer(self, text: str) -> str:
        if text == "V":
            return f"Version:[{self.version}]"
        if text == "I":
            return f"TriggerBox:[{self.id}]"
        return TEN_FOUR if self._set(text) else "what?"

    def _set(self, text: str) -> bool:
        letter, rest = text[0], text[1:]
        if letter == "F" and rest in ("0", "1"):
            self.focus = rest == "1"
        elif letter == "s" and re.fullmatch(f"[01]{{{OUTPUTS}}}", rest):
            self._mask = rest
        elif letter == "b" and rest.isdigit() and int(rest) <= MAX_MS:
            self._hold_ms = int(rest)
        elif letter == "d" and re.fullmatch(rf"\d+( \d+){{{OUTPUTS - 1}}}", rest):
            self._delays_ms = [int(word) for word in rest.split()]
        else:
            return False
        return True

    def _fire(self) -> None:
        now = self._now_ns()
        for output in range(1, OUTPUTS + 1):
            if self._mask[output - 1] == "1":
                up = now + self._delays_ms[output - 1] * 1_000_000
                for at, rising in ((up, True), (up + self._hold_ms * 1_000_000, False)):
                    self._due.append(PhysicalEdge(at, at // 1_000_000, output, rising, ""))
        self._due.sort(key=lambda edge: edge.host_ns)
