"""Arms, fires and finds out: a capture's way through a box that may be lost at any moment.

Runs on the thread that owns the port. The one rule: FIRE is never repeated before the box has
said that it did not hear the last one, and nothing is called fired or not fired that the box has
not said.
"""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping

from common.errors import ConflictError, DeviceError, InterlockError, RigwrightError
from rig.acquisition.trigger.armed import STOPPED, ArmedCapture, full_report, plain_report
from rig.acquisition.trigger.box import FireOutcome, TriggerState
from rig.acquisition.trigger.client import BoxResult, EdgeLog, RefusedError
from rig.acquisition.trigger.connection import HEARTBEAT_S, Connection
from rig.acquisition.trigger.lines import ErrorCode
from rig.acquisition.trigger.link import NoAnswerError
from rig.acquisition.trigger.program import Program
from rig.acquisition.trigger.protocol import TICK_NS

SAMPLES_AROUND = 4
"""Readings of the clock after ARM and again after the last edge, so that no edge lies outside."""
FIRE_ROUNDS = 3
ARM_ROUNDS = 3
FEEDS = 6
"""Signs of life in a dead man's time: a few may be lost, or late on a busy computer."""
LONGEST_REST_S = 0.5
_KEPT = 64
_AGAIN_S = 0.05
_END_MARGIN_S = 0.02
_OUTPUTS_DIFFER = frozenset({ErrorCode.NOTHING, ErrorCode.EDGES, ErrorCode.RANGE})
"""Refusals of a programme that was checked here: the box has other outputs than it was given."""
_ENDINGS = frozenset({"FIRED", "ABORTED", "EXPIRED", "DISARMED", "FAULT"})


RESET = "reset the box (rigwright trigger reset --station STATION.toml)"
"""How, for whoever reads the message; a service that has the station is asked by that command."""

_REMEDIES: Mapping[int, str] = {
    ErrorCode.BUSY: "wait until it is done, or abort it",
    ErrorCode.ARMED: "abort, then try again",
    ErrorCode.CAPTURE: "abort, then try again",
    ErrorCode.USED: "take the capture again under another id",
    ErrorCode.REST: "wait a second, then try again",
}


