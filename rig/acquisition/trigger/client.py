"""What can be asked of a Rigwright box, as typed questions and answers over a link."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from common.errors import DeviceError
from rig.acquisition.cameras.base import ClockSample
from rig.acquisition.trigger.edges import OutputEdge
from rig.acquisition.trigger.lines import ErrorCode, LineError
from rig.acquisition.trigger.link import Answer, NoAnswerError, RequestLink
from rig.acquisition.trigger.program import BoxLimits, Program
from rig.acquisition.trigger.protocol import TICK_NS, TIME_PAD, Event, Reply, instant_ticks


@dataclass(frozen=True)
class Identity:
    """``*IDN?``: which box this is."""

    text: str
    serial_number: str
    firmware: str


@dataclass(frozen=True)
class BoxStatus:
    """``STAT?``. ``capture`` is the one armed or last known."""

    state: str
    interlock_closed: bool
    capture: str | None
    last_event: int
    ticks: int
    host_ns: int


@dataclass(frozen=True)
class BoxResult:
    """``RES?``."""

    result: str
    shots_done: int
    shots_wanted: int
    start_ticks: int
    boot: int
    why: str = ""
    """Why it came to its end before its time; empty for a box that does not say."""


@dataclass(frozen=True)
class BoxStart:
    """``BOOT?``: how often it has been started, and what tells this start from all others.

    ``id`` is None for a box that has none.
    """

    count: int
    id: str | None


@dataclass(frozen=True)
class EdgeLog:
    """``EDGE?`` and ``SHOT?``, in ticks.

    ``edges``: those of a shot, each with its lateness in the last complete shot; ``shots``: each
    complete shot's start and largest lateness.
    """

    edges: tuple[tuple[OutputEdge, int], ...]
    shots: tuple[tuple[int, int], ...]


class RefusedError(Exception):
    """The box answered ``ERR``."""

    def __init__(self, command: str, reply: Reply) -> None:
        super().__init__(f"{command} was refused: {reply.code} {reply.word}")
        self.code = reply.code
        self.fields = reply.fields


class BoxClient:
    """Questions and orders to one box. Used by one thread.

    All raise :class:`NoAnswerError` and the line's error; :class:`RefusedError` when the box
    says no.
    """

    def __init__(self, link: RequestLink) -> None:
        self.link = link

    def identify(self, tries: int = 1) -> Identity:
        """Who it is; :class:`DeviceError` ``device/trigger-wrong`` for anything but our box."""
        text = self._ask("*IDN?", tries=tries).reply.fields.get("idn", "")
        words = text.split(",")
        if len(words) != 4 or words[:2] != ["Rigwright", "TriggerBox"]:
            raise DeviceError(
                "trigger-wrong",
                f"what answers calls itself {text or 'nothing'!r}, not a Rigwright trigger box",
                "check which port the box is on",
            )
        return Identity(text, words[2], words[3])

    def limits(self) -> BoxLimits:
        """What it can do."""
        fields = self._ask("CAP?").reply.fields
        try:
            safe: Mapping[str, str] | None = self._ask("SAFE?").reply.fields
        except RefusedError as refused:
            if refused.code != ErrorCode.COMMAND:
                raise
            safe = None  # firmware of before
        return BoxLimits.read(fields, safe)

    def start(self) -> BoxStart:
        """Which of its starts this is."""
        fields = self._ask("BOOT?").reply.fields
        return BoxStart(_whole(fields, "n"), fields.get("id"))

    def status(self) -> BoxStatus:
        """How it is."""
        answer = self._ask("STAT?")
        fields = answer.reply.fields
        capture = fields.get("cap", "-")
        return BoxStatus(
            state=fields.get("st", ""),
            interlock_closed=fields.get("il") == "CLOSED",
            capture=None if capture == "-" else capture,
            last_event=_whole(fields, "ev"),
            ticks=_instant(fields, "t"),
            host_ns=(answer.sent_ns + answer.received_ns) // 2,
        )

    def clock_sample(self) -> ClockSample:
        """One reading of its clock; asked once only, so that the answer belongs to the question."""
        answer = self._ask("TIME?", {"pad": TIME_PAD}, tries=1)
        received, began = _instant(answer.reply.fields, "rx"), _instant(answer.reply.fields, "tx")
        turnaround_ns = (began - received) * TICK_NS
        # Bounds for the middle of rx and tx: the question's end came before rx, the answer's
        # beginning left after tx.
        return ClockSample(
            answer.sent_ns + turnaround_ns // 2,
            (received + began) * TICK_NS // 2,
            answer.received_ns - turnaround_ns // 2,
        )

    def event(self, number: int) -> Event | None:
        """An event that was missed; None when the box does not have it any more."""
        try:
            fields = dict(self._ask("LOG?", {"n": str(number)}).reply.fields)
        except RefusedError:
            return None
        if fields.pop("ev", "") != str(number):
            return None
        return Event(number, fields.pop("name", ""), fields)

    def set_output(self, output: int, delay_ticks: int, width_ticks: int) -> None:
        """Delay and width of one output, in ticks."""
        self._ask("OUT", {"ch": str(output), "d": str(delay_ticks), "w": str(width_ticks)})

    def arm(self, program: Program) -> tuple[int, int]:
        """Arm; the number of edges and the duration that the box made of it."""
        fields = {
            "cap": program.capture_id,
            "mask": f"{program.mask:04X}",
            "n": str(program.shots),
            "iv": str(program.interval_ticks),
            "lead": str(program.lead),
            "ttl": str(program.ttl_ms),
        }
        if program.dead_man_ms is not None:
            fields["dm"] = str(program.dead_man_ms)
        said = self._ask("ARM", fields).reply.fields
        return _whole(said, "edges"), _whole(said, "dur")

    def fire_once(self, capture_id: str) -> None:
        """Send FIRE, one single time."""
        self._ask("FIRE", {"cap": capture_id}, tries=1)

    def disarm(self, capture_id: str) -> None:
        """Back to IDLE; nothing happens when nothing is armed any more."""
        try:
            self._ask("DISARM", {"cap": capture_id})
        except RefusedError as refused:
            if refused.code != ErrorCode.NOT_ARMED:
                raise

    def abort(self) -> str:
        """All outputs low; the state after."""
        return self._ask("ABORT").reply.fields.get("st", "")

    def reset(self) -> str:
        """``*RST``; the state after."""
        return self._ask("*RST").reply.fields.get("st", "")

    def result(self, capture_id: str) -> BoxResult | None:
        """What became of a capture; None when the box does not know it."""
        try:
            fields = self._ask("RES?", {"cap": capture_id}).reply.fields
        except RefusedError as refused:
            if refused.code != ErrorCode.UNKNOWN:
                raise
            # A question cut short on the way asks for another capture; twice is no accident.
            return self._result_again(capture_id)
        return _result(fields)

    def _result_again(self, capture_id: str) -> BoxResult | None:
        try:
            return _result(self._ask("RES?", {"cap": capture_id}).reply.fields)
        except RefusedError as refused:
            if refused.code != ErrorCode.UNKNOWN:
                raise
            return None

    def edge_log(self, capture_id: str, shots_done: int) -> EdgeLog:
        """All edges and shots of the last capture."""
        first, of = self._edge(capture_id, 0)
        edges = [first, *(self._edge(capture_id, i)[0] for i in range(1, of))]
        shots = [self._shot(capture_id, k) for k in range(1, shots_done + 1)]
        return EdgeLog(tuple(edges), tuple(shots))

    def _edge(self, capture_id: str, index: int) -> tuple[tuple[OutputEdge, int], int]:
        fields = self._indexed("EDGE?", capture_id, "i", index)
        try:
            pins = int(fields["pins"], 16)
        except (KeyError, ValueError):
            raise NoAnswerError("EDGE?") from None
        edge = OutputEdge(_whole(fields, "at"), pins)
        return (edge, _whole(fields, "late")), _whole(fields, "of")

    def _shot(self, capture_id: str, number: int) -> tuple[int, int]:
        fields = self._indexed("SHOT?", capture_id, "k", number)
        return _instant(fields, "t0"), _whole(fields, "late")

    def _indexed(self, command: str, capture_id: str, key: str, index: int) -> Mapping[str, str]:
        """Ask for one of a list, again where a question cut short asked for another one."""
        for _ in range(3):
            fields = self._ask(command, {"cap": capture_id, key: str(index)}).reply.fields
            if fields.get(key) == str(index):
                return fields
        raise NoAnswerError(command)

    def _ask(self, command: str, fields: Mapping[str, str] | None = None, tries: int = 3) -> Answer:
        answer = self.link.exchange(command, fields, tries)
        if not answer.reply.ok:
            raise RefusedError(command, answer.reply)
        return answer


def _result(fields: Mapping[str, str]) -> BoxResult:
    return BoxResult(
        result=fields.get("res", ""),
        shots_done=_whole(fields, "shots"),
        shots_wanted=_whole(fields, "of"),
        start_ticks=_instant(fields, "t0"),
        boot=_whole(fields, "boot"),
        why=fields.get("why", ""),
    )


def _whole(fields: Mapping[str, str], key: str) -> int:
    """A number the box must give; a box that does not is taken for one that does not answer."""
    text = fields.get(key, "")
    if not (text.isascii() and text.isdigit()):
        raise NoAnswerError(f"no {key}")
    return int(text)


def _instant(fields: Mapping[str, str], key: str) -> int:
    try:
        return instant_ticks(fields.get(key, ""))
    except LineError:
        raise NoAnswerError(f"no {key}") from None
