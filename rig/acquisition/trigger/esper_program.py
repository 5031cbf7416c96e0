"""What a capture is in the terms of an ESPER TriggerBox: whole milliseconds, six outputs."""

from __future__ import annotations

from dataclasses import dataclass

from common.errors import InputError
from rig.acquisition.trigger.box import ArmRequest

OUTPUTS = 6
MAX_MS = 30_000


@dataclass(frozen=True)
class EsperProgram:
    """One capture in the box's terms: delays of all six outputs, hold, which ones take part."""

    capture_id: str
    delays_ms: tuple[int, ...]
    hold_ms: int
    mask: str
    expires_s: float

    def commands(self) -> tuple[str, ...]:
        """The lines that set it."""
        delays = " ".join(str(delay) for delay in self.delays_ms)
        return (f"d{delays}", f"b{self.hold_ms}", f"s{self.mask}")

    @property
    def duration_s(self) -> float:
        """From ``S`` to the end of the last pulse."""
        return (max(self.delays_ms) + self.hold_ms) / 1000.0


def compile_esper(request: ArmRequest) -> EsperProgram:
    """The program of a capture; :class:`~common.errors.InputError` for what it cannot be."""
    pulses = {output: pulse for output, pulse in request.pulses.items() if pulse.width_us > 0.0}
    if not pulses or not set(pulses) <= set(range(1, OUTPUTS + 1)):
        raise InputError(
            "trigger-output",
            f"an ESPER box cannot fire outputs {sorted(pulses)}",
            f"give pulses to one or more of its outputs 1 to {OUTPUTS}",
        )
    if request.shots != 1:
        raise InputError(
            "trigger-shots", "an ESPER box makes one shot at a time", "ask for one shot"
        )
    holds = {_whole_ms(pulse.width_us, "width") for pulse in pulses.values()}
    if len(holds) != 1:
        raise InputError(
            "trigger-width",
            "an ESPER box has one hold time for all outputs",
            "give all pulses the same width",
        )
    delays = {output: _whole_ms(pulse.delay_us, "delay") for output, pulse in pulses.items()}
    outputs = range(1, OUTPUTS + 1)
    return EsperProgram(
        capture_id=request.capture_id,
        delays_ms=tuple(delays.get(output, 0) for output in outputs),
        hold_ms=holds.pop(),
        mask="".join("1" if output in pulses else "0" for output in outputs),
        expires_s=request.expires_s,
    )


def _whole_ms(time_us: float, what: str) -> int:
    whole = round(time_us / 1000.0)
    if abs(time_us - whole * 1000.0) > 0.5 or whole > MAX_MS:
        raise InputError(
            f"trigger-{what}",
            f"an ESPER box cannot make a {what} of {time_us:g} us",
            f"use whole milliseconds up to {MAX_MS}",
        )
    return whole
