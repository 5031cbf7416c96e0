"""A fake trigger box on a clock that a test steps: nothing waits, nothing depends on load."""

from __future__ import annotations

from rig.acquisition.trigger.conformance import Hands
from rig.acquisition.trigger.fake.device import FakeBox, FakeSettings
from rig.acquisition.trigger.fake.line import FakeLine


class SteppedBox:
    """The box with its line as a stream of bytes."""

    def __init__(self, settings: FakeSettings | None = None) -> None:
        self.now_ns = 1_000_000_000
        self.box = FakeBox(lambda: self.now_ns, settings or FakeSettings())
        self.line = FakeLine(self.box, lambda: self.now_ns)
        self._said = bytearray()

    def write(self, data: bytes, /) -> int:
        self.now_ns += 100_000
        self.line.receive(data)
        return len(data)

    def read(self, size: int = 1, /) -> bytes:
        self._said += self.line.take()
        if not self._said:
            self.now_ns += 1_000_000
        part = bytes(self._said[:size])
        del self._said[:size]
        return part

    def wait(self, seconds: float) -> None:
        self.now_ns += int(seconds * 1e9)
        self.box.advance()

    def hands(self) -> Hands:
        actions = {
            "interlock-open": lambda: self.box.set_interlock(closed=False),
            "interlock-close": lambda: self.box.set_interlock(closed=True),
            "reset": self.box.reset,
        }
        return Hands(wait=self.wait, actions=actions, timeout_s=0.5)
