"""What a fault proxy shall do to a line: rates of faults, and things that happen once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from common.errors import InputError

Way = Literal["to_box", "to_host"]


@dataclass(frozen=True)
class FaultRates:
    """What happens to lines, each with its probability for one line.

    ``drop``, ``duplicate``, ``corrupt`` (a flipped bit), ``truncate`` (its end and line end are
    lost), ``delay`` (by up to ``delay_s``, those after it wait), ``reorder`` (those after it
    overtake), ``split`` (in two pieces, a moment apart), ``noise`` (random bytes before it).
    ``latency_s``: every line waits a random time up to this, like an FTDI adapter's timer.
    ``merge_s``: bytes are collected for this long and come in one piece. ``echo``: what the
    host sends comes back to it as well.
    """

    drop: float = 0.0
    duplicate: float = 0.0
    corrupt: float = 0.0
    truncate: float = 0.0
    delay: float = 0.0
    delay_s: float = 0.25
    reorder: float = 0.0
    split: float = 0.0
    noise: float = 0.0
    latency_s: float = 0.0
    merge_s: float = 0.0
    echo: bool = False

    @staticmethod
    def all_at(rate: float) -> FaultRates:
        """Every line suffers with probability ``rate``, each kind of fault equally often."""
        each = rate / 8.0
        return FaultRates(
            drop=each,
            duplicate=each,
            corrupt=each,
            truncate=each,
            delay=each,
            reorder=each,
            split=each,
            noise=each,
        )


@dataclass(frozen=True)
class Incident:
    """Something that happens once: at a byte or a line one way, or at the first line with a text.

    ``do``: ``unplug`` (and plugged in again ``for_s`` later; never when that is negative),
    ``reset`` (the box's, by the proxy's ``reset``), ``drop`` (this line), ``noise`` (4 kB).
    """

    way: Way
    do: Literal["unplug", "reset", "drop", "noise"]
    at_byte: int | None = None
    at_line: int | None = None
    containing: str = ""
    for_s: float = 0.5

    def __post_init__(self) -> None:
        moments = (self.at_byte is not None, self.at_line is not None, self.containing != "")
        if sum(moments) != 1:
            raise InputError(
                "proxy-incident",
                "an incident needs one moment",
                "give at_byte, at_line or containing",
            )

    def strikes(self, way: Way, line: int, before: int, unit: bytes) -> bool:
        """Whether it happens at this line, which begins after ``before`` bytes."""
        if way != self.way:
            return False
        if self.at_byte is not None:
            return before <= self.at_byte < before + len(unit)
        if self.at_line is not None:
            return line == self.at_line
        return self.containing.encode() in unit


@dataclass(frozen=True)
class ProxyScript:
    """All that a proxy does to a line."""

    to_box: FaultRates = FaultRates()
    to_host: FaultRates = FaultRates()
    incidents: tuple[Incident, ...] = ()
    seed: int = 0
