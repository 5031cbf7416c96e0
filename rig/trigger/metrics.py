"""What is counted on a line."""

from __future__ import annotations

import statistics
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass

_ROUND_TRIPS = 500


@dataclass(frozen=True)
class WireLine:
    """One line as it went over the wire. ``host_ns`` is ``time.monotonic_ns``."""

    host_ns: int
    sent: bool
    text: str


WireLog = Callable[[WireLine], None]
"""Hears every line, on the thread that owns the port: it must be quick and must not raise."""


class Metrics:
    """Counters and round trips. Written by one thread, read by any.

    Counted: ``sent``, ``retries``, ``no_answer``, ``crc_errors``, ``resyncs`` (unreadable or
    meaningless lines dropped), ``refused_lines`` (the box could not read a line of ours),
    ``stray_replies``, ``echoes``, ``events``, ``events_lost``, ``reboots``, ``reconnects``.
    """

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()
        self._round_trips_ms: deque[float] = deque(maxlen=_ROUND_TRIPS)

    def count(self, name: str, by: int = 1) -> None:
        """One more."""
        self._counts[name] += by

    def round_trip(self, milliseconds: float) -> None:
        """One exchange's time from sending to having the answer."""
        self._round_trips_ms.append(milliseconds)

    def counts(self) -> dict[str, int]:
        """A copy."""
        return dict(self._counts)

    def percentiles_ms(self) -> tuple[float | None, float | None]:
        """Median and 99th percentile of the last round trips."""
        times = sorted(self._round_trips_ms.copy())
        if not times:
            return None, None
        return statistics.median(times), times[min(len(times) - 1, int(len(times) * 0.99))]
