"""The fake trigger box: a state machine with a clock it is given, and its outputs.

Time passes only in :meth:`FakeBox.advance`; edges are made at their programmed instants
whenever that is called, so what a test sees does not depend on how busy the computer is.
"""

from __future__ import annotations

import random
import secrets
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from rig.acquisition.trigger.edges import OUTPUTS, STROBES
from rig.acquisition.trigger.fake.clock import BoxClock
from rig.acquisition.trigger.fake.limits import FakeLimits, PhysicalEdge
from rig.acquisition.trigger.fake.memory import (
    Capture,
    CaptureMemory,
    ErrorQueue,
    EventLog,
    Permanent,
    Replies,
)
from rig.acquisition.trigger.protocol import Event, instant_text

SILENCE_MS = 3000
TICKS_PER_MS = 2000
FIRMWARE = "fake-2"


@dataclass(frozen=True)
class FakeSettings:
    """How a fake box is made.

    ``drift_ppm``: how much faster its clock runs than the host's; ``start_ticks`` and
    ``first_event`` begin its counters elsewhere, near their end for example; ``jitter_ticks``:
    each edge is late by up to this much, at random of ``seed``; ``identity`` in place of its own
    answer to ``*IDN?``; ``boot_s``: how long it is deaf after a reset.
    """

    serial_number: str = "fake"
    drift_ppm: float = 0.0
    start_ticks: int = 0
    first_event: int = 1
    jitter_ticks: int = 0
    seed: int = 0
    identity: str = ""
    boot_s: float = 0.0
    limits: FakeLimits = field(default_factory=FakeLimits)


