"""Keeps count of a box's events: which are new, which are missing."""

from __future__ import annotations

_NUMBERS = 65535
"""Event numbers run from 1 to this, then from 1 again."""
_OLD = 1000
"""An event this little behind the last one is an old one; farther is a new count."""


class EventSequence:
    """Compares each event's number with the last one's."""

    def __init__(self) -> None:
        self._last: int | None = None
        self._missing: set[int] = set()

    def restart(self, last: int | None) -> None:
        """The box has said what its last event was, or has begun to count anew."""
        self._last = last or None
        self._missing.clear()

    def accept(self, number: int) -> tuple[bool, list[int]]:
        """Whether an event is new, and the numbers of those lost before it."""
        if self._last is None:
            self._last = number
            return True, []
        ahead = (number - self._last) % _NUMBERS
        if ahead == 0:
            return False, []
        if ahead > _NUMBERS - _OLD:
            # Overtaken by later ones: new if it was given up for lost and not fetched since.
            new = number in self._missing
            self._missing.discard(number)
            return new, []
        missing = [(self._last + step - 1) % _NUMBERS + 1 for step in range(1, ahead)]
        self._missing.update(missing[-16:])
        self._last = number
        return True, missing[-16:]

    def fetched(self, number: int) -> bool:
        """A missing event has been fetched; False when it has come by itself meanwhile."""
        if number not in self._missing:
            return False
        self._missing.discard(number)
        return True
