"""What the fake box answers to each line."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

from rig.acquisition.trigger.edges import OUTPUTS, compile_edges, nearest
from rig.acquisition.trigger.fake.device import FIRMWARE, SILENCE_MS, TICKS_PER_MS, FakeBox
from rig.acquisition.trigger.fake.memory import Capture
from rig.acquisition.trigger.lines import ErrorCode, LineError, RawLine
from rig.acquisition.trigger.protocol import (
    CAPTURE_ID,
    SERIAL_NUMBER,
    ReceivedRequest,
    Reply,
    instant_text,
    parse_request,
)

MIN_LEAD = 2000
MIN_PAUSE = 2000
MAX_PAD = 60
NUMBERS = frozenset({"ch", "d", "dm", "i", "iv", "k", "lead", "n", "ttl", "w"})
"""Keys whose values are decimal numbers."""

Fields = Mapping[str, str]


class Refusal(Exception):  # noqa: N818 - the protocol's word
    """A request that the box does not do."""

    def __init__(self, code: ErrorCode, **fields: str) -> None:
        super().__init__(code.word)
        self.code = code
        self.fields = fields


def answer(box: FakeBox, line: RawLine, received_ticks: int) -> bytes:
    """The reply to one line, and the doing of what it asks.

    ``received_ticks`` is the box's instant at which the line's end came.
    """
    with box.lock:
        box.advance()
        try:
            request = parse_request(line)
        except LineError as error:
            return _refuse_line(box, error)
        if request.checksum is not None:
            box.hear()
        return _answer_request(box, request, received_ticks)


def _refuse_line(box: FakeBox, error: LineError) -> bytes:
    if error.code in (ErrorCode.CHARACTER, ErrorCode.CHECKSUM):
        return Reply("?", error.code, error.code.word, {}).line()
    return _refuse(box, error.seq, error.code, {})


def _refuse(box: FakeBox, seq: int | None, code: ErrorCode, fields: Fields) -> bytes:
    if seq is not None:
        box.errors.add(code)
    return Reply("-" if seq is None else str(seq), code, code.word, fields).line()


def _answer_request(box: FakeBox, request: ReceivedRequest, received_ticks: int) -> bytes:
    seq, checksum = request.seq, request.checksum
    if seq is not None and checksum is not None and not request.query:
        stored = box.replies.find(seq, checksum)
        if stored is not None:
            return stored
    try:
        fields = _do(box, request, received_ticks)
        reply = Reply("-" if seq is None else str(seq), 0, "", fields).line()
    except Refusal as refusal:
        reply = _refuse(box, seq, refusal.code, refusal.fields)
    if seq is not None and checksum is not None and not request.query:
        box.replies.keep(seq, checksum, reply)
    return reply


def _do(box: FakeBox, request: ReceivedRequest, received_ticks: int) -> Fields:
    _check_kinds(request.fields)
    if request.command == "TIME?":
        if len(request.fields.get("pad", "")) > MAX_PAD:
            raise Refusal(ErrorCode.RANGE, key="pad")
        rx = instant_text(received_ticks)
        return {"rx": rx, "tx": instant_text(box.ticks())}
    return _HANDLERS[request.command](box, request.fields)


def _check_kinds(fields: Fields) -> None:
    """Whether each value is of its kind, before any is held against a limit."""
    for key, value in fields.items():
        pattern = "x+" if key == "pad" else "[0-9]+" if key in NUMBERS else ".*"
        if not re.fullmatch(pattern, value):
            raise Refusal(ErrorCode.TYPE)


def _number(fields: Fields, key: str, low: int, high: int) -> int:
    value = int(fields[key])
    if not low <= value <= high:
        raise Refusal(ErrorCode.RANGE, key=key)
    return value


def _capture_id(fields: Fields) -> str:
    if not CAPTURE_ID.fullmatch(fields["cap"]):
        raise Refusal(ErrorCode.TYPE)
    return fields["cap"]


def _idn(box: FakeBox, _: Fields) -> Fields:
    own = f"Rigwright,TriggerBox,{box.permanent.serial_number},{FIRMWARE}"
    return {"idn": box.settings.identity or own}


def _cap(box: FakeBox, _: Fields) -> Fields:
    limits = box.limits
    values = {
        "proto": 1,
        "out": OUTPUTS,
        "tick_ns": 500,
        "dmax": limits.max_delay_ticks,
        "wmax": limits.max_width_ticks,
        "smax": limits.max_strobe_width_ticks,
        "gap": limits.gap_ticks,
        "edges": limits.max_edges,
        "shots": limits.max_shots,
        "hold": limits.hold_ms,
    }
    return {key: str(value) for key, value in values.items()}


def _safe(box: FakeBox, _: Fields) -> Fields:
    limits = box.limits
    values = {
        "dm": limits.dead_man_ms,
        "dmmin": limits.least_dead_man_ms,
        "dmmax": limits.longest_dead_man_ms,
        "silence": SILENCE_MS,
        "srest": limits.strobe_rest,
        "sduty": 100 // limits.strobe_duty,
    }
    return {key: str(value) for key, value in values.items()}


def _boot(box: FakeBox, _: Fields) -> Fields:
    return {"n": str(box.permanent.boots), "cause": box.cause, "id": box.start_id}


def _stat(box: FakeBox, _: Fields) -> Fields:
    last = box.captures.last
    return {
        "st": box.state,
        "il": "CLOSED" if box.interlock_closed else "OPEN",
        "cap": last.id if last else "-",
        "ev": str(box.log.last),
        "err": str(len(box.errors)),
        "t": instant_text(box.ticks()),
    }


def _next_error(box: FakeBox, _: Fields) -> Fields:
    code = box.errors.take()
    return {"err": str(code), "word": ErrorCode(code).word if code else "none"}


def _logged(box: FakeBox, fields: Fields) -> Fields:
    event = box.log.find(_number(fields, "n", 0, 65535))
    if event is None:
        raise Refusal(ErrorCode.UNKNOWN)
    return {"ev": str(event.number), "name": event.name, **event.fields}


def _known(box: FakeBox, fields: Fields) -> Capture:
    capture = box.captures.find(_capture_id(fields))
    if capture is None:
        raise Refusal(ErrorCode.UNKNOWN)
    return capture


def _result(box: FakeBox, fields: Fields) -> Fields:
    capture = _known(box, fields)
    return {
        "res": capture.result,
        "shots": str(len(capture.shots)),
        "of": str(capture.shots_wanted),
        "t0": instant_text(capture.start),
        "late": str(capture.late),
        "boot": str(capture.boot),
        **({"why": capture.why} if capture.why else {}),
    }


def _last_capture(box: FakeBox, fields: Fields) -> Capture:
    capture = _known(box, fields)
    if capture is not box.captures.last:
        raise Refusal(ErrorCode.UNKNOWN)
    return capture


def _edge(box: FakeBox, fields: Fields) -> Fields:
    capture = _last_capture(box, fields)
    index = _number(fields, "i", 0, 65535)
    if index >= len(capture.edges):
        raise Refusal(ErrorCode.UNKNOWN)
    edge = capture.edges[index]
    late = capture.edge_late[index] if capture.edge_late else 0
    return {
        "i": str(index),
        "of": str(len(capture.edges)),
        "at": str(edge.at),
        "pins": f"{edge.pins:04X}",
        "late": str(late),
    }


def _shot(box: FakeBox, fields: Fields) -> Fields:
    capture = _last_capture(box, fields)
    number = _number(fields, "k", 0, 65535)
    if not 1 <= number <= len(capture.shots):
        raise Refusal(ErrorCode.UNKNOWN)
    start, late = capture.shots[number - 1]
    of = str(capture.shots_wanted)
    return {"k": str(number), "of": of, "t0": instant_text(start), "late": str(late)}


def _out(box: FakeBox, fields: Fields) -> Fields:
    output = _number(fields, "ch", 1, OUTPUTS)
    delay = _number(fields, "d", 0, box.limits.max_delay_ticks)
    width = _number(fields, "w", 0, box.limits.width_of(output))
    if box.state == "FIRING":
        raise Refusal(ErrorCode.BUSY)
    box.pulses[output] = (delay, width)
    return {"ch": str(output), "d": str(delay), "w": str(width)}


def _refuse_unless_idle(box: FakeBox) -> None:
    if box.state == "FIRING":
        raise Refusal(ErrorCode.BUSY)
    if box.state == "FAULT":
        raise Refusal(ErrorCode.FAULT, why=box.fault)
    if box.armed is not None:
        raise Refusal(ErrorCode.ARMED, cap=box.armed.id)


def _arm(box: FakeBox, fields: Fields) -> Fields:
    capture_id = _capture_id(fields)
    if not re.fullmatch(r"[0-9A-F]{4}", fields["mask"]):
        raise Refusal(ErrorCode.TYPE)
    shots = _number(fields, "n", 1, box.limits.max_shots)
    lead = _number(fields, "lead", MIN_LEAD, box.limits.max_delay_ticks)
    ttl_ms = _number(fields, "ttl", 1, box.limits.hold_ms)
    dead_man_ms = _dead_man_ms(box, fields)
    _refuse_unless_idle(box)
    if not box.interlock_closed:
        raise Refusal(ErrorCode.INTERLOCK)
    if box.captures.find(capture_id) is not None:
        raise Refusal(ErrorCode.USED)
    edges = compile_edges(box.pulses, int(fields["mask"], 16))
    if not edges:
        raise Refusal(ErrorCode.NOTHING)
    if len(edges) > box.limits.max_edges or nearest(edges) < box.limits.gap_ticks:
        raise Refusal(ErrorCode.EDGES)
    highest = box.limits.max_delay_ticks + box.limits.max_width_ticks + MIN_PAUSE
    strobes = box.strobes(int(fields["mask"], 16))
    rests = [box.limits.rest_after(width) for _, width in strobes]
    needed = (width + rest for (_, width), rest in zip(strobes, rests, strict=True))
    shortest = max(edges[-1].at + MIN_PAUSE, *needed, 0)
    interval = _number(fields, "iv", *((0, 0) if shots == 1 else (shortest, highest)))
    if strobes:
        first = box.ticks() + lead + min(delay for delay, _ in strobes)
        if box.strobe_ready > first:
            left_ms = max(box.strobe_ready - box.ticks(), 0) // TICKS_PER_MS + 1
            raise Refusal(ErrorCode.REST, ms=str(left_ms))
    boot, rest = box.permanent.boots, max(rests, default=0)
    box.arm(Capture(capture_id, boot, shots, interval, lead, edges, dead_man_ms, rest), ttl_ms)
    counts = {"edges": str(len(edges)), "dur": str(edges[-1].at)}
    return {"st": "ARMED", "cap": capture_id, **counts}


def _dead_man_ms(box: FakeBox, fields: Fields) -> int:
    if "dm" not in fields:
        return box.limits.dead_man_ms
    wanted = _number(fields, "dm", 0, box.limits.longest_dead_man_ms)
    if 0 < wanted < box.limits.least_dead_man_ms:
        raise Refusal(ErrorCode.RANGE, key="dm")
    return wanted


def _require_armed(box: FakeBox, capture_id: str) -> Capture:
    if box.state == "FIRING":
        raise Refusal(ErrorCode.BUSY)
    if box.state == "FAULT":
        raise Refusal(ErrorCode.FAULT, why=box.fault)
    if box.armed is None:
        raise Refusal(ErrorCode.NOT_ARMED)
    if box.armed.id != capture_id:
        raise Refusal(ErrorCode.CAPTURE, cap=box.armed.id)
    return box.armed


def _fire(box: FakeBox, fields: Fields) -> Fields:
    capture_id = _capture_id(fields)
    known = box.captures.find(capture_id)
    if known is not None and known.result != "ARMED":
        t0 = instant_text(known.start)
        raise Refusal(ErrorCode.FIRED, cap=known.id, res=known.result, t0=t0)
    capture = _require_armed(box, capture_id)
    box.fire(capture)
    return {"cap": capture.id, "t0": instant_text(capture.start)}


def _disarm(box: FakeBox, fields: Fields) -> Fields:
    capture = _require_armed(box, _capture_id(fields))
    box.stop("DISARMED", {}, "disarm")
    return {"cap": capture.id}


def _abort(box: FakeBox, _: Fields) -> Fields:
    box.abort()
    return {"st": box.state}


def _rst(box: FakeBox, _: Fields) -> Fields:
    box.abort()
    box.pulses.clear()
    if box.state == "FAULT" and box.interlock_closed:
        box.state, box.fault = "IDLE", ""
    return {"st": box.state}


def _cls(box: FakeBox, _: Fields) -> Fields:
    box.errors.clear()
    return {}


def _serial(box: FakeBox, fields: Fields) -> Fields:
    if not SERIAL_NUMBER.fullmatch(fields["sn"]):
        raise Refusal(ErrorCode.TYPE)
    _refuse_unless_idle(box)
    box.permanent.serial_number = fields["sn"]
    return {"sn": fields["sn"]}


_HANDLERS: Mapping[str, Callable[[FakeBox, Fields], Fields]] = {
    "*IDN?": _idn,
    "CAP?": _cap,
    "SAFE?": _safe,
    "BOOT?": _boot,
    "STAT?": _stat,
    "SYST:ERR?": _next_error,
    "LOG?": _logged,
    "RES?": _result,
    "EDGE?": _edge,
    "SHOT?": _shot,
    "OUT": _out,
    "ARM": _arm,
    "FIRE": _fire,
    "DISARM": _disarm,
    "ABORT": _abort,
    "*RST": _rst,
    "*CLS": _cls,
    "SERIAL": _serial,
}
