"""Plays the test vectors of the trigger protocol against a device.

``vectors.json`` says what a box answers; :func:`play_dialogue` and :func:`play_framing` say it
to any stream of bytes: a serial port with the firmware behind it, or the fake device.
"""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from typing import Any, Protocol

from rig.acquisition.trigger.lines import MAX_ANSWER, ErrorCode, LineError, LineReader, crc16
from rig.acquisition.trigger.protocol import SEQUENCE_MODULUS, Event, Reply, parse_answer

_PLACE = re.compile(r"\{([a-z][a-z0-9_]*)(?::([+-]\d+)|([+-]\d+))?\}")
_CAPTURES = "abcde"


class ByteStream(Protocol):
    """What pyserial's ports and the fake's in-process line have in common."""

    def write(self, data: bytes, /) -> int | None:
        """Send."""
        ...

    def read(self, size: int = 1, /) -> bytes:
        """What has come, at most ``size``; after a short time-out also nothing."""
        ...


class VectorMismatch(AssertionError):  # noqa: N818 - it is a failed assertion, not an error
    """The device did not do what a vector says."""


@dataclass(frozen=True)
class Hands:
    """What a player can do beside the line.

    ``wait`` lets the given seconds pass for the device; ``actions`` are the ``do`` steps it can
    do, by name; ``timeout_s`` is how long an answer may take.
    """

    wait: Callable[[float], None] = time.sleep
    actions: Mapping[str, Callable[[], None]] = field(default_factory=dict)
    timeout_s: float = 2.0


def load_vectors() -> dict[str, Any]:
    """The test vectors, as they stand in ``vectors.json``."""
    text = files("rig.acquisition.trigger").joinpath("vectors.json").read_text(encoding="utf-8")
    vectors: dict[str, Any] = json.loads(text)
    return vectors


def fill(template: str, values: Mapping[str, str]) -> str:
    """A line or field with its placeholders filled; checksums last, of what precedes them."""

    def value(found: re.Match[str]) -> str:
        name, on_instant, on_number = found.groups()
        if name in ("crc", "badcrc"):
            return found[0]
        text = values[name]
        if on_instant:
            return f"{int(text, 16) + int(on_instant):012X}"
        return str(int(text) + int(on_number)) if on_number else text

    filled = _PLACE.sub(value, template)
    lines = [_with_checksums(line) for line in filled.split("\n")]
    return "\n".join(lines)


def _with_checksums(line: str) -> str:
    while (found := re.search(r" \{(bad)?crc\}", line)) is not None:
        body = line[: found.start()]
        checksum = crc16(body.encode("latin-1")) ^ (0x0101 if found[1] else 0)
        line = f"{body} *{checksum:04X}{line[found.end() :]}"
    return line


