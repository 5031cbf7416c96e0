"""The simulated box's line as a stream of bytes that costs simulated time, not real time."""

from __future__ import annotations

from firmware_sim import FirmwareSim, Reset

from rig.acquisition.trigger.conformance import Hands

_PATIENCE_MS = 1.0


class SimulatedLine:
    """What the players of test vectors want of a port. Reading lets the box run."""

    def __init__(self, box: FirmwareSim) -> None:
        self._box = box
        self._come = b""

    def write(self, data: bytes, /) -> int:
        """Put bytes on the line."""
        self._box.send(data)
        return len(data)

    def read(self, size: int = 1, /) -> bytes:
        """What has come; after a millisecond of the box also nothing."""
        if not self._come:
            self._come = self._box.run(_PATIENCE_MS)
        taken, self._come = self._come[:size], self._come[size:]
        return taken

    def hands(self) -> Hands:
        """All that the vectors may ask for: time, the interlock, a reset."""

        def wait(seconds: float) -> None:
            self._come += self._box.run(seconds * 1000.0)

        def reset() -> None:
            # What the box was saying would be cut, and the players believe only whole lines.
            self._come += self._box.run(20.0)
            self._box.reset(Reset.EXTERNAL)

        return Hands(
            wait=wait,
            actions={
                "interlock-open": lambda: self._box.interlock(closed=False),
                "interlock-close": lambda: self._box.interlock(closed=True),
                "reset": reset,
            },
            timeout_s=10.0,
        )
