"""Lines of the trigger protocol: checksum, printable text, cutting a stream into lines.

Pure: bytes in, lines out. What the lines say is :mod:`rig.acquisition.trigger.protocol`'s.
"""

from __future__ import annotations

import binascii
import re
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum, IntEnum

from common.errors import InputError

MAX_REQUEST = 95
"""Characters of a line to the box, before the line end."""
MAX_ANSWER = 127
"""Characters of a line from the box."""

_CHECKED = re.compile(r"(.*) \*([0-9A-F]{4})")


class ErrorCode(IntEnum):
    """The codes of ``ERR`` replies; :attr:`word` is what stands beside them on the line."""

    CHARACTER = -101
    SYNTAX = -102
    TYPE = -104
    PARAMETER = -108
    MISSING = -109
    COMMAND = -113
    RANGE = -222
    EDGES = -223
    OVERFLOW = -350
    CHECKSUM = -360
    UNCHECKED = -361
    INTERLOCK = 201
    NOT_ARMED = 210
    CAPTURE = 220
    FIRED = 221
    ARMED = 222
    USED = 223
    BUSY = 230
    REST = 231
    FAULT = 240
    UNKNOWN = 250
    NOTHING = 260

    @property
    def word(self) -> str:
        """The word of the protocol, for example ``not-armed``."""
        return self.name.lower().replace("_", "-")


class LineError(Exception):
    """A received line that cannot be used: ``code`` says why, ``text`` is what came."""

    def __init__(self, code: ErrorCode, text: str, seq: int | None = None) -> None:
        super().__init__(f"{code.word}: {text!r}")
        self.code = code
        self.text = text
        self.seq = seq


def crc16(data: bytes) -> int:
    """CRC-16/CCITT-FALSE; ``crc16(b"123456789") == 0x29B1``."""
    return binascii.crc_hqx(data, 0xFFFF)


def seal(body: str, limit: int = MAX_REQUEST) -> bytes:
    """``body`` with its checksum and line end, ready for the wire.

    Raises :class:`~common.errors.InputError` for what does not fit a line.
    """
    data = body.encode("ascii", "replace")
    line = data + b" *%04X\n" % crc16(data)
    if len(line) > limit + 1 or not _printable(line[:-1]) or not body.isascii():
        raise InputError(
            "trigger-line",
            f"{body!r} does not fit a line of the trigger protocol",
            f"use printable ASCII and at most {limit - 6} characters",
        )
    return line


class Checksum(Enum):
    """What the checksum of a line says."""

    GOOD = "good"
    WRONG = "wrong"
    ABSENT = "absent"


def unseal(text: str) -> tuple[str, Checksum]:
    """A line's body, and whether it had a checksum that fits.

    Only `` *`` and four upper-case hexadecimal digits at the very end are a checksum, so
    ``*IDN?`` and ``*RST`` are none.
    """
    found = _CHECKED.fullmatch(text)
    if found is None:
        return text, Checksum.ABSENT
    body = found[1]
    good = crc16(body.encode("ascii", "replace")) == int(found[2], 16)
    return body, Checksum.GOOD if good else Checksum.WRONG


@dataclass(frozen=True)
class RawLine:
    """One line as it came, without its end. Not ``sound``: over-long, or not printable."""

    data: bytes
    sound: bool

    @property
    def text(self) -> str:
        """The line as text; what is not ASCII is escaped."""
        return self.data.decode("ascii", "backslashreplace")


class LineReader:
    """Cuts any stream of bytes into lines and finds back after noise.

    Memory is bounded: of an over-long line the beginning is kept and the rest dropped, up to
    the next line end. Empty lines are swallowed.
    """

    def __init__(self, limit: int = MAX_REQUEST) -> None:
        self._limit = limit
        self._line = bytearray()

    def feed(self, data: bytes) -> list[RawLine]:
        """The lines that ``data`` completes; the rest waits for more."""
        return list(self._cut(data))

    def clear(self) -> None:
        """Forget a line begun before, for example on another connection."""
        self._line.clear()

    def _cut(self, data: bytes) -> Iterator[RawLine]:
        *ends, rest = data.split(b"\n")
        for part in ends:
            self._keep(part)
            line = bytes(self._line).removesuffix(b"\r")
            self._line.clear()
            if line:
                yield RawLine(line[: self._limit], len(line) <= self._limit and _printable(line))
        self._keep(rest)

    def _keep(self, part: bytes) -> None:
        # Two more than fit: a full line's "\r", and one that proves the line over-long.
        self._line += part[: self._limit + 2 - len(self._line)]


def _printable(line: bytes) -> bool:
    return all(0x20 <= byte <= 0x7E for byte in line)
