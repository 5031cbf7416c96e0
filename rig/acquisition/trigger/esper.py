"""A second kind of box behind the same interface: ESPER's TriggerBox.

Letters on a serial line, 115200 baud, one command to a line; everything but ``S`` (fire) is
answered by ``tenFour``. Source: ESPER's public list of commands. What follows from that:

- A lost ``S`` cannot be noticed and a doubled one is a second flash, so ``S`` is written once
  and never again. A capture is reported as fired with ``acknowledged=False``, or as unknown
  when the box does not answer afterwards. Whether the cameras went off only their pictures say.
- No checksum, no log of edges, no clock, no interlock, no way to stop a pulse that has begun.
- Six outputs, whole milliseconds, one hold time for all, one shot.
"""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

from common.errors import ConflictError, DeviceError
from rig.acquisition.trigger.box import (
    ArmRequest,
    FireOutcome,
    FireReport,
    TriggerCapabilities,
    TriggerHealth,
    TriggerState,
    WireLine,
)
from rig.acquisition.trigger.driver import BoxAddress
from rig.acquisition.trigger.esper_program import MAX_MS, OUTPUTS, EsperProgram, compile_esper
from rig.acquisition.trigger.lines import MAX_ANSWER, LineReader
from rig.acquisition.trigger.metrics import Metrics, WireLog, WireTape
from rig.acquisition.trigger.serialline import LineLostError, SerialLine

TEN_FOUR = "tenFour"
_TRY_S = 0.15
_TRIES = 3
_PROBE_S = 8.0
_NO_HANDLE = -1
"""Nobody wakes a read: orders run on the thread of whoever gives them."""
_VALUE = re.compile(r"([^:\[\]]+):\[(.*)\]")

CAPABILITIES = TriggerCapabilities(
    outputs=OUTPUTS,
    tick_us=1000.0,
    max_delay_us=MAX_MS * 1000.0,
    max_width_us=MAX_MS * 1000.0,
    max_shots=1,
    acknowledges_fire=False,
    edge_log=False,
    clock=False,
)


@dataclass
class _Shot:
    """What this driver did for a capture."""

    program: EsperProgram
    armed_ns: int
    sent_ns: int | None = None
    report: FireReport | None = None


