"""The driver of a Rigwright trigger box on a serial line."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from concurrent.futures import CancelledError as FutureCancelledError
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from common.errors import DeviceError
from rig.acquisition.trigger.armed import known_report, stranger_report
from rig.acquisition.trigger.box import ArmRequest, FireReport, TriggerCapabilities, TriggerHealth
from rig.acquisition.trigger.captures import Captures
from rig.acquisition.trigger.clock import ClockModel
from rig.acquisition.trigger.connection import BoxView, Connection
from rig.acquisition.trigger.jobs import PATIENCE_S, JobQueue
from rig.acquisition.trigger.metrics import Metrics, WireLog, WireTape
from rig.acquisition.trigger.owner import PROBE_S, PortOwner
from rig.acquisition.trigger.program import compile_program
from rig.acquisition.trigger.serialline import SerialLine, bare_url, is_device_path

BAUD = 115_200
_TIME_LINE = 46
"""Characters of a ``TIME?`` and of its answer."""


@dataclass(frozen=True)
class BoxAddress:
    """Where a box is and which one it should be.

    ``url``: anything pyserial opens; a stable path such as ``/dev/serial/by-id/...`` finds the
    same box again after replugging. ``serial_number`` empty: whichever answers first, and from
    then on only that one. ``wire_baud``: the rate of the wire, for the clock's uncertainty; None
    to take it from ``baud`` for a serial port and to leave it unknown for all else.
    """

    url: str
    serial_number: str = ""
    baud: int = BAUD
    wire_baud: int | None = None

    def wire_ns(self) -> float:
        """How long a clock question is on the wire; 0 where that is not known."""
        baud = self.wire_baud
        if baud is None and is_device_path(self.url):
            real = os.path.realpath(bare_url(self.url))
            baud = 0 if real.startswith("/dev/pts/") else self.baud
        return _TIME_LINE * 10 * 1e9 / baud if baud else 0.0


class SerialTriggerBox:
    """A :class:`~rig.acquisition.trigger.box.TriggerBox` that speaks the protocol of this project.

    ``wire_log`` hears every line sent and received. See ``docs/explanation/trigger.md`` for what it
    does on each fault.
    """

    def __init__(self, address: BoxAddress, wire_log: WireLog | None = None) -> None:
        self.address = address
        self._metrics = Metrics()
        self._tape = WireTape(wire_log)
        self._connection = Connection(address.serial_number, self._metrics, self._tape)
        self._connection.clock = ClockModel(address.wire_ns())
        self._queue: JobQueue | None = None
        self._captures = Captures(self._connection, self._aborting)
        self._owner: PortOwner | None = None
        self._listeners: list[Callable[[FireReport], None]] = []
        self._lock = threading.Lock()
        self._armed_ns: dict[str, int] = {}

    @property
    def capabilities(self) -> TriggerCapabilities:
        """What this box can do; :class:`DeviceError` before it has been opened."""
        limits = self._connection.view.limits
        if limits is None:
            raise _closed()
        return limits.capabilities()

    def open(self) -> None:
        """Connect and probe; opening twice changes nothing.

        Raises :class:`~common.errors.DeviceError` ``device/trigger-gone``,
        ``device/trigger-busy`` or ``device/trigger-wrong``. Takes up to 8 s, for a box that is
        reset by the opening of its port.
        """
        with self._lock:
            if self._owner is not None:
                return
            self._queue = queue = JobQueue()
            owner = PortOwner(
                self._connection, self._captures, queue, lambda: self._open_line(queue)
            )
            self._owner = owner
        owner.start()
        try:
            owner.opened.result(PROBE_S + 4.0)
        except TimeoutError:
            self.close()
            raise _late(self._connection.view) from None
        except BaseException:
            self.close()
            raise

    def _open_line(self, queue: JobQueue) -> SerialLine:
        return SerialLine(self.address.url, self.address.baud, queue.handle)

    def _aborting(self) -> bool:
        queue = self._queue
        return queue is not None and queue.urgent

    def close(self) -> None:
        """Disarm if armed, and let go of the port. Closing twice changes nothing."""
        capture = self._captures.current
        if capture is not None and not capture.fire_sent:
            # A box that is gone disarms itself after 3 s without us.
            with suppress(DeviceError):
                self.disarm(capture.id)
        with self._lock:
            owner, self._owner = self._owner, None
        if owner is None:
            return
        owner.stop()

    def health(self) -> TriggerHealth:
        """The present state; asks nothing of the box and never raises."""
        view = self._connection.view
        identity = view.identity
        median, p99 = self._metrics.percentiles_ms()
        return TriggerHealth(
            state=view.state,
            identity=identity.text if identity else "",
            serial_number=identity.serial_number if identity else "",
            firmware=identity.firmware if identity else "",
            boots=view.boots,
            interlock_closed=view.interlock_closed,
            armed_capture=view.armed,
            clock_residual_us=view.residual_us,
            round_trip_p50_ms=median,
            round_trip_p99_ms=p99,
            counters=self._metrics.counts(),
            last_problem=view.problem,
        )

    def arm(self, request: ArmRequest) -> None:
        """Load the pulses and arm. The box is ARMED when this returns."""
        limits = self._connection.view.limits
        if limits is None:
            raise _closed()
        program = compile_program(request, limits)
        self._armed_ns = {request.capture_id: time.monotonic_ns()}
        abandoned = threading.Event()
        try:
            self._order(lambda: self._captures.arm(program, abandoned.is_set))
        except DeviceError:
            # In this order: the capture that is not there yet will see the event.
            abandoned.set()
            self._captures.give_up(request.capture_id)
            if self._queue is not None:
                self._queue.put(lambda: self._captures.clear_up(request.capture_id))
            raise

    def fire(self, capture_id: str) -> None:
        """Fire the armed capture, at most once for ever.

        When the box is lost on the way this raises, and :meth:`wait_done` says what it did.
        """
        try:
            self._order(lambda: self._captures.fire(capture_id))
        except DeviceError:
            capture = self._captures.find(capture_id)
            if capture is not None and not capture.fire_sent:
                capture.wanted = False
            raise

    def wait_done(self, capture_id: str, timeout_s: float) -> FireReport:
        """What became of a capture, when its last edge is made, or the box lost and resolved.

        A capture that this driver has not armed is asked for at the box: after a crash of the
        program that armed it, for example.
        """
        capture = self._captures.find(capture_id)
        if capture is None:
            report = self._stranger(capture_id)
        else:
            with self._captures.resolved:
                self._captures.resolved.wait_for(lambda: not capture.open, timeout_s)
            report = capture.report or known_report(capture, self._connection.view.problem)
        if capture_id in self._armed_ns:
            report = replace(report, wire=self._tape.since(self._armed_ns[capture_id]))
        for listener in list(self._listeners):
            listener(report)
        return report

    def _stranger(self, capture_id: str) -> FireReport:
        try:
            result = self._order(lambda: self._captures.result_of_stranger(capture_id))
        except DeviceError as error:
            return stranger_report(capture_id, None, str(error))
        return stranger_report(capture_id, result, "not armed by this driver; the box was asked")

    def disarm(self, capture_id: str) -> None:
        """Leave ARMED without a pulse. Nothing happens when it is not armed any more."""
        capture = self._captures.find(capture_id)
        if capture is None or not capture.open:
            return
        try:
            self._order(lambda: self._captures.disarm(capture_id))
        except DeviceError:
            capture.wanted = False
            raise

    def abort(self) -> None:
        """All outputs low, now; allowed in every state."""
        self._order(self._captures.abort, urgent=True)

    def reset(self) -> None:
        """Leave FAULT when its cause is gone, with all outputs low and unconfigured.

        Raises :class:`~common.errors.InterlockError` while the interlock is open.
        """
        self._order(self._captures.reset)

    def subscribe(self, listener: Callable[[FireReport], None]) -> Callable[[], None]:
        """Hear every report that :meth:`wait_done` resolves, before it returns."""
        self._listeners.append(listener)

        def end() -> None:
            if listener in self._listeners:
                self._listeners.remove(listener)

        return end

    def _order(self, work: Callable[[], Any], urgent: bool = False) -> Any:  # noqa: ANN401
        queue = self._queue
        if self._owner is None or queue is None:
            raise _closed()
        job = queue.put(work, urgent)
        try:
            return job.future.result(PATIENCE_S)
        except TimeoutError:
            job.future.cancel()
            raise _late(self._connection.view) from None
        except FutureCancelledError:
            raise _closed() from None


def _late(view: BoxView) -> DeviceError:
    problem = view.problem or f"it is {view.state.value}"
    return DeviceError(
        "trigger-gone",
        f"the trigger box did not answer in time ({problem})",
        "check its cable and power; it is looked for again by itself",
    )


def _closed() -> DeviceError:
    return DeviceError("trigger-gone", "the trigger box is not open", "open it first")
