"""One capture from ARM to its report, and the report made from what the box says."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from rig.acquisition.trigger.box import Edge, FireOutcome, FireReport
from rig.acquisition.trigger.client import BoxResult, EdgeLog
from rig.acquisition.trigger.clock import ClockFit
from rig.acquisition.trigger.edges import OUTPUTS
from rig.acquisition.trigger.program import Program
from rig.acquisition.trigger.protocol import TICK_NS

STOPPED = {
    "ttl": "nobody fired it in time",
    "silence": "the box heard nothing of its host for too long and stopped by itself",
    "interlock": "the interlock opened",
    "overtime": "an output stayed on for too long",
    "disarm": "it was disarmed",
    "abort": "it was aborted",
    "reset": "the box was started anew",
}
"""What the box says of an end before its time, in words."""

OUTCOMES = {
    "FIRED": FireOutcome.FIRED,
    "PARTIAL": FireOutcome.PARTIAL,
    "NOT_FIRED": FireOutcome.NOT_FIRED,
}


@dataclass
class ArmedCapture:
    """A capture from ARM to its report; written by the thread that owns the port.

    ``wanted`` falls when who asked has given up before it was fired: it is disarmed then.
    """

    program: Program
    boot: int | None
    wanted: bool = True
    fire_sent: bool = False
    ends_ns: int | None = None
    """When its last edge must have been made, on the host's clock."""
    result: BoxResult | None = None
    """What the box says, once it is final."""
    fit: ClockFit | None = None
    """The clock of the start under which it was armed."""
    notes: list[str] = field(default_factory=list)
    """What ``why`` of the report will say."""
    report: FireReport | None = None

    @property
    def id(self) -> str:
        """The capture's."""
        return self.program.capture_id

    @property
    def open(self) -> bool:
        """Whether nobody knows yet what became of it."""
        return self.report is None


def plain_report(capture: ArmedCapture, outcome: FireOutcome, why: str) -> FireReport:
    """A report without an edge log."""
    done = capture.result.shots_done if capture.result is not None else 0
    return FireReport(
        capture_id=capture.id,
        outcome=outcome,
        shots_done=done,
        shots_wanted=capture.program.shots,
        acknowledged=capture.result is not None or not capture.fire_sent,
        why="; ".join([why, *capture.notes]),
    )


def full_report(capture: ArmedCapture, result: BoxResult, log: EdgeLog | None) -> FireReport:
    """The report of a capture whose result the box has given.

    Without ``log``, or without a clock for it, the edges are left out and ``why`` says so.
    """
    notes = list(capture.notes)
    edges: tuple[Edge, ...] = ()
    uncertainty_us = float("nan")
    if log is not None and capture.fit is not None:
        edges = tuple(host_edges(log, capture.fit))
        middle = result.start_ticks + capture.program.total // 2
        uncertainty_us = capture.fit.uncertainty_us(middle * TICK_NS)
        if tuple(edge for edge, _ in log.edges) != capture.program.edges:
            notes.append("the box's list of edges is not the one that was asked for")
    elif result.shots_done:
        notes.append("the edge log could not be had")
    if result.why:
        notes.append(STOPPED.get(result.why, result.why))
    return FireReport(
        capture_id=capture.id,
        outcome=OUTCOMES[result.result],
        shots_done=result.shots_done,
        shots_wanted=capture.program.shots,
        edges=edges,
        clock_uncertainty_us=uncertainty_us,
        why="; ".join(notes),
    )


def known_report(capture: ArmedCapture, problem: str) -> FireReport:
    """The best word on a capture whose report is not there in time."""
    if capture.result is not None:
        return full_report(capture, capture.result, None)
    if capture.fire_sent:
        return plain_report(capture, FireOutcome.UNKNOWN, problem or "the box has not answered yet")
    if capture.wanted:
        return plain_report(capture, FireOutcome.UNKNOWN, "it is armed still; FIRE was not given")
    return plain_report(capture, FireOutcome.NOT_FIRED, "FIRE was never sent")


def stranger_report(capture_id: str, result: BoxResult | None, why: str) -> FireReport:
    """The report of a capture that another process has armed."""
    known = result is not None
    if result is not None and result.why:
        why = f"{why}; {STOPPED.get(result.why, result.why)}"
    return FireReport(
        capture_id=capture_id,
        outcome=OUTCOMES.get(result.result, FireOutcome.UNKNOWN) if result else FireOutcome.UNKNOWN,
        shots_done=result.shots_done if result else 0,
        shots_wanted=result.shots_wanted if result else 0,
        acknowledged=known,
        why=why,
    )


def host_edges(log: EdgeLog, fit: ClockFit) -> Iterator[Edge]:
    """Every change of every output in the complete shots, on the host's clock.

    Each edge's own lateness is known for the last shot; for those before it, the shot's largest.
    """
    for number, (start, largest) in enumerate(log.shots, 1):
        pins = 0
        for edge, own in log.edges:
            late = own if number == len(log.shots) else largest
            at_host_ns = fit.host_ns((start + edge.at + late) * TICK_NS)
            for output in range(1, OUTPUTS + 1):
                bit = 1 << (output - 1)
                if (pins ^ edge.pins) & bit:
                    yield Edge(
                        shot=number,
                        output=output,
                        rising=bool(edge.pins & bit),
                        at_us=edge.at * TICK_NS / 1000.0,
                        at_host_ns=at_host_ns,
                        late_us=late * TICK_NS / 1000.0,
                    )
            pins = edge.pins
