"""From microseconds to ticks: what a capture asks of a box, checked against what it can do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from common.errors import DeviceError, InputError
from rig.acquisition.trigger.box import ArmRequest, Pulse, TriggerCapabilities
from rig.acquisition.trigger.edges import OUTPUTS, STROBES, OutputEdge, compile_edges, nearest
from rig.acquisition.trigger.protocol import CAPTURE_ID

MIN_LEAD_TICKS = 2000
MIN_PAUSE_TICKS = 2000


_LIMITS = {
    "tick_ns": "tick_ns",
    "max_delay_ticks": "dmax",
    "max_width_ticks": "wmax",
    "max_strobe_width_ticks": "smax",
    "gap_ticks": "gap",
    "max_edges": "edges",
    "max_shots": "shots",
    "hold_ms": "hold",
}


@dataclass(frozen=True)
class BoxSafety:
    """``SAFE?``: the dead man's time, as it is unless told and between what; the strobes' rest.

    ``strobe_rest`` is in ticks, ``strobe_duty_percent`` the largest part of the time for which a
    strobe may be on.
    """

    dead_man_ms: int
    least_dead_man_ms: int
    longest_dead_man_ms: int
    strobe_rest: int
    strobe_duty_percent: int

    @staticmethod
    def read(fields: Mapping[str, str]) -> BoxSafety:
        """From the fields of the reply; raises KeyError and ValueError."""
        return BoxSafety(
            *(int(fields[name]) for name in ("dm", "dmmin", "dmmax", "srest", "sduty"))
        )

    def strobe_interval(self, width_ticks: int) -> int:
        """From one pulse of a strobe to the next one, at least, in ticks."""
        return max(
            width_ticks + self.strobe_rest, -(-width_ticks * 100 // self.strobe_duty_percent)
        )


@dataclass(frozen=True)
class BoxLimits:
    """``CAP?`` as numbers. Times in ticks but ``hold_ms``."""

    tick_ns: int
    max_delay_ticks: int
    max_width_ticks: int
    max_strobe_width_ticks: int
    gap_ticks: int
    max_edges: int
    max_shots: int
    hold_ms: int
    safety: BoxSafety | None = None
    """None for a box with firmware of before: it fires on without its host."""

    @staticmethod
    def read(fields: Mapping[str, str], safe: Mapping[str, str] | None = None) -> BoxLimits:
        """From the replies to ``CAP?`` and ``SAFE?`` (None where the box does not know that).

        Raises :class:`DeviceError` for a box of another protocol.
        """
        if fields.get("proto") != "1" or fields.get("out") != str(OUTPUTS):
            raise DeviceError(
                "trigger-wrong",
                f"the box speaks protocol {fields.get('proto')} with {fields.get('out')} outputs",
                f"use a box with protocol 1 and {OUTPUTS} outputs",
            )
        try:
            numbers = {field: int(fields[name]) for field, name in _LIMITS.items()}
            return BoxLimits(**numbers, safety=None if safe is None else BoxSafety.read(safe))
        except (KeyError, ValueError) as error:
            raise DeviceError(
                "trigger-wrong",
                f"the box does not state its limits ({error})",
                "load firmware that fits this version of Rigwright",
            ) from error

    def capabilities(self) -> TriggerCapabilities:
        """In the words of the interface."""
        tick_us = self.tick_ns / 1000.0
        return TriggerCapabilities(
            outputs=OUTPUTS,
            tick_us=tick_us,
            max_delay_us=self.max_delay_ticks * tick_us,
            max_width_us=self.max_width_ticks * tick_us,
            max_shots=self.max_shots,
            acknowledges_fire=True,
            edge_log=True,
            clock=True,
            dead_man=self.safety is not None,
        )


@dataclass(frozen=True)
class Program:
    """One capture in ticks; ``pulses`` by output: delay and width."""

    capture_id: str
    pulses: Mapping[int, tuple[int, int]]
    shots: int
    interval_ticks: int
    lead: int
    ttl_ms: int
    edges: tuple[OutputEdge, ...]
    dead_man_ms: int | None = None
    """None where the box knows no such thing."""

    @property
    def mask(self) -> int:
        """Bit 0 for output 1."""
        return sum(1 << (output - 1) for output in self.pulses)

    @property
    def duration(self) -> int:
        """From a shot's start to its last edge."""
        return self.edges[-1].at

    @property
    def total(self) -> int:
        """From FIRE to the last edge of all."""
        return self.lead + (self.shots - 1) * self.interval_ticks + self.duration


