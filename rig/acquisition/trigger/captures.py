"""Arms, fires and finds out: a capture's way through a box that may be lost at any moment.

Runs on the thread that owns the port. The one rule: FIRE is never repeated before the box has
said that it did not hear the last one, and nothing is called fired or not fired that the box has
not said.
"""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from collections.abc import Callable

from common.errors import ConflictError, DeviceError, InterlockError, RigwrightError
from rig.acquisition.trigger.box import Outcome, TriggerState
from rig.acquisition.trigger.flight import Flight, full_report, plain_report
from rig.acquisition.trigger.keeper import Keeper
from rig.acquisition.trigger.lines import ErrorCode
from rig.acquisition.trigger.link import NoAnswerError
from rig.acquisition.trigger.program import Program
from rig.acquisition.trigger.protocol import TICK_NS
from rig.acquisition.trigger.talk import BoxResult, EdgeLog, RefusedError

SAMPLES_AROUND = 4
"""Readings of the clock after ARM and again after the last edge, so that no edge lies outside."""
FIRE_ROUNDS = 3
_KEPT = 64
_AGAIN_S = 0.05
_END_MARGIN_S = 0.02
_ENDINGS = frozenset({"FIRED", "ABORTED", "EXPIRED", "DISARMED", "FAULT"})