class Conversation:
    """One dialogue with a device: numbers requests, keeps what came, saves values."""

    def __init__(self, stream: ByteStream, hands: Hands, prefix: str = "") -> None:
        self._stream = stream
        self._hands = hands
        self._reader = LineReader(MAX_ANSWER)
        self._replies: list[Reply] = []
        self._events: list[Event] = []
        self._sent: list[tuple[str, str]] = []
        self._seq = 100
        self.values = {name: f"{prefix}{name}" for name in _CAPTURES}

    def step(self, step: Mapping[str, Any]) -> None:
        """Do one step; :class:`VectorMismatch` when the device answers something else."""
        if "send" in step:
            self._send(step["send"], step["expect"])
        elif "again" in step:
            self._send_again(step["again"], step["expect"])
        elif "event" in step:
            self._await_event(step["event"], step["fields"])
        elif "wait_ms" in step:
            self._hands.wait(step["wait_ms"] / 1000.0)
        else:
            self._hands.actions[step["do"]]()

    def exchange_bytes(self, data: str, replies: list[Mapping[str, Any]]) -> None:
        """Send bytes as they are and compare all that is answered."""
        self._stream.write(fill(data, self.values).encode("latin-1"))
        for expected in replies:
            self._compare(self._next_reply(data), expected, expected["head"])
        self._send("{seq} STAT? {crc}", {})

    def _send(self, template: str, expect: Mapping[str, Any]) -> None:
        seq = str(self._seq)
        self._seq = (self._seq + 1) % SEQUENCE_MODULUS
        line = fill(template, {**self.values, "seq": seq})
        head = seq if template.startswith("{seq}") else expect.get("head", "-")
        self._sent.append((line, head))
        self._transmit(line, expect.get("head", head), expect)

    def _send_again(self, back: int, expect: Mapping[str, Any]) -> None:
        line, head = self._sent[-back]
        self._transmit(line, head, expect)

    def _transmit(self, line: str, head: str, expect: Mapping[str, Any]) -> None:
        self._stream.write(line.encode("ascii") + b"\n")
        self._compare(self._next_reply(line), expect, head)

    def _compare(self, reply: Reply, expect: Mapping[str, Any], head: str) -> None:
        code = expect.get("code", 0)
        word = ErrorCode(code).word if code else ""
        if (reply.head, reply.code, reply.word) != (head, code, word):
            raise VectorMismatch(f"expected {head} {code} {word}, got {reply}")
        problem = self._difference(reply.fields, expect.get("fields", {}))
        if problem:
            raise VectorMismatch(f"{problem} in {reply}")
        for name, target in expect.get("save", {}).items():
            self.values[target] = reply.fields[name]

    def _difference(self, fields: Mapping[str, str], expected: Mapping[str, str]) -> str:
        for name, template in expected.items():
            got = fields.get(name)
            if template.startswith("~"):
                same = got is not None and re.fullmatch(template[1:], got) is not None
            else:
                same = got == fill(template, self.values)
            if not same:
                return f"{name}={got} instead of {template}"
        return ""

    def _next_reply(self, sent: str) -> Reply:
        if not self._pump(lambda: bool(self._replies)):
            raise VectorMismatch(f"no answer to {sent!r}")
        return self._replies.pop(0)

    def _await_event(self, name: str, fields: Mapping[str, str]) -> None:
        def found() -> bool:
            while self._events:
                event = self._events.pop(0)
                if event.name == name and not self._difference(event.fields, fields):
                    return True
            return False

        if not self._pump(found):
            raise VectorMismatch(f"no event {name} with {fields}")

    def _pump(self, done: Callable[[], bool]) -> bool:
        deadline = time.monotonic() + self._hands.timeout_s
        while not done():
            if time.monotonic() > deadline:
                return False
            for raw in self._reader.feed(self._stream.read(1)):
                try:
                    answer = parse_answer(raw)
                except LineError as error:
                    raise VectorMismatch(f"the device said {error}") from error
                if isinstance(answer, Reply):
                    self._replies.append(answer)
                else:
                    self._events.append(answer)
        return True


def play_dialogue(
    dialogue: Mapping[str, Any], stream: ByteStream, hands: Hands, prefix: str = ""
) -> None:
    """Play one of ``dialogues`` on a fresh device.

    ``prefix`` (up to 11 characters) makes capture ids unlike those of earlier dialogues, for a
    device that cannot be made afresh. Raises :class:`VectorMismatch`.
    """
    conversation = Conversation(stream, hands, prefix)
    for number, step in enumerate(dialogue["steps"], 1):
        try:
            conversation.step(step)
        except VectorMismatch as error:
            raise VectorMismatch(f"{dialogue['name']}, step {number} {step}: {error}") from None


def play_framing(vector: Mapping[str, Any], stream: ByteStream, hands: Hands) -> None:
    """Play one of ``framing``: bytes in, replies out, and nothing but them. Idle device."""
    try:
        Conversation(stream, hands).exchange_bytes(vector["bytes"], vector["replies"])
    except VectorMismatch as error:
        raise VectorMismatch(f"{vector['name']}: {error}") from None