def compile_program(request: ArmRequest, limits: BoxLimits) -> Program:
    """The program of a capture.

    Raises :class:`~common.errors.InputError` naming the first thing the box cannot do.
    """
    if not CAPTURE_ID.fullmatch(request.capture_id):
        raise InputError(
            "capture-id",
            f"{request.capture_id!r} cannot name a capture at the box",
            "use 1 to 12 of the characters A-Z a-z 0-9 _ -",
        )
    ticks_per_us = 1000.0 / limits.tick_ns
    pulses = {}
    for output, pulse in sorted(request.pulses.items()):
        ticks = (round(pulse.delay_us * ticks_per_us), round(pulse.width_us * ticks_per_us))
        _check_pulse(output, pulse, ticks, limits)
        if ticks[1]:
            pulses[output] = ticks
    edges = compile_edges(pulses, 0xFFFF)
    _check_edges(edges, limits)
    program = Program(
        capture_id=request.capture_id,
        pulses=pulses,
        shots=request.shots,
        interval_ticks=round(request.interval_us * ticks_per_us) if request.shots > 1 else 0,
        lead=round(request.lead_us * ticks_per_us),
        ttl_ms=round(request.expires_s * 1000.0),
        edges=edges,
        dead_man_ms=round(request.dead_man_s * 1000.0) if limits.safety else None,
    )
    _check_times(program, limits)
    if limits.safety is not None:
        _check_safety(program, limits.safety, limits.tick_ns / 1000.0)
    return program


def _check_pulse(output: int, pulse: Pulse, ticks: tuple[int, int], limits: BoxLimits) -> None:
    if not 1 <= output <= OUTPUTS:
        raise InputError(
            "trigger-output", f"the box has no output {output}", f"use outputs 1 to {OUTPUTS}"
        )
    widest = limits.max_strobe_width_ticks if output in STROBES else limits.max_width_ticks
    tick_us = limits.tick_ns / 1000.0
    if ticks[0] > limits.max_delay_ticks:
        raise InputError(
            "trigger-delay",
            f"output {output} cannot wait {pulse.delay_us:g} us",
            f"stay within {limits.max_delay_ticks * tick_us:g} us",
        )
    if ticks[1] > widest:
        raise InputError(
            "trigger-width",
            f"output {output} cannot be on for {pulse.width_us:g} us",
            f"stay within {widest * tick_us:g} us",
        )


def _check_edges(edges: tuple[OutputEdge, ...], limits: BoxLimits) -> None:
    if not edges:
        raise InputError(
            "trigger-nothing", "no output has a pulse", "give one output a width above 0"
        )
    if len(edges) > limits.max_edges:
        raise InputError(
            "trigger-edges",
            f"{len(edges)} different instants in a shot are more than {limits.max_edges}",
            "let some pulses begin or end together",
        )
    if nearest(edges) < limits.gap_ticks:
        least_us = limits.gap_ticks * limits.tick_ns / 1000.0
        raise InputError(
            "trigger-gap",
            f"two edges are nearer than {least_us:g} us",
            f"let them be simultaneous, or {least_us:g} us apart",
        )


def _check_times(program: Program, limits: BoxLimits) -> None:
    tick_us = limits.tick_ns / 1000.0
    if not 1 <= program.shots <= limits.max_shots:
        raise InputError(
            "trigger-shots",
            f"the box cannot make {program.shots} shots in a burst",
            f"ask for 1 to {limits.max_shots}",
        )
    shortest = program.duration + MIN_PAUSE_TICKS
    if program.shots > 1 and program.interval_ticks < shortest:
        raise InputError(
            "trigger-interval",
            f"shots every {program.interval_ticks * tick_us:g} us overlap",
            f"leave {shortest * tick_us:g} us or more from start to start",
        )
    if not MIN_LEAD_TICKS <= program.lead <= limits.max_delay_ticks:
        raise InputError(
            "trigger-lead",
            f"a lead of {program.lead * tick_us:g} us cannot be kept",
            f"give {MIN_LEAD_TICKS * tick_us:g} us or more",
        )
    if not 1 <= program.ttl_ms <= limits.hold_ms:
        raise InputError(
            "trigger-expiry",
            f"the box cannot stay armed for {program.ttl_ms / 1000:g} s",
            f"give up to {limits.hold_ms / 1000:g} s",
        )


def _check_safety(program: Program, safety: BoxSafety, tick_us: float) -> None:
    dead_man_ms = program.dead_man_ms
    least, most = safety.least_dead_man_ms, safety.longest_dead_man_ms
    if dead_man_ms and not least <= dead_man_ms <= most:
        raise InputError(
            "trigger-dead-man",
            f"the box cannot wait {dead_man_ms / 1000:g} s for a sign of life while it fires",
            f"give {least / 1000:g} to {most / 1000:g} s, or 0 to let it fire alone",
        )
    for output in STROBES:
        width = program.pulses.get(output, (0, 0))[1]
        shortest = safety.strobe_interval(width)
        if width and program.shots > 1 and program.interval_ticks < shortest:
            raise InputError(
                "trigger-strobe-rest",
                f"output {output}, a strobe, cannot flash for {width * tick_us:g} us every "
                f"{program.interval_ticks * tick_us:g} us: it must rest "
                f"{safety.strobe_rest * tick_us:g} us and be on for at most "
                f"{safety.strobe_duty_percent} % of the time",
                f"leave {shortest * tick_us:g} us or more from start to start",
            )
