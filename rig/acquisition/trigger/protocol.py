"""What the lines of the trigger protocol say: requests, replies, events.

Pure: text in, values out; no port, no clock. ``docs/reference/trigger-protocol.md`` is the
reference, ``vectors.json`` the examples that firmware, fake and driver all pass.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from rig.acquisition.trigger.lines import (
    MAX_ANSWER,
    Checksum,
    ErrorCode,
    LineError,
    RawLine,
    crc16,
    seal,
    unseal,
)

SEQUENCE_MODULUS = 65536
TICK_NS = 500
INSTANT_DIGITS = 12

COMMANDS: Mapping[str, tuple[str, ...]] = {
    "*IDN?": (),
    "CAP?": (),
    "SAFE?": (),
    "BOOT?": (),
    "STAT?": (),
    "TIME?": ("pad",),
    "SYST:ERR?": (),
    "LOG?": ("n",),
    "RES?": ("cap",),
    "EDGE?": ("cap", "i"),
    "SHOT?": ("cap", "k"),
    "OUT": ("ch", "d", "w"),
    "ARM": ("cap", "mask", "n", "iv", "lead", "ttl", "dm"),
    "FIRE": ("cap",),
    "DISARM": ("cap",),
    "ABORT": (),
    "*RST": (),
    "*CLS": (),
    "SERIAL": ("sn",),
}
"""Every command with the arguments it takes."""
OPTIONAL = frozenset({"dm"})
"""Arguments that may be left out, as hosts of before do; all others are needed."""

CAPTURE_ID = re.compile(r"[A-Za-z0-9_-]{1,12}")
SERIAL_NUMBER = re.compile(r"[A-Za-z0-9._-]{1,16}")

_FIELD = re.compile(r"([A-Za-z_][A-Za-z0-9_]*)=(.*)")


@dataclass(frozen=True)
class Request:
    """One request of the host. ``fields`` in the order in which they are written."""

    seq: int
    command: str
    fields: Mapping[str, str] = field(default_factory=dict)

    def line(self) -> bytes:
        """The checked line, with its end."""
        words = [str(self.seq), self.command, *(f"{k}={v}" for k, v in self.fields.items())]
        return seal(" ".join(words))


@dataclass(frozen=True)
class ReceivedRequest:
    """One request as a box reads it. ``seq`` is None for a line typed without a number."""

    seq: int | None
    command: str
    fields: Mapping[str, str]
    checksum: int | None
    """The line's checksum; None where it had none."""

    @property
    def query(self) -> bool:
        """Whether it only asks."""
        return self.command.endswith("?")


def parse_request(line: RawLine) -> ReceivedRequest:
    """Read a line as a box does, up to what its command's arguments mean.

    Raises :class:`LineError` with the code to answer; its ``seq`` is the number to answer
    under, None where there is none.
    """
    if not line.sound:
        raise LineError(ErrorCode.CHARACTER, line.text)
    body, check = unseal(line.text)
    if check is Checksum.WRONG:
        raise LineError(ErrorCode.CHECKSUM, line.text)
    words = body.split(" ")
    seq = _sequence(words[0])
    if seq is not None:
        words = words[1:]
    elif check is Checksum.GOOD:
        raise LineError(ErrorCode.SYNTAX, body)
    if not words or "" in words:
        raise LineError(ErrorCode.SYNTAX, body, seq)
    command = words[0]
    if command not in COMMANDS:
        raise LineError(ErrorCode.COMMAND, body, seq)
    if check is Checksum.ABSENT and not (command.endswith("?") or command == "ABORT"):
        raise LineError(ErrorCode.UNCHECKED, body, seq)
    fields = _arguments(command, words[1:], body, seq)
    checksum = crc16(body.encode()) if check is Checksum.GOOD else None
    return ReceivedRequest(seq, command, fields, checksum)


