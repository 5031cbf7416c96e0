"""One request, one answer: numbering, time-outs and tries over a line that may lose anything."""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from rig.acquisition.trigger.box import WireLine
from rig.acquisition.trigger.lines import MAX_ANSWER, ErrorCode, LineError, LineReader, RawLine
from rig.acquisition.trigger.metrics import Metrics, WireLog
from rig.acquisition.trigger.protocol import SEQUENCE_MODULUS, Event, Reply, Request, parse_answer
from rig.acquisition.trigger.serialline import SerialLine

TRY_S = 0.15
TRIES = 3

_DAMAGED = frozenset(
    {
        ErrorCode.SYNTAX,
        ErrorCode.TYPE,
        ErrorCode.PARAMETER,
        ErrorCode.MISSING,
        ErrorCode.COMMAND,
        ErrorCode.UNCHECKED,
    }
)
"""Answers to a line that lost its checksum on the way, for what is sent here has one and is well
formed. Nothing was done; the same line may go again."""


class NoAnswerError(Exception):
    """The box does not answer a request, though the port is there."""


@dataclass(frozen=True)
class Answer:
    """A reply with the host's instants around the try that it came to."""

    reply: Reply
    sent_ns: int
    received_ns: int


class RequestLink:
    """Requests and replies over one open port. Used by one thread.

    ``on_event`` hears events while anything is being read; it must not ask the box itself.
    """

    def __init__(
        self,
        line: SerialLine,
        metrics: Metrics,
        on_event: Callable[[Event], None],
        wire_log: WireLog | None = None,
    ) -> None:
        self._line = line
        self._metrics = metrics
        self._on_event = on_event
        self._wire_log = wire_log
        self._reader = LineReader(MAX_ANSWER)
        self._seq = random.randrange(SEQUENCE_MODULUS)  # noqa: S311 - only to differ
        self._replies: list[tuple[Reply, int]] = []
        self._last_sent = b""
        self.deadline_ns: int | None = None
        """No try begins or waits beyond it: who asked has given up by then."""

    def clear_line(self) -> None:
        """End whatever half line the box may have from an earlier host."""
        self._line.send(b"\n")

    def exchange(
        self, command: str, fields: Mapping[str, str] | None = None, tries: int = TRIES
    ) -> Answer:
        """Ask until it is answered: the same line each time, so that it is done once.

        Raises :class:`NoAnswerError`, or the line's own error.
        """
        request = Request(self._seq, command, fields or {})
        self._seq = (self._seq + 1) % SEQUENCE_MODULUS
        line = request.line()
        damaged: list[Answer] = []
        for number in range(tries):
            if self._time_left_s() <= 0.0:
                break
            if number:
                self._metrics.count("retries")
            sent_ns = self._send(line)
            answer = self._await(request.seq, sent_ns)
            if answer is not None and answer.reply.code not in _DAMAGED:
                self._metrics.round_trip((answer.received_ns - sent_ns) / 1e6)
                return answer
            if answer is not None:
                damaged.append(answer)
        if len(damaged) == tries:
            return damaged[-1]  # every time the same: it is no accident
        self._metrics.count("no_answer")
        raise NoAnswerError(command)

    def listen(self, timeout_s: float) -> None:
        """Hear events until something comes, the time is over, or somebody wakes the line."""
        self._read(timeout_s, wakeable=True)
        self._metrics.count("stray_replies", len(self._replies))
        self._replies.clear()

    def _time_left_s(self) -> float:
        if self.deadline_ns is None:
            return TRY_S
        return (self.deadline_ns - time.monotonic_ns()) / 1e9

    def _send(self, line: bytes) -> int:
        self._metrics.count("sent")
        self._last_sent = line.rstrip(b"\n")
        sent_ns = time.monotonic_ns()
        self._line.send(line)
        self._log(sent_ns, sent=True, text=self._last_sent.decode())
        return sent_ns

    def _await(self, seq: int, sent_ns: int) -> Answer | None:
        """The reply to ``seq``; None when its time is over or the box could not read the line."""
        patience_s = min(TRY_S, max(self._time_left_s(), 0.0))
        until_ns = time.monotonic_ns() + int(patience_s * 1e9)
        while True:
            for reply, received_ns in self._take_replies():
                if reply.seq == seq:
                    return Answer(reply, sent_ns, received_ns)
                if reply.head == "?":
                    self._metrics.count("refused_lines")
                    return None
                self._metrics.count("stray_replies")
            left_s = (until_ns - time.monotonic_ns()) / 1e9
            if left_s <= 0.0:
                return None
            self._read(left_s, wakeable=False)

    def _take_replies(self) -> list[tuple[Reply, int]]:
        replies, self._replies = self._replies, []
        return replies

    def _read(self, timeout_s: float, wakeable: bool) -> None:
        data = self._line.receive(timeout_s, wakeable)
        received_ns = time.monotonic_ns()
        for raw in self._reader.feed(data):
            self._log(received_ns, sent=False, text=raw.text)
            self._sort_in(raw, received_ns)

    def _sort_in(self, raw: RawLine, received_ns: int) -> None:
        try:
            answer = parse_answer(raw)
        except LineError as error:
            if raw.data == self._last_sent:
                self._metrics.count("echoes")
            elif error.code is ErrorCode.CHECKSUM:
                self._metrics.count("crc_errors")
            else:
                self._metrics.count("resyncs")
            return
        if isinstance(answer, Reply):
            self._replies.append((answer, received_ns))
        else:
            self._on_event(answer)

    def _log(self, host_ns: int, *, sent: bool, text: str) -> None:
        if self._wire_log is not None:
            self._wire_log(WireLine(host_ns, sent, text))
