"""Keeps one box connected and known: which box, which start, what state, what time it has.

Everything here runs on the one thread that owns the port; :attr:`Connection.view` may be read by
any.
"""

from __future__ import annotations

import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass

from common.errors import DeviceError
from rig.acquisition.trigger.box import TriggerState
from rig.acquisition.trigger.client import BoxClient, BoxStart, BoxStatus, Identity, RefusedError
from rig.acquisition.trigger.clock import ClockFit, ClockModel
from rig.acquisition.trigger.link import NoAnswerError, RequestLink
from rig.acquisition.trigger.metrics import Metrics, WireLog
from rig.acquisition.trigger.program import BoxLimits, Program
from rig.acquisition.trigger.protocol import Event
from rig.acquisition.trigger.sequence import EventSequence
from rig.acquisition.trigger.serialline import SerialLine

STATES = {
    "IDLE": TriggerState.READY,
    "ARMED": TriggerState.ARMED,
    "FIRING": TriggerState.FIRING,
    "FAULT": TriggerState.FAULT,
}
SAMPLES_AT_CONNECT = 16
FULL_CLOCK = 200
"""Readings that the clock model is filled up to quickly; then it is kept at the slow rate."""
QUICK_S = 0.1
SLOW_S = 0.5
HEARTBEAT_S = 1.0
_JUMP_S = 0.25
"""The box's clock and the host's may differ by this between two heartbeats; more is a restart."""


@dataclass
class BoxView:
    """What is known of the box. Written by its owner's thread; reading it is always safe."""

    state: TriggerState = TriggerState.DISCONNECTED
    identity: Identity | None = None
    limits: BoxLimits | None = None
    boots: int | None = None
    interlock_closed: bool | None = None
    armed: str | None = None
    residual_us: float | None = None
    problem: str = ""