class EsperTriggerBox:
    """A :class:`~rig.acquisition.trigger.box.TriggerBox` for ESPER's protocol.

    ``half_press`` holds the focus lines from ARM until the capture is over, as most camera bodies
    need for a steady shutter lag; they do not answer over USB meanwhile. A FIRE that comes sooner
    than ``focus_lead_us`` after ARM waits for it. A lost line is opened
    again by the next order. The box cannot hold a lead time: the first shot starts with FIRE.
    """

    def __init__(
        self,
        address: BoxAddress,
        *,
        half_press: bool = False,
        focus_lead_us: float = 0.0,
        wire_log: WireLog | None = None,
    ) -> None:
        self.address = address
        self._half_press = half_press
        self._focus_lead_ns = int(focus_lead_us * 1000.0)
        self._tape = WireTape(wire_log)
        self._metrics = Metrics()
        self._reader = LineReader(MAX_ANSWER)
        self._line: SerialLine | None = None
        self._lock = threading.RLock()
        self._state = TriggerState.DISCONNECTED
        self._identity = ""
        self._firmware = ""
        self._problem = ""
        self._armed: str | None = None
        self._shots: dict[str, _Shot] = {}
        self._listeners: list[Callable[[FireReport], None]] = []

    @property
    def capabilities(self) -> TriggerCapabilities:
        """The same for every ESPER box."""
        return CAPABILITIES

    def open(self) -> None:
        """Connect and probe."""
        with self._lock:
            if self._line is None:
                self._connect(_PROBE_S)

    def close(self) -> None:
        """Disarm if armed, and let go of the port."""
        with self._lock:
            if self._line is None:
                return
            if self._armed is not None:
                with suppress(DeviceError):
                    self.disarm(self._armed)
            self._drop("")

    def health(self) -> TriggerHealth:
        """The present state, as this driver remembers it."""
        median, p99 = self._metrics.percentiles_ms()
        return TriggerHealth(
            state=self._state,
            identity=f"ESPER TriggerBox {self._identity}" if self._identity else "",
            serial_number=self._identity,
            firmware=self._firmware,
            armed_capture=self._armed,
            round_trip_p50_ms=median,
            round_trip_p99_ms=p99,
            counters=self._metrics.counts(),
            last_problem=self._problem,
        )

    def arm(self, request: ArmRequest) -> None:
        """Set delays, hold and outputs. Being armed is kept here; the box does not know it."""
        program = compile_esper(request)
        with self._lock:
            if self._armed is not None:
                raise ConflictError(
                    "trigger-armed",
                    f"the box is armed for capture {self._armed}",
                    "fire or disarm it first",
                )
            if program.capture_id in self._shots:
                raise ConflictError(
                    "trigger-refused",
                    f"capture {program.capture_id} was armed before",
                    "arm a new capture",
                )
            self._ensure_line()
            for command in program.commands():
                self._order(command)
            if self._half_press:
                self._order("F1")
            self._shots[program.capture_id] = _Shot(program, time.monotonic_ns())
            self._armed = program.capture_id
            self._state = TriggerState.ARMED

    def fire(self, capture_id: str) -> None:
        """Write ``S``, once. Returns when it is written; nobody acknowledges it."""
        with self._lock:
            shot = self._shots.get(capture_id)
            if shot is None or self._armed != capture_id or self._line is None:
                raise _not_armed(capture_id)
            self._armed = None
            if time.monotonic_ns() - shot.armed_ns > shot.program.expires_s * 1e9:
                self._state = TriggerState.READY
                raise _not_armed(capture_id)
            if self._half_press:
                time.sleep(max(shot.armed_ns + self._focus_lead_ns - time.monotonic_ns(), 0) / 1e9)
            shot.sent_ns = time.monotonic_ns()
            self._state = TriggerState.FIRING
            try:
                self._write("S")
            except LineLostError as error:
                self._drop(str(error))
                raise _gone(str(error)) from error

    def wait_done(self, capture_id: str, timeout_s: float) -> FireReport:
        """Wait for the pulses' time and see whether the box is still there."""
        deadline = time.monotonic() + timeout_s
        shot = self._shots.get(capture_id)
        if shot is None:
            report = _report(capture_id, FireOutcome.UNKNOWN, "this driver has not armed it")
        else:
            report = shot.report or self._find_out(shot, deadline)
            report = replace(report, wire=self._tape.since(shot.armed_ns))
        for listener in list(self._listeners):
            listener(report)
        return report

    def _find_out(self, shot: _Shot, deadline: float) -> FireReport:
        capture_id = shot.program.capture_id
        if shot.sent_ns is None:
            armed = self._armed == capture_id
            why = "FIRE was not given"
            return _report(capture_id, FireOutcome.UNKNOWN if armed else FireOutcome.NOT_FIRED, why)
        ends = shot.sent_ns / 1e9 + shot.program.duration_s
        time.sleep(max(min(ends, deadline) - time.monotonic(), 0.0))
        if time.monotonic() < ends:
            return _report(capture_id, FireOutcome.UNKNOWN, "it is firing still")
        shot.report = self._conclude(capture_id)
        return shot.report

    def _conclude(self, capture_id: str) -> FireReport:
        with self._lock:
            try:
                if self._line is None:
                    raise _gone(self._problem)
                self._ask("V")
                if self._half_press:
                    self._order("F0")
            except DeviceError as error:
                return _report(capture_id, FireOutcome.UNKNOWN, str(error))
            self._state = TriggerState.READY
            why = "the order was sent and the box answers, but it does not acknowledge fire"
            return _report(capture_id, FireOutcome.FIRED, why)

    def disarm(self, capture_id: str) -> None:
        """Forget that it is armed, and let the focus lines go."""
        with self._lock:
            if self._armed != capture_id:
                return
            self._armed = None
            self._state = TriggerState.READY
            if self._half_press:
                self._ensure_line()
                self._order("F0")

    def abort(self) -> None:
        """Let the focus lines go and take all outputs out; a pulse that has begun goes on."""
        with self._lock:
            self._armed = None
            self._ensure_line()
            self._order("F0")
            self._order("s" + "0" * OUTPUTS)
            self._state = TriggerState.READY

    def reset(self) -> None:
        """As :meth:`abort`: this box has no fault to leave."""
        self.abort()

    def subscribe(self, listener: Callable[[FireReport], None]) -> Callable[[], None]:
        """Hear every report before :meth:`wait_done` returns it."""
        self._listeners.append(listener)
        return lambda: self._listeners.remove(listener) if listener in self._listeners else None

    # -- the line ----------------------------------------------------------------------------

    def _ensure_line(self) -> None:
        if self._line is None:
            self._connect(1.0)

    def _connect(self, patience_s: float) -> None:
        self._state = TriggerState.OPENING
        try:
            self._line = SerialLine(self.address.url, self.address.baud, _NO_HANDLE)
            self._state = TriggerState.PROBING
            self._probe(time.monotonic() + patience_s)
        except DeviceError as error:
            self._drop(str(error))
            raise
        self._state = TriggerState.READY
        self._problem = ""

    def _probe(self, deadline: float) -> None:
        while True:
            try:
                self._firmware = self._ask("V")
                break
            except DeviceError:
                if self._line is None or time.monotonic() > deadline:
                    raise
        identity = self._ask("I")
        wanted = self.address.serial_number or self._identity
        if wanted and identity != wanted:
            raise DeviceError(
                "trigger-wrong",
                f"ESPER box {identity!r} answers where {wanted!r} should be",
                "plug the right box in, or name the other one",
            )
        self._identity = identity

    def _order(self, command: str) -> None:
        """A command that is answered by ``tenFour``; all of them may be said twice."""
        self._exchange(command, lambda text: text if text == TEN_FOUR else None)

    def _ask(self, command: str) -> str:
        """A command that is answered by ``Name:[value]``; the value."""

        def value(text: str) -> str | None:
            found = _VALUE.fullmatch(text)
            return found[2] if found else None

        return self._exchange(command, value)

    def _exchange(self, command: str, accept: Callable[[str], str | None]) -> str:
        try:
            for number in range(_TRIES):
                if number:
                    self._metrics.count("retries")
                sent = time.monotonic()
                self._write(command)
                answer = self._await(accept)
                if answer is not None:
                    self._metrics.round_trip((time.monotonic() - sent) * 1e3)
                    return answer
        except LineLostError as error:
            self._drop(str(error))
            raise _gone(str(error)) from error
        self._metrics.count("no_answer")
        self._problem = f"no answer to {command!r}"
        raise _gone(self._problem)

    def _await(self, accept: Callable[[str], str | None]) -> str | None:
        deadline = time.monotonic() + _TRY_S
        while (left := deadline - time.monotonic()) > 0.0:
            for raw in self._reader.feed(self._port().receive(left, wakeable=False)):
                self._log(raw.text, sent=False)
                answer = accept(raw.text) if raw.sound else None
                if answer is not None:
                    return answer
                self._metrics.count("resyncs")
        return None

    def _write(self, command: str) -> None:
        self._metrics.count("sent")
        self._log(command, sent=True)
        self._port().send(command.encode() + b"\n")

    def _port(self) -> SerialLine:
        if self._line is None:
            raise LineLostError("the port is closed")
        return self._line

    def _drop(self, problem: str) -> None:
        self._state = TriggerState.DISCONNECTED
        self._problem = problem
        self._armed = None
        self._reader.clear()
        if self._line is not None:
            self._line.close()
            self._line = None

    def _log(self, text: str, *, sent: bool) -> None:
        self._tape(WireLine(time.monotonic_ns(), sent, text))


def _report(capture_id: str, outcome: FireOutcome, why: str) -> FireReport:
    return FireReport(
        capture_id=capture_id,
        outcome=outcome,
        shots_done=1 if outcome is FireOutcome.FIRED else 0,
        shots_wanted=1,
        acknowledged=outcome is FireOutcome.NOT_FIRED,
        why=why,
    )


def _gone(problem: str) -> DeviceError:
    return DeviceError(
        "trigger-gone",
        f"the ESPER box cannot be reached: {problem}",
        "check its cable and power; the next order looks for it again",
    )


def _not_armed(capture_id: str) -> ConflictError:
    return ConflictError(
        "trigger-not-armed", f"capture {capture_id} is not armed any more", "arm a new capture"
    )
