"""What can go wrong with the pictures of a capture, by name."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class FaultKind(StrEnum):
    """The names, stable in files and over HTTP."""

    NOT_READY = "not-ready"
    MISSING = "missing"
    EXTRA_AT_START = "extra-at-start"
    EXTRA = "extra"
    DUPLICATE = "duplicate"
    HELD_BACK = "held-back"
    FILE_MISSING = "file-missing"
    AMBIGUOUS = "ambiguous"
    LATE = "late"
    BLACK = "black"
    WRONG_SIZE = "wrong-size"
    UNREADABLE = "unreadable"
    INCOMPLETE = "incomplete"
    FREE_RUNNING = "free-running"
    LAG_OFF = "lag-off"
    COUNTER_GAP = "counter-gap"
    COUNTER_CONFLICT = "counter-conflict"
    TIMESTAMP_RESET = "timestamp-reset"
    BY_ARRIVAL = "by-arrival"
    SWAPPED = "swapped"
    NOT_FIRED = "not-fired"
    BOX_LOST = "box-lost"
    FILED_AS_PNG = "filed-as-png"
    SLOW_DISK = "slow-disk"


HARMLESS = frozenset(
    {
        FaultKind.EXTRA_AT_START,
        FaultKind.DUPLICATE,
        FaultKind.HELD_BACK,
        FaultKind.LATE,
        FaultKind.COUNTER_GAP,
        FaultKind.BY_ARRIVAL,
        FaultKind.BOX_LOST,
        FaultKind.FILED_AS_PNG,
        FaultKind.SLOW_DISK,
    }
)
"""Faults after which every wanted picture can still be there and right."""


@dataclass(frozen=True)
class Fault:
    """One finding. ``camera`` and ``shot`` (from 1) say where, as far as it belongs anywhere."""

    kind: FaultKind
    text: str
    camera: str | None = None
    shot: int | None = None

    @property
    def harmless(self) -> bool:
        """Whether the capture can be whole all the same."""
        return self.kind in HARMLESS