def _arguments(command: str, words: list[str], body: str, seq: int | None) -> dict[str, str]:
    fields: dict[str, str] = {}
    for word in words:
        found = _FIELD.fullmatch(word)
        if found is None:
            raise LineError(ErrorCode.SYNTAX, body, seq)
        if found[1] in fields or found[1] not in COMMANDS[command]:
            raise LineError(ErrorCode.PARAMETER, body, seq)
        fields[found[1]] = found[2]
    if not set(fields) >= set(COMMANDS[command]) - OPTIONAL:
        raise LineError(ErrorCode.MISSING, body, seq)
    return fields


@dataclass(frozen=True)
class Reply:
    """A box's answer. ``head`` is the request's number, ``-`` (none) or ``?`` (unreadable)."""

    head: str
    code: int
    """0 for ``OK``, else the code of the error."""
    word: str
    fields: Mapping[str, str]

    @property
    def ok(self) -> bool:
        """Whether the request was done."""
        return self.code == 0

    @property
    def seq(self) -> int | None:
        """The number of the request that is answered."""
        return None if self.head in "-?" else int(self.head)

    def line(self) -> bytes:
        """The checked line, with its end."""
        status = ["OK"] if self.ok else ["ERR", str(self.code), self.word]
        return seal(
            " ".join([self.head, *status, *(f"{k}={v}" for k, v in self.fields.items())]),
            MAX_ANSWER,
        )


@dataclass(frozen=True)
class Event:
    """What a box says by itself."""

    number: int
    name: str
    fields: Mapping[str, str]

    def line(self) -> bytes:
        """The checked line, with its end."""
        words = ["!", str(self.number), self.name, *(f"{k}={v}" for k, v in self.fields.items())]
        return seal(" ".join(words), MAX_ANSWER)


def parse_answer(line: RawLine) -> Reply | Event:
    """Read a line as a host does: only what is whole and checked is believed.

    Raises :class:`LineError` for everything else.
    """
    if not line.sound:
        raise LineError(ErrorCode.CHARACTER, line.text)
    body, check = unseal(line.text)
    if check is not Checksum.GOOD:
        code = ErrorCode.CHECKSUM if check is Checksum.WRONG else ErrorCode.UNCHECKED
        raise LineError(code, line.text)
    words = body.split(" ")
    if len(words) >= 3 and words[0] == "!":
        number = _sequence(words[1])
        if number is not None:
            return Event(number, words[2], _reported(words[3:], body))
    elif len(words) >= 2 and (words[0] in ("-", "?") or _sequence(words[0]) is not None):
        if words[1] == "OK":
            return Reply(words[0], 0, "", _reported(words[2:], body))
        if words[1] == "ERR" and len(words) >= 4 and re.fullmatch(r"-?[1-9]\d{0,5}", words[2]):
            return Reply(words[0], int(words[2]), words[3], _reported(words[4:], body))
    raise LineError(ErrorCode.SYNTAX, body)


def _reported(words: list[str], body: str) -> dict[str, str]:
    found = [_FIELD.fullmatch(word) for word in words]
    if None in found:
        raise LineError(ErrorCode.SYNTAX, body)
    return {match[1]: match[2] for match in found if match is not None}


def _sequence(word: str) -> int | None:
    number = int(word) if re.fullmatch(r"[0-9]{1,5}", word) else SEQUENCE_MODULUS
    return number if number < SEQUENCE_MODULUS else None


def instant_text(ticks: int) -> str:
    """An instant of the box's clock as it stands on the line."""
    return f"{ticks:0{INSTANT_DIGITS}X}"


def instant_ticks(text: str) -> int:
    """The other way; :class:`LineError` for what is no instant."""
    if not re.fullmatch(rf"[0-9A-F]{{{INSTANT_DIGITS}}}", text):
        raise LineError(ErrorCode.TYPE, text)
    return int(text, 16)


TIME_PAD = "x" * 24
"""Makes a ``TIME?`` as long as its reply: `` OK rx= tx=`` and two instants of 12 digits are 35
characters, `` TIME? pad=`` is 11."""