class Captures:
    """The captures of one box. ``aborting`` says whether somebody waits to stop everything."""

    def __init__(self, connection: Connection, aborting: Callable[[], bool]) -> None:
        self._connection = connection
        self._aborting = aborting
        self._captures: OrderedDict[str, ArmedCapture] = OrderedDict()
        self._current: ArmedCapture | None = None
        self._resolve_ns: int | None = None
        self.resolved = threading.Condition()
        """Notified when a capture has got its report."""

    def find(self, capture_id: str) -> ArmedCapture | None:
        """A capture of this driver's; from any thread."""
        return self._captures.get(capture_id)

    @property
    def resolve_due_ns(self) -> int | None:
        """When the box should be asked what became of the open capture."""
        return self._resolve_ns

    @property
    def current(self) -> ArmedCapture | None:
        """The capture that is armed or fired and has no report yet."""
        capture = self._current
        return capture if capture is not None and capture.open else None

    # -- orders ------------------------------------------------------------------------------

    def arm(self, program: Program, abandoned: Callable[[], bool]) -> None:
        """Set the outputs and arm.

        ``abandoned``: whether who asked waits no more. The order may be under way still then, and
        even succeed: nobody would fire or disarm it.
        """
        self._require_free()
        self._connection.look()
        self._connection.check_boot()
        self._connection.set_outputs(program)
        capture = ArmedCapture(program, self._connection.view.boots)
        self._remember(capture)
        if abandoned():
            # Only ever lowered: who gives up between the question and this line is not overruled.
            capture.wanted = False
        try:
            made = self._arm_at_box(program)
        except RefusedError as refused:
            self._captures.pop(capture.id)
            self._current = None
            raise self._say(refused) from refused
        except BaseException:
            # It may be armed or not; whoever asked is told that it is not.
            capture.wanted = False
            raise
        if made != (len(program.edges), program.duration):
            self._refuse_program(capture)
        if program.dead_man_ms:
            self._connection.feed_s = program.dead_man_ms / 1000.0 / FEEDS
        self._connection.view.state = TriggerState.ARMED
        self._connection.view.armed = capture.id
        for _ in range(SAMPLES_AROUND):
            self._connection.sample()
        capture.fit = self._connection.fit()

    def _arm_at_box(self, program: Program) -> tuple[int, int]:
        """Arm. What the box turns out not to know any more is sent again, and rests are kept."""
        for _ in range(ARM_ROUNDS - 1):
            try:
                return self._connection.client.arm(program)
            except RefusedError as refused:
                if refused.code == ErrorCode.REST:
                    time.sleep(min(int(refused.fields.get("ms", "0")) / 1000.0, LONGEST_REST_S))
                elif refused.code in _OUTPUTS_DIFFER:
                    self._connection.forget_outputs()
                    self._connection.set_outputs(program)
                else:
                    raise
        return self._connection.client.arm(program)

    def give_up(self, capture_id: str) -> None:
        """Who asked to arm it waits no more; from any thread."""
        capture = self._captures.get(capture_id)
        if capture is not None and not capture.fire_sent:
            capture.wanted = False

    def clear_up(self, capture_id: str) -> None:
        """Disarm what was armed for somebody who had given up."""
        capture = self._captures.get(capture_id)
        if capture is not None and capture.open and self._stale(capture):
            self._resolve(capture)

    def fire(self, capture_id: str) -> None:
        """Fire once, whatever is lost on the way."""
        capture = self._captures.get(capture_id)
        if capture is None or not capture.open or not capture.wanted or capture.fire_sent:
            raise _not_armed(capture_id, capture)
        for _ in range(FIRE_ROUNDS):
            if self._aborting():
                self._resolve(capture)
                raise ConflictError(
                    "trigger-aborted", f"capture {capture_id} was aborted", "arm a new capture"
                )
            if self._fire_heard(capture):
                self._expect_end(capture)
                return
        # It says that it has heard none of them: make sure that it never hears one late.
        self._resolve(capture)
        if capture.result is None or capture.result.result != "NOT_FIRED":
            return
        raise DeviceError(
            "trigger-gone",
            f"FIRE for {capture_id} did not reach the box; it was disarmed, nothing was fired",
            "check cable and adapter, then take the capture again",
        )

    def _fire_heard(self, capture: ArmedCapture) -> bool:
        """One FIRE, and whether the box has heard it."""
        capture.fire_sent = True
        try:
            self._connection.client.fire_once(capture.id)
        except NoAnswerError:
            how = "the acknowledgement was lost; the box was asked"
        except RefusedError as refused:
            how = f"{refused}; the box was asked"
        else:
            return True
        result = self._connection.client.result(capture.id)
        if result is not None and result.result == "ARMED":
            return False
        capture.notes.append(how)
        if result is None or result.result == "NOT_FIRED":
            self._conclude(capture, result)
            raise self._why_not(capture)
        return True

    def disarm(self, capture_id: str) -> None:
        """Leave ARMED without a pulse."""
        capture = self._captures.get(capture_id)
        if capture is None or not capture.open:
            return
        try:
            self._connection.client.disarm(capture_id)
        except RefusedError as refused:
            raise self._say(refused) from refused
        finally:
            capture.wanted = False
            self._resolve_ns = 0
        self._resolve(capture)

    def abort(self) -> None:
        """All outputs low; whatever was believed of the box is forgotten."""
        self._connection.forget_outputs()
        self._connection.client.abort()
        self._resolve_ns = 0
        self._connection.look()

    def reset(self) -> None:
        """Clear a fault whose cause is gone."""
        self._connection.forget_outputs()
        state = self._connection.client.reset()
        self._resolve_ns = 0
        self._connection.look()
        if state == "FAULT":
            raise InterlockError(
                "open", "the interlock is still open", "close it, then reset the box again"
            )

    def result_of_stranger(self, capture_id: str) -> BoxResult | None:
        """What the box knows of a capture that this driver has not armed."""
        return self._connection.client.result(capture_id)

    # -- finding out -------------------------------------------------------------------------

    def met(self) -> None:
        """The box has been met, for the first time or again: see what became of everything."""
        self._resolve_ns = 0
        view = self._connection.view
        if view.armed is not None and self._wanted(view.armed) is None:
            # Armed by somebody before us: nobody is there to fire or to disarm it.
            self._connection.client.disarm(view.armed)
            self._connection.look()
        self._see_what_was_left()

    def _see_what_was_left(self) -> None:
        """Say what became of a burst whose host was another program, or this one before."""
        last = self._connection.last_capture
        if last is None or last in self._captures:
            return
        result = self._connection.client.result(last)
        if result is not None and result.result == "PARTIAL":
            why = STOPPED.get(result.why, "it was stopped")
            self._connection.view.problem = (
                f"capture {last}, armed by another program, ended after {result.shots_done} of "
                f"{result.shots_wanted} shots: {why}"
            )

    def _wanted(self, capture_id: str) -> ArmedCapture | None:
        capture = self._captures.get(capture_id)
        return capture if capture is not None and capture.open else None

    def hear(self) -> None:
        """Look at the events that have come."""
        while self._connection.heard:
            event = self._connection.heard.popleft()
            capture = self._current
            if capture is None or event.fields.get("cap") != capture.id:
                continue
            if event.name in _ENDINGS:
                self._resolve_ns = 0

    def resolve(self) -> None:
        """Ask what became of the open capture, if there is one."""
        capture = self.current
        if capture is None:
            self._resolve_ns = None
        else:
            self._resolve(capture)

    def _resolve(self, capture: ArmedCapture) -> None:
        result = self._connection.client.result(capture.id)
        if result is not None and result.result == "ARMED" and self._stale(capture):
            self._connection.client.disarm(capture.id)
            result = self._connection.client.result(capture.id)
        if result is None or result.result in ("FIRED", "PARTIAL", "NOT_FIRED"):
            self._conclude(capture, result)
        elif result.result == "ARMED":
            self._resolve_ns = None
        else:
            self._connection.view.state = TriggerState.FIRING
            wait_s = max(_AGAIN_S, ((capture.ends_ns or 0) - time.monotonic_ns()) / 1e9)
            self._resolve_ns = time.monotonic_ns() + int(wait_s * 1e9)

    def _stale(self, capture: ArmedCapture) -> bool:
        """Armed, but nobody will fire it any more: FIRE was given up, or ARM was."""
        return capture.fire_sent or not capture.wanted

    def _conclude(self, capture: ArmedCapture, result: BoxResult | None) -> None:
        capture.result = result
        if result is None:
            outcome = FireOutcome.UNKNOWN if capture.fire_sent else FireOutcome.NOT_FIRED
            report = plain_report(capture, outcome, "the box does not remember this capture")
        else:
            log = self._edge_log(capture, result)
            for _ in range(SAMPLES_AROUND):
                self._connection.sample()
            if result.boot == self._connection.view.boots:
                capture.fit = self._connection.fit() or capture.fit
            report = full_report(capture, result, log)
        self._connection.feed_s = HEARTBEAT_S
        self._connection.look()
        self._resolve_ns = None
        with self.resolved:
            capture.report = report
            self.resolved.notify_all()

    def _edge_log(self, capture: ArmedCapture, result: BoxResult) -> EdgeLog | None:
        if result.shots_done == 0:
            return None
        try:
            return self._connection.client.edge_log(capture.id, result.shots_done)
        except RefusedError:
            return None

    # -- particulars -------------------------------------------------------------------------

    def _remember(self, capture: ArmedCapture) -> None:
        self._captures[capture.id] = capture
        self._current = capture
        while len(self._captures) > _KEPT:
            self._captures.popitem(last=False)

    def _require_free(self) -> None:
        capture = self.current
        if capture is not None and self._stale(capture):
            self._resolve(capture)
            capture = self.current
        if capture is not None:
            doing = "firing" if capture.fire_sent else "armed"
            raise ConflictError(
                f"trigger-{doing}",
                f"the box is {doing} for capture {capture.id}",
                "wait until it is done, or abort it",
            )

    def _expect_end(self, capture: ArmedCapture) -> None:
        now = time.monotonic_ns()
        capture.ends_ns = now + capture.program.total * TICK_NS + int(_END_MARGIN_S * 1e9)
        self._resolve_ns = capture.ends_ns
        self._connection.status_due_ns = 0  # from now on the box stops when it hears nothing
        self._connection.view.state = TriggerState.FIRING
        self._connection.view.armed = None

    def _refuse_program(self, capture: ArmedCapture) -> None:
        """The box lost its outputs between setting and arming: it must not fire like this."""
        capture.wanted = False
        self._connection.forget_outputs()
        self._resolve(capture)
        raise DeviceError(
            "trigger-program",
            "the box armed other pulses than were asked for, and was disarmed",
            "take the capture again",
        )

    def _why_not(self, capture: ArmedCapture) -> RigwrightError:
        if self._connection.view.interlock_closed is False:
            return _interlock()
        if capture.result is None:
            return DeviceError(
                "trigger-gone",
                f"the box has forgotten capture {capture.id}",
                "see to its power supply, then take the capture again",
            )
        return _not_armed(capture.id, capture)

    def _say(self, refused: RefusedError) -> RigwrightError:
        """The error of the interface for a refusal."""
        if refused.code == ErrorCode.INTERLOCK or (
            refused.code == ErrorCode.FAULT and self._connection.view.interlock_closed is False
        ):
            return _interlock()
        if refused.code == ErrorCode.FAULT:
            return ConflictError(
                "trigger-fault",
                f"the box has stopped for safety ({refused.fields.get('why', 'no reason given')})",
                f"remove the cause, then {RESET}",
            )
        remedy = _REMEDIES.get(refused.code, f"{RESET}, then try again")
        return ConflictError("trigger-refused", f"the box does not do it: {refused}", remedy)


def _interlock() -> InterlockError:
    return InterlockError(
        "open", "the interlock of the trigger box is open", f"close it, then {RESET}"
    )


def _not_armed(capture_id: str, capture: ArmedCapture | None) -> ConflictError:
    became = "is not armed"
    if capture is not None and capture.result is not None:
        became = f"is over ({capture.result.result})"
    elif capture is not None and capture.fire_sent:
        became = "has been fired"
    return ConflictError("trigger-not-armed", f"capture {capture_id} {became}", "arm a new capture")
