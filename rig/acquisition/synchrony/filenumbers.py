"""What the numbers in the names of pictures say, where no time is in them.

Cameras count their pictures: one more for each. After the last number of so many digits they begin
again at 1, and with a new card or folder at any number.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import PurePath

_WRAPPED = 100
"""A number that is so little above the last one, counted through the end, has gone round."""
_LEAST_DIGITS = 3


def file_number(name: str) -> str:
    """The digits that count in a name; empty where it has none."""
    digits = re.findall(r"\d+", PurePath(name).stem)
    return digits[-1] if digits else ""


@dataclass
class FileNumbers:
    """What is remembered of one camera's count."""

    last: str = ""
    lost: set[int] = field(default_factory=set)
    """Numbers that were passed over: pictures that may still come."""
    _fresh: int | None = None
    _fresh_now: int | None = None

    def ahead(self, number: str) -> int | None:
        """How many pictures after the last one it is, 0 or less before it; None: unknown."""
        if not number or not self.last:
            return None
        step, top = int(number) - int(self.last), int(10 ** len(number))
        if not len(number) == len(self.last) >= _LEAST_DIGITS:
            return step
        # No camera gives the number 0.
        if step <= _WRAPPED - top:
            return step + top - (int(number) > 0)
        if step >= top - _WRAPPED:
            return step - top + (int(self.last) > 0)
        return step

    def begins_anew(self, number: str, shots: int) -> bool:
        """Whether the count was begun anew: the second capture in which such numbers follow.

        The first such number is only noted: it may as well be of an old picture.
        """
        count = int(number)
        if count in self.lost:
            return False
        self._fresh_now = max(count, self._fresh_now or 0)
        return self._fresh is not None and 1 <= count - self._fresh <= shots

    def capture_ends(self, accepted: list[str]) -> None:
        """Remember the numbers of the pictures that a capture got, in their order."""
        for number in accepted:
            step = self.ahead(number)
            if step is not None and step > 1:
                top = 10 ** len(number)
                self.lost |= {(int(number) - k) % top for k in range(1, min(step, _WRAPPED))}
            self.last = number or self.last
        self._fresh, self._fresh_now = (None if accepted else self._fresh_now), None

    @property
    def may_begin_anew(self) -> bool:
        """Whether the capture before brought a number that a new count may have."""
        return self._fresh is not None