class FakeBox:
    """State, outputs and memory; what the lines say is :class:`~.commands.Commands`'.

    ``now_ns`` is the host's clock. Every public method may be called from any thread.
    ``emit`` hears each event as it happens.
    """

    def __init__(self, now_ns: Callable[[], int], settings: FakeSettings) -> None:
        self.lock = threading.RLock()
        self.settings = settings
        self.limits = settings.limits
        self.edges: list[PhysicalEdge] = []
        """Every edge ever made, falling ones of an abort included."""
        self.emit: Callable[[Event], None] = lambda event: None  # noqa: ARG005
        self.permanent = Permanent(settings.serial_number)
        self.interlock_closed = True
        self.captures = CaptureMemory()
        self._now_ns = now_ns
        self._random = random.Random(settings.seed)  # noqa: S311 - lateness of a fake
        self._level = 0
        self.strobe_ready = 0
        self._start("POWER")

    def _start(self, cause: str) -> None:
        self.clock = BoxClock(self._now_ns(), self.settings.drift_ppm, self.settings.start_ticks)
        self.deaf_until_ns = self._now_ns()
        self.permanent.boots += 1
        self.cause = cause
        # Another one at each start of each fake, whatever its seed: that is what it is for.
        self.start_id = f"{secrets.randbits(16):04X}"
        self.state = "IDLE"
        self.fault = ""
        self.pulses: dict[int, tuple[int, int]] = {}
        self.replies = Replies()
        self.log = EventLog(self.settings.first_event)
        self.errors = ErrorQueue()
        self.armed: Capture | None = None
        self._expires = 0
        self.heard = 0
        """The instant of the last sign of life, in ticks."""
        self._shot = 0
        self._edge = 0
        self._shot_late: list[int] = []
        started = {"n": str(self.permanent.boots), "cause": cause, "id": self.start_id}
        self.announce("BOOT", started)

    # -- time --------------------------------------------------------------------------------

    def ticks(self) -> int:
        """The box's clock now."""
        return self.clock.ticks(self._now_ns())

    def advance(self) -> None:
        """Do everything that is due by now, in order."""
        with self.lock:
            now = self.ticks()
            while (due := self._next_due()) is not None and due <= now:
                if self.state == "FIRING" and due != self._silent_at():
                    self._make_edge()
                else:
                    self._expire(due)

    def next_due_ns(self) -> int | None:
        """The host's instant at which :meth:`advance` has something to do."""
        with self.lock:
            due = self._next_due()
            return None if due is None else self.clock.host_ns(due)

    def _next_due(self) -> int | None:
        if self.armed is None:
            return None
        if self.state == "FIRING":
            start = self.armed.start + self._shot * self.armed.interval_ticks
            edge = start + self.armed.edges[self._edge].at
            silent = self._silent_at()
            return edge if silent is None else min(edge, silent)
        return min(self._expires, self.heard + SILENCE_MS * TICKS_PER_MS)

    def _silent_at(self) -> int | None:
        """When a burst ends unless its host is heard; None for one that may be left alone."""
        if self.armed is None or self.armed.dead_man_ms == 0:
            return None
        return self.heard + self.armed.dead_man_ms * TICKS_PER_MS

    def strobes(self, mask: int) -> list[tuple[int, int]]:
        """Delay and width of each strobe of a mask that has a pulse."""
        wanted = (self.pulses.get(o, (0, 0)) for o in STROBES if mask & 1 << (o - 1))
        return [pulse for pulse in wanted if pulse[1]]

    def hear(self) -> None:
        """A checked request has come: the host is there."""
        self.heard = self.ticks()

    # -- captures ----------------------------------------------------------------------------

    def arm(self, capture: Capture, ttl_ms: int) -> None:
        """IDLE to ARMED."""
        self.captures.add(capture)
        self.armed = capture
        self.state = "ARMED"
        self._expires = self.ticks() + ttl_ms * TICKS_PER_MS
        self.hear()
        self.announce("ARMED", {"cap": capture.id})

    def fire(self, capture: Capture) -> None:
        """ARMED to FIRING."""
        capture.start = self.ticks() + capture.lead
        capture.result = "FIRING"
        self.state = "FIRING"
        self._shot = self._edge = 0
        self._shot_late = []

    def stop(self, event: str, fields: Mapping[str, str], why: str, at: int | None = None) -> None:
        """End a capture that is ARMED or FIRING before its time; all outputs low."""
        self._set_pins(0, self.ticks() if at is None else at)
        capture = self.armed
        if capture is None:
            return
        capture.why = why
        if self.state == "FIRING":
            self.strobe_ready = self.ticks() + capture.strobe_rest
        capture.result = "PARTIAL" if self.state == "FIRING" else "NOT_FIRED"
        self.armed = None
        self.state = "IDLE"
        self.announce(event, {"cap": capture.id, **fields})

    def abort(self) -> None:
        """All outputs low; ends what is armed or firing."""
        shots = len(self.armed.shots) if self.armed else 0
        self.stop("ABORTED", {"shots": str(shots)}, "abort")

    def _expire(self, due: int) -> None:
        over = self.state == "ARMED" and due == self._expires
        why = "ttl" if over else "silence"
        self.stop("EXPIRED", {"why": why}, why, due)

    def _make_edge(self) -> None:
        capture = self.armed
        if capture is None:
            return
        start = capture.start + self._shot * capture.interval_ticks
        edge = capture.edges[self._edge]
        late = self._random.randint(0, self.settings.jitter_ticks)
        self._set_pins(edge.pins, start + edge.at + late)
        self._shot_late.append(late)
        self._edge += 1
        if self._edge == len(capture.edges):
            self._end_shot(capture, start)

    def _end_shot(self, capture: Capture, start: int) -> None:
        late = max(self._shot_late)
        capture.shots.append((start, late))
        capture.edge_late = self._shot_late
        self._shot, self._edge, self._shot_late = self._shot + 1, 0, []
        done, of = str(self._shot), str(capture.shots_wanted)
        fields = {"cap": capture.id, "shot": done, "of": of, "t0": instant_text(start)}
        self.announce("DONE", {**fields, "late": str(late)})
        if self._shot == capture.shots_wanted:
            capture.result = "FIRED"
            self.strobe_ready = start + capture.duration + capture.strobe_rest
            self.armed = None
            self.state = "IDLE"
            first = instant_text(capture.start)
            self.announce("FIRED", {"cap": capture.id, "shots": done, "t0": first})

    def _set_pins(self, pins: int, ticks: int) -> None:
        host_ns = self.clock.host_ns(ticks)
        name = self.armed.id if self.armed else ""
        for output in range(1, OUTPUTS + 1):
            bit = 1 << (output - 1)
            if (pins ^ self._level) & bit:
                rising = bool(pins & bit)
                self.edges.append(PhysicalEdge(host_ns, ticks, output, rising, name))
        self._level = pins

    # -- the world outside -------------------------------------------------------------------

    def set_interlock(self, closed: bool) -> None:
        """Open or close the interlock's contact."""
        with self.lock:
            self.advance()
            if closed == self.interlock_closed:
                return
            self.interlock_closed = closed
            self.announce("INTERLOCK", {"il": "CLOSED" if closed else "OPEN"})
            if not closed and self.armed is not None:
                self.fail("interlock")

    def fail(self, why: str) -> None:
        """Stop for safety: FAULT, all outputs low."""
        with self.lock:
            self.stop("FAULT", {"why": why}, why)
            self.state = "FAULT"
            self.fault = why

    def reset(self, cause: str = "EXTERNAL", keeps_power: bool = True) -> None:
        """Start anew, as by the reset line; without power the results are lost too."""
        with self.lock:
            self.advance()
            self._set_pins(0, self.ticks())
            if self.armed is not None:
                self.armed.result = "PARTIAL" if self.state == "FIRING" else "NOT_FIRED"
                self.armed.why = "reset"
            self.strobe_ready = 0
            if not keeps_power:
                self.captures = CaptureMemory()
            self._start(cause)
            self.deaf_until_ns = self._now_ns() + int(self.settings.boot_s * 1e9)

    def announce(self, name: str, fields: Mapping[str, str]) -> None:
        """Log an event and say it."""
        self.emit(self.log.add(name, fields))