class Captures:
    """The captures of one box. ``aborting`` says whether somebody waits to stop everything."""

    def __init__(self, keeper: Keeper, aborting: Callable[[], bool]) -> None:
        self._keeper = keeper
        self._aborting = aborting
        self._flights: OrderedDict[str, Flight] = OrderedDict()
        self._current: Flight | None = None
        self._resolve_ns: int | None = None
        self.resolved = threading.Condition()
        """Notified when a flight has got its report."""

    def find(self, capture_id: str) -> Flight | None:
        """A capture of this driver's; from any thread."""
        return self._flights.get(capture_id)

    @property
    def resolve_due_ns(self) -> int | None:
        """When the box should be asked what became of the capture in flight."""
        return self._resolve_ns

    @property
    def current(self) -> Flight | None:
        """The capture in flight."""
        flight = self._current
        return flight if flight is not None and flight.open else None

    # -- orders ------------------------------------------------------------------------------

    def arm(self, program: Program, abandoned: Callable[[], bool]) -> None:
        """Set the outputs and arm.

        ``abandoned``: whether who asked waits no more. The order may be under way still then, and
        even succeed: nobody would fire or disarm it.
        """
        self._require_free()
        self._keeper.check_boot()
        self._keeper.set_outputs(program)
        flight = Flight(program, self._keeper.view.boots)
        self._remember(flight)
        if abandoned():
            # Only ever lowered: who gives up between the question and this line is not overruled.
            flight.wanted = False
        try:
            made = self._keeper.talk.arm(program)
        except RefusedError as refused:
            self._flights.pop(flight.id)
            self._current = None
            raise self._say(refused) from refused
        except BaseException:
            # It may be armed or not; whoever asked is told that it is not.
            flight.wanted = False
            raise
        if made != (len(program.edges), program.duration):
            self._refuse_program(flight)
        self._keeper.view.state = TriggerState.ARMED
        self._keeper.view.armed = flight.id
        for _ in range(SAMPLES_AROUND):
            self._keeper.sample()
        flight.fit = self._keeper.fit()

    def give_up(self, capture_id: str) -> None:
        """Who asked to arm it waits no more; from any thread."""
        flight = self._flights.get(capture_id)
        if flight is not None and not flight.fire_sent:
            flight.wanted = False

    def clear_up(self, capture_id: str) -> None:
        """Disarm what was armed for somebody who had given up."""
        flight = self._flights.get(capture_id)
        if flight is not None and flight.open and self._stale(flight):
            self._resolve(flight)

    def fire(self, capture_id: str) -> None:
        """Fire once, whatever is lost on the way."""
        flight = self._flights.get(capture_id)
        if flight is None or not flight.open or not flight.wanted or flight.fire_sent:
            raise _not_armed(capture_id, flight)
        for _ in range(FIRE_ROUNDS):
            if self._aborting():
                self._resolve(flight)
                raise ConflictError(
                    "trigger-aborted", f"capture {capture_id} was aborted", "arm a new capture"
                )
            if self._fire_heard(flight):
                self._expect_end(flight)
                return
        # It says that it has heard none of them: make sure that it never hears one late.
        self._resolve(flight)
        if flight.result is None or flight.result.result != "NOT_FIRED":
            return
        raise DeviceError(
            "trigger-gone",
            f"FIRE for {capture_id} did not reach the box; it was disarmed, nothing was fired",
            "check cable and adapter, then take the capture again",
        )

    def _fire_heard(self, flight: Flight) -> bool:
        """One FIRE, and whether the box has heard it."""
        flight.fire_sent = True
        try:
            self._keeper.talk.fire_once(flight.id)
        except NoAnswerError:
            how = "the acknowledgement was lost; the box was asked"
        except RefusedError as refused:
            how = f"{refused}; the box was asked"
        else:
            return True
        result = self._keeper.talk.result(flight.id)
        if result is not None and result.result == "ARMED":
            return False
        flight.notes.append(how)
        if result is None or result.result == "NOT_FIRED":
            self._conclude(flight, result)
            raise self._why_not(flight)
        return True

    def disarm(self, capture_id: str) -> None:
        """Leave ARMED without a pulse."""
        flight = self._flights.get(capture_id)
        if flight is None or not flight.open:
            return
        try:
            self._keeper.talk.disarm(capture_id)
        except RefusedError as refused:
            raise self._say(refused) from refused
        finally:
            flight.wanted = False
            self._resolve_ns = 0
        self._resolve(flight)

    def abort(self) -> None:
        """All outputs low."""
        self._keeper.talk.abort()
        self._resolve_ns = 0
        self._keeper.look()

    def reset(self) -> None:
        """Clear a fault whose cause is gone."""
        self._keeper.forget_outputs()
        state = self._keeper.talk.reset()
        self._resolve_ns = 0
        self._keeper.look()
        if state == "FAULT":
            raise InterlockError(
                "open", "the interlock is still open", "close it, then reset the box again"
            )

    def result_of_stranger(self, capture_id: str) -> BoxResult | None:
        """What the box knows of a capture that this driver has not armed."""
        return self._keeper.talk.result(capture_id)

    # -- finding out -------------------------------------------------------------------------

    def met(self) -> None:
        """The box has been met, for the first time or again: see what became of everything."""
        self._resolve_ns = 0
        view = self._keeper.view
        if view.armed is not None and self._wanted(view.armed) is None:
            # Armed by somebody before us: nobody is there to fire or to disarm it.
            self._keeper.talk.disarm(view.armed)
            self._keeper.look()

    def _wanted(self, capture_id: str) -> Flight | None:
        flight = self._flights.get(capture_id)
        return flight if flight is not None and flight.open else None

    def hear(self) -> None:
        """Look at the events that have come."""
        while self._keeper.heard:
            event = self._keeper.heard.popleft()
            flight = self._current
            if flight is None or event.fields.get("cap") != flight.id:
                continue
            if event.name in _ENDINGS:
                self._resolve_ns = 0

    def resolve(self) -> None:
        """Ask what became of the capture in flight, if there is one."""
        flight = self.current
        if flight is None:
            self._resolve_ns = None
        else:
            self._resolve(flight)

    def _resolve(self, flight: Flight) -> None:
        result = self._keeper.talk.result(flight.id)
        if result is not None and result.result == "ARMED" and self._stale(flight):
            self._keeper.talk.disarm(flight.id)
            result = self._keeper.talk.result(flight.id)
        if result is None or result.result in ("FIRED", "PARTIAL", "NOT_FIRED"):
            self._conclude(flight, result)
        elif result.result == "ARMED":
            self._resolve_ns = None
        else:
            self._keeper.view.state = TriggerState.FIRING
            wait_s = max(_AGAIN_S, ((flight.ends_ns or 0) - time.monotonic_ns()) / 1e9)
            self._resolve_ns = time.monotonic_ns() + int(wait_s * 1e9)

    def _stale(self, flight: Flight) -> bool:
        """Armed, but nobody will fire it any more: FIRE was given up, or ARM was."""
        return flight.fire_sent or not flight.wanted

    def _conclude(self, flight: Flight, result: BoxResult | None) -> None:
        flight.result = result
        if result is None:
            outcome = Outcome.UNKNOWN if flight.fire_sent else Outcome.NOT_FIRED
            report = plain_report(flight, outcome, "the box does not remember this capture")
        else:
            log = self._edge_log(flight, result)
            for _ in range(SAMPLES_AROUND):
                self._keeper.sample()
            if result.boot == self._keeper.view.boots:
                flight.fit = self._keeper.fit() or flight.fit
            report = full_report(flight, result, log)
        self._keeper.look()
        self._resolve_ns = None
        with self.resolved:
            flight.report = report
            self.resolved.notify_all()

    def _edge_log(self, flight: Flight, result: BoxResult) -> EdgeLog | None:
        if result.shots_done == 0:
            return None
        try:
            return self._keeper.talk.edge_log(flight.id, result.shots_done)
        except RefusedError:
            return None

    # -- particulars -------------------------------------------------------------------------

    def _remember(self, flight: Flight) -> None:
        self._flights[flight.id] = flight
        self._current = flight
        while len(self._flights) > _KEPT:
            self._flights.popitem(last=False)

    def _require_free(self) -> None:
        flight = self.current
        if flight is not None and self._stale(flight):
            self._resolve(flight)
            flight = self.current
        if flight is not None:
            doing = "firing" if flight.fire_sent else "armed"
            raise ConflictError(
                f"trigger-{doing}",
                f"the box is {doing} for capture {flight.id}",
                "wait until it is done, or abort it",
            )

    def _expect_end(self, flight: Flight) -> None:
        now = time.monotonic_ns()
        flight.ends_ns = now + flight.program.total * TICK_NS + int(_END_MARGIN_S * 1e9)
        self._resolve_ns = flight.ends_ns
        self._keeper.view.state = TriggerState.FIRING
        self._keeper.view.armed = None

    def _refuse_program(self, flight: Flight) -> None:
        """The box lost its outputs between setting and arming: it must not fire like this."""
        flight.wanted = False
        self._keeper.forget_outputs()
        self._resolve(flight)
        raise DeviceError(
            "trigger-program",
            "the box armed other pulses than were asked for, and was disarmed",
            "take the capture again",
        )

    def _why_not(self, flight: Flight) -> RigwrightError:
        if self._keeper.view.interlock_closed is False:
            return _interlock()
        if flight.result is None:
            return DeviceError(
                "trigger-gone",
                f"the box has forgotten capture {flight.id}",
                "see to its power supply, then take the capture again",
            )
        return _not_armed(flight.id, flight)

    def _say(self, refused: RefusedError) -> RigwrightError:
        """The error of the interface for a refusal."""
        if refused.code == ErrorCode.INTERLOCK or (
            refused.code == ErrorCode.FAULT and self._keeper.view.interlock_closed is False
        ):
            return _interlock()
        if refused.code == ErrorCode.FAULT:
            return ConflictError(
                "trigger-fault",
                f"the box has stopped for safety ({refused.fields.get('why', 'no reason given')})",
                "remove the cause, then reset the box",
            )
        return ConflictError(
            "trigger-refused", f"the box does not do it: {refused}", "abort, then try again"
        )


def _interlock() -> InterlockError:
    return InterlockError(
        "open", "the interlock of the trigger box is open", "close it, then reset the box"
    )


def _not_armed(capture_id: str, flight: Flight | None) -> ConflictError:
    became = "is not armed"
    if flight is not None and flight.result is not None:
        became = f"is over ({flight.result.result})"
    elif flight is not None and flight.fire_sent:
        became = "has been fired"
    return ConflictError("trigger-not-armed", f"capture {capture_id} {became}", "arm a new capture")
