"""What a fake box remembers: stored replies, events, errors, captures, its permanent memory."""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Mapping
from dataclasses import dataclass, field

from rig.acquisition.trigger.edges import OutputEdge
from rig.acquisition.trigger.lines import ErrorCode
from rig.acquisition.trigger.protocol import Event

STORED_REPLIES = 4
STORED_EVENTS = 16
STORED_CAPTURES = 4
QUEUED_ERRORS = 8
EVENT_MODULUS = 65536


@dataclass
class Permanent:
    """What survives the loss of power, as an EEPROM does."""

    serial_number: str = "fake"
    boots: int = 0


@dataclass
class Capture:
    """One capture, as ``RES?``, ``EDGE?`` and ``SHOT?`` report it."""

    id: str
    boot: int
    shots_wanted: int
    interval_ticks: int
    lead: int
    edges: tuple[OutputEdge, ...]
    dead_man_ms: int
    strobe_rest: int
    result: str = "ARMED"
    why: str = ""
    """Why it came to its end before its time."""
    start: int = 0
    """Instant of the first shot's start; 0 before FIRE."""
    shots: list[tuple[int, int]] = field(default_factory=list)
    """Start and largest lateness of the complete ones."""
    edge_late: list[int] = field(default_factory=list)
    """Lateness of each edge in the last complete shot."""

    @property
    def duration(self) -> int:
        """From a shot's start to its last edge, in ticks."""
        return self.edges[-1].at

    @property
    def late(self) -> int:
        """Largest lateness in ticks."""
        return max((late for _, late in self.shots), default=0)


class Replies:
    """The last few changing requests with their replies."""

    def __init__(self) -> None:
        self._stored: OrderedDict[tuple[int, int], bytes] = OrderedDict()

    def find(self, seq: int, checksum: int) -> bytes | None:
        """The reply to a request that was done before."""
        return self._stored.get((seq, checksum))

    def keep(self, seq: int, checksum: int, reply: bytes) -> None:
        """Remember one; the oldest is forgotten."""
        self._stored[seq, checksum] = reply
        while len(self._stored) > STORED_REPLIES:
            self._stored.popitem(last=False)


class EventLog:
    """Numbers events and keeps the last ones."""

    def __init__(self, first: int = 1) -> None:
        self._next = first
        self._kept: deque[Event] = deque(maxlen=STORED_EVENTS)

    @property
    def last(self) -> int:
        """The last event's number; 0 when there is none."""
        return self._kept[-1].number if self._kept else 0

    def add(self, name: str, fields: Mapping[str, str]) -> Event:
        """A new event."""
        event = Event(self._next, name, fields)
        self._kept.append(event)
        self._next = self._next % (EVENT_MODULUS - 1) + 1
        return event

    def find(self, number: int) -> Event | None:
        """One of the last."""
        return next((event for event in self._kept if event.number == number), None)


class ErrorQueue:
    """Oldest first; when it is full the newest place says that errors were lost."""

    def __init__(self) -> None:
        self._codes: deque[int] = deque()

    def __len__(self) -> int:
        return len(self._codes)

    def add(self, code: int) -> None:
        """Queue an error."""
        if len(self._codes) == QUEUED_ERRORS:
            self._codes[-1] = ErrorCode.OVERFLOW
        else:
            self._codes.append(code)

    def take(self) -> int:
        """The oldest, or 0."""
        return self._codes.popleft() if self._codes else 0

    def clear(self) -> None:
        """Forget all."""
        self._codes.clear()


class CaptureMemory:
    """The last few captures, newest last."""

    def __init__(self) -> None:
        self._kept: deque[Capture] = deque(maxlen=STORED_CAPTURES)

    @property
    def last(self) -> Capture | None:
        """The newest."""
        return self._kept[-1] if self._kept else None

    def find(self, capture_id: str) -> Capture | None:
        """One of the last."""
        return next((kept for kept in self._kept if kept.id == capture_id), None)

    def add(self, capture: Capture) -> None:
        """A new one; the oldest is forgotten."""
        self._kept.append(capture)
