"""What is counted on a line."""

from __future__ import annotations

import statistics
from collections import Counter, deque
from collections.abc import Callable

from rig.acquisition.trigger.box import WireLine

_ROUND_TRIPS = 500
_REMEMBERED_LINES = 4000
"""A burst of the longest kind with its edge log read, and the heartbeat around it."""


WireLog = Callable[[WireLine], None]
"""Hears every line, on the thread that owns the port: it must be quick and must not raise."""


class WireTape:
    """The last lines of a wire, for the report of the capture they belong to.

    Written by the thread that owns the port; ``also`` hears every line too.
    """

    def __init__(self, also: WireLog | None = None) -> None:
        self._also = also
        self._lines: deque[WireLine] = deque(maxlen=_REMEMBERED_LINES)

    def __call__(self, line: WireLine) -> None:
        """Take note of a line."""
        self._lines.append(line)
        if self._also is not None:
            self._also(line)

    def since(self, host_ns: int) -> tuple[WireLine, ...]:
        """The lines from an instant on."""
        return tuple(line for line in tuple(self._lines) if line.host_ns >= host_ns)


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
