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


def file_numbers(name: str) -> tuple[int, ...]:
    """All numbers in a name, by which names that are alike are put in order."""
    return tuple(int(digits) for digits in re.findall(r"\d+", PurePath(name).stem))


def _count(name: str, before: str) -> tuple[str, str]:
    """The digits that count in two names; empty where they say nothing of their order.

    Where nothing but digits tells the names apart, the last ones that differ: what stays (the
    number of a camera, a size) does not count.
    """
    now, then = PurePath(name).stem.casefold(), PurePath(before).stem.casefold()
    parts, others = re.split(r"(\d+)", now), re.split(r"(\d+)", then)
    pairs = list(zip(parts[1::2], others[1::2], strict=False))
    if parts[::2] == others[::2]:
        pairs = [(one, other) for one, other in pairs if one != other]
        return pairs[-1] if pairs else ("", "")
    if len(parts) < 3 or len(others) < 3:
        return "", ""
    last, other = parts[-2], others[-2]
    # Another name with the same number tells nothing, unless it was made from the other's.
    return ("", "") if last == other and now not in then and then not in now else (last, other)


def _ahead(name: str, before: str) -> int | None:
    """How many pictures a name is after another, 0 or less before it; None: unknown."""
    number, last = _count(name, before)
    if not number or not last:
        return None
    step, top = int(number) - int(last), int(10 ** len(number))
    if not len(number) == len(last) >= _LEAST_DIGITS:
        return step
    # No camera gives the number 0.
    if step <= _WRAPPED - top:
        return step + top - (int(number) > 0)
    if step >= top - _WRAPPED:
        return step - top + (int(last) > 0)
    return step


@dataclass
class FileNumbers:
    """What is remembered of one camera's count."""

    last: str = ""
    """The name of the last picture that was believed."""
    lost: set[int] = field(default_factory=set)
    """Numbers that were passed over: pictures that may still come."""
    held: str = ""
    """The name of the last picture since then that was held back."""
    _astray: bool = False
    _fresh: int | None = None
    _fresh_now: int | None = None

    def ahead(self, name: str) -> int | None:
        """How many pictures after the last one it is, 0 or less before it; None: unknown."""
        return _ahead(name, self.last)

    def goes_on(self, name: str) -> bool:
        """Whether no number since the last believed one says that another count has begun."""
        step = _ahead(name, self.held)
        return not self._astray and (step is None or step > 0)

    def hold(self, name: str) -> None:
        """Remember that this picture came and was not believed."""
        self._astray, self.held = not self.goes_on(name), name

    def begins_anew(self, name: str, shots: int) -> bool:
        """Whether the count was begun anew: the second capture in which such numbers follow.

        The first such number is only noted: it may as well be of an old picture.
        """
        count = int(_count(name, self.last)[0])
        if count in self.lost:
            return False
        self._fresh_now = max(count, self._fresh_now or 0)
        return self._fresh is not None and 1 <= count - self._fresh <= shots

    def capture_ends(self, accepted: list[str]) -> None:
        """Remember the names of the pictures that a capture got, in their order."""
        for name in accepted:
            step, number = self.ahead(name), _count(name, self.last)[0]
            if step is not None and step > 1:
                top = 10 ** len(number)
                self.lost |= {(int(number) - k) % top for k in range(1, min(step, _WRAPPED))}
            self.last, self.held, self._astray = name, "", False
        self._fresh, self._fresh_now = (None if accepted else self._fresh_now), None

    @property
    def may_begin_anew(self) -> bool:
        """Whether the capture before brought a number that a new count may have."""
        return self._fresh is not None