class Connection:
    """One box behind one open line. ``heard`` are events not yet looked at."""

    def __init__(self, expected_serial: str, metrics: Metrics, wire_log: WireLog | None) -> None:
        self.view = BoxView()
        self.metrics = metrics
        self.clock: ClockModel = ClockModel()
        self.heard: deque[Event] = deque()
        self.status_due_ns = 0
        self._expected_serial = expected_serial
        self._wire_log = wire_log
        self._client: BoxClient | None = None
        self._sequence = EventSequence()
        self._missing: deque[int] = deque()
        self._outputs: dict[int, tuple[int, int]] = {}
        self._start: BoxStart | None = None
        self._boot_doubted = False
        self._bannered = False
        self._jumped = False
        self.feed_s = HEARTBEAT_S
        """How often the box wants a sign of life, at least."""
        self._last_status: BoxStatus | None = None
        self._sample_due_ns = 0

    @property
    def client(self) -> BoxClient:
        """The box, to be asked; :class:`NoAnswerError` when there is no line."""
        if self._client is None:
            raise NoAnswerError("no line")
        return self._client

    # -- connecting --------------------------------------------------------------------------

    def attach(self, line: SerialLine) -> None:
        """A line has been opened; :meth:`meet` comes next."""
        self._client = BoxClient(RequestLink(line, self.metrics, self._hear, self._wire_log))
        self.view.state = TriggerState.PROBING
        self.client.link.clear_line()

    def detach(self) -> None:
        """The line is gone."""
        self._client = None
        self.view.state = TriggerState.DISCONNECTED

    def meet(self) -> None:
        """Ask who is there, once, and learn all about it.

        Raises :class:`~common.errors.DeviceError` ``device/trigger-wrong`` for another box.
        """
        identity = self.client.identify()
        self._check_serial(identity)
        self.view.limits = self.client.limits()
        self.view.identity = identity
        self._expected_serial = identity.serial_number
        status = self.look()
        self.check_boot()
        self._sequence.restart(status.last_event)
        for _ in range(SAMPLES_AT_CONNECT - min(len(self.clock), SAMPLES_AT_CONNECT - 2)):
            self.sample()
        self.fit()

    def _check_serial(self, identity: Identity) -> None:
        if self._expected_serial and identity.serial_number != self._expected_serial:
            raise DeviceError(
                "trigger-wrong",
                f"box {identity.serial_number!r} answers where box {self._expected_serial!r} "
                "should be",
                "plug the right box in, or name the other one in the station file",
            )

    # -- knowing -----------------------------------------------------------------------------

    def look(self) -> BoxStatus:
        """Ask for its state."""
        status = self.client.status()
        pause_s = min(HEARTBEAT_S, self.feed_s)
        self.status_due_ns = time.monotonic_ns() + int(pause_s * 1e9)
        self.view.state = STATES.get(status.state, TriggerState.FAULT)
        self.view.interlock_closed = status.interlock_closed
        self.view.armed = status.capture if status.state == "ARMED" else None
        last, self._last_status = self._last_status, status
        if last is not None and self._clock_jumped(last, status):
            self._boot_doubted = self._jumped = True
        return status

    @property
    def last_capture(self) -> str | None:
        """The capture that the box had armed or known last, when it was last looked at."""
        return self._last_status.capture if self._last_status is not None else None

    def _clock_jumped(self, last: BoxStatus, status: BoxStatus) -> bool:
        limits = self.view.limits
        tick_ns = limits.tick_ns if limits is not None else 500
        box_s = (status.ticks - last.ticks) * tick_ns / 1e9
        host_s = (status.host_ns - last.host_ns) / 1e9
        return abs(box_s - host_s) > _JUMP_S + 0.02 * host_s

    def check_boot(self) -> bool:
        """Whether the box was started anew since it was last asked; then nothing holds.

        Its count alone does not tell: another box on the same path, or one that has lost its
        permanent memory, may have counted as far. So does each start's id, where the box gives
        one; a clock that has jumped; and, where there is no id, the banner of a start.
        """
        known, self._start = self._start, self.client.start()
        self.view.boots = self._start.count
        unnamed = self._bannered and self._start.id is None
        restarted = known is not None and (known != self._start or self._jumped or unnamed)
        if restarted and not self._jumped:
            self._last_status = None  # of the start before; the next one would seem to jump
        self._boot_doubted = self._bannered = self._jumped = False
        if restarted:
            self.metrics.count("reboots")
            self._outputs.clear()
            self.clock.clear()
            self._sequence.restart(None)
            self._missing.clear()
        return restarted

    @property
    def boot_doubted(self) -> bool:
        """Whether something looks as if the box had been started anew."""
        return self._boot_doubted

    def forget_outputs(self) -> None:
        """The box has none set any more."""
        self._outputs.clear()

    def set_outputs(self, program: Program) -> None:
        """Send those outputs that are not as the program wants them."""
        for output, (delay, width) in program.pulses.items():
            if self._outputs.get(output) != (delay, width):
                self._outputs.pop(output, None)
                self.client.set_output(output, delay, width)
                self._outputs[output] = (delay, width)

    def fetch_missing(self) -> bool:
        """Ask for one lost event; whether there was one."""
        if not self._missing:
            return False
        number = self._missing.popleft()
        event = self.client.event(number)
        if self._sequence.fetched(number) and event is not None:
            self._note(event)
        return True

    # -- its clock ---------------------------------------------------------------------------

    def sample(self) -> None:
        """Take one reading of its clock; a lost one does not matter."""
        with suppress(NoAnswerError, RefusedError):
            self.clock.add(self.client.clock_sample())
        pause_s = QUICK_S if len(self.clock) < FULL_CLOCK else SLOW_S
        self._sample_due_ns = time.monotonic_ns() + int(pause_s * 1e9)

    @property
    def sample_due_ns(self) -> int:
        """When the next reading should be taken."""
        return self._sample_due_ns

    def fit(self) -> ClockFit | None:
        """The clock model's line now."""
        fit = self.clock.fit()
        self.view.residual_us = fit.residual_us if fit is not None else None
        return fit

    # -- events ------------------------------------------------------------------------------

    def _hear(self, event: Event) -> None:
        self.metrics.count("events")
        if event.name == "BOOT":
            self._sequence.restart(event.number)
            self._boot_doubted = self._bannered = True
            return
        new, missing = self._sequence.accept(event.number)
        if missing:
            self.metrics.count("events_lost", len(missing))
            self._missing.extend(missing)
        if new:
            self._note(event)

    def _note(self, event: Event) -> None:
        if event.name == "INTERLOCK":
            self.view.interlock_closed = event.fields.get("il") == "CLOSED"
        if event.name == "FAULT":
            self.status_due_ns = 0
        self.heard.append(event)
