"""The fake box's end of a line: bytes in, bytes out, with faults on the way if asked for."""

from __future__ import annotations

from collections.abc import Callable

from rig.acquisition.trigger.fake.commands import answer
from rig.acquisition.trigger.fake.device import FakeBox
from rig.acquisition.trigger.lines import LineReader
from rig.acquisition.trigger.protocol import Event


class FakeLine:
    """Carries bytes to a box and collects what it says, in the order in which it says it."""

    def __init__(self, box: FakeBox, now_ns: Callable[[], int]) -> None:
        self.box = box
        self._now_ns = now_ns
        self._reader = LineReader()
        self._out = bytearray()
        box.emit = self._event

    def receive(self, data: bytes) -> None:
        """Bytes have come from the host now."""
        with self.box.lock:
            if self._now_ns() < self.box.deaf_until_ns:
                self._reader.clear()
                return
            for raw in self._reader.feed(data):
                self._out += answer(self.box, raw, self.box.ticks())

    def take(self) -> bytes:
        """What the box has said since; things that are due are done first."""
        with self.box.lock:
            self.box.advance()
            said = bytes(self._out)
            self._out.clear()
            return said

    def next_due_ns(self) -> int | None:
        """When the box does something by itself."""
        return self.box.next_due_ns()

    def _event(self, event: Event) -> None:
        self._out += event.line()
