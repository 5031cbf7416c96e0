"""Messages between a camera's worker and its host: one line of JSON, then raw bytes if any.

A header with ``bytes`` above zero is followed by so many bytes of payload. Both ends run on one
machine, so instants of the monotonic clock mean the same on either side.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, BinaryIO

MAX_HEADER = 1 << 20
"""Bytes of a header; more is a fault, and reading on would fill the memory."""

Header = dict[str, Any]


class WireError(Exception):
    """What came is not a message."""


def send(stream: BinaryIO, header: Mapping[str, object], payload: bytes = b"") -> None:
    """Write one message whole. The caller sees to it that no other thread writes meanwhile."""
    line = json.dumps({**header, "bytes": len(payload)}, separators=(",", ":"))
    stream.write(line.encode() + b"\n")
    if payload:
        stream.write(payload)
    stream.flush()


def receive(stream: BinaryIO) -> tuple[Header, bytes] | None:
    """The next message; None at the end, also when the end comes within a message."""
    line = stream.readline(MAX_HEADER)
    if not line.endswith(b"\n"):
        if len(line) >= MAX_HEADER:
            raise WireError("a header that does not end")
        return None
    header = _header(line)
    size = header.get("bytes", 0)
    if not isinstance(size, int) or size < 0:
        raise WireError(f"a payload of {size!r} bytes")
    payload = stream.read(size) if size else b""
    return (header, payload) if len(payload) == size else None


def _header(line: bytes) -> Header:
    try:
        header = json.loads(line)
    except ValueError:
        raise WireError(f"not JSON: {line[:80]!r}") from None
    if not isinstance(header, dict):
        raise WireError(f"not a header: {line[:80]!r}")
    return header
