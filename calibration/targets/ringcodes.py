"""Codes of ring targets: words that stay themselves however a target is turned.

A code word of ``bits`` bits stands on the ring round a dot, and nothing marks its first bit. So
all rotations of a word are one code. The words of a family are taken in rising order of their
smallest rotation; a word is left out when it is too near to one already taken. The numbering
that follows is Rigwright's own. It is not that of any other maker's targets.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from common.errors import InputError

BITS = (12, 14)


def rotations(word: int, bits: int) -> tuple[int, ...]:
    """The word turned by 0, 1, ... ``bits - 1`` places."""
    mask = (1 << bits) - 1
    return tuple(((word << k) | (word >> (bits - k))) & mask for k in range(bits))


def mirrored(word: int, bits: int) -> int:
    """The word as read in a mirror."""
    return int(format(word, f"0{bits}b")[::-1], 2)


def canonical(word: int, bits: int) -> int:
    """The smallest rotation of the word: the name of its class."""
    return min(rotations(word, bits))


def _longest_run(word: int, bits: int) -> int:
    text = format(word, f"0{bits}b") * 2
    return max(map(len, text.replace("01", "0 1").replace("10", "1 0").split()))


@dataclass(frozen=True)
class RingCodeFamily:
    """Which words a set of ring targets uses.

    ``mirror_unique``: no code is another one's mirror image, so a picture that was mirrored is
    noticed. ``complement_unique``: no code is another one with black and white exchanged.
    ``distance``: how many bits must be misread before one code becomes another (1 or 2; with
    2 a single misread bit is noticed). No word has a run longer than half the ring, so that
    every code shows enough of its ring to measure. Raises :class:`InputError`.
    """

    bits: int = 12
    mirror_unique: bool = True
    complement_unique: bool = False
    distance: int = 2

    def __post_init__(self) -> None:
        if self.bits not in BITS or self.distance not in (1, 2):
            raise InputError(
                "ring-code",
                f"there are no ring codes of {self.bits} bits and distance {self.distance}",
                "choose 12 or 14 bits and a distance of 1 or 2",
            )

    def relatives(self, word: int) -> frozenset[int]:
        """All words that count as the same code."""
        words = set(rotations(word, self.bits))
        if self.mirror_unique:
            words |= set(rotations(mirrored(word, self.bits), self.bits))
        if self.complement_unique:
            mask = (1 << self.bits) - 1
            words |= {mask ^ w for w in words}
        return frozenset(words)

    @cached_property
    def words(self) -> tuple[int, ...]:
        """The code words in order; a target's number is its place, counted from 1."""
        chosen: list[int] = []
        taken: set[int] = set()
        for word in range(1, (1 << self.bits) - 1):
            if word in taken or canonical(word, self.bits) != word:
                continue
            if _longest_run(word, self.bits) > self.bits // 2:
                continue
            relatives = self.relatives(word)
            if not taken.isdisjoint(relatives):
                continue
            chosen.append(word)
            taken |= relatives
            if self.distance == 2:
                taken |= {w ^ (1 << k) for w in relatives for k in range(self.bits)}
        return tuple(chosen)

    @cached_property
    def _numbers(self) -> dict[int, int]:
        return {word: number for number, word in enumerate(self.words, 1)}

    def word(self, number: int) -> int:
        """The code word of a target number; raises :class:`InputError` when there is none."""
        if not 1 <= number <= len(self.words):
            raise InputError(
                "ring-number",
                f"there is no ring target {number} of {self.bits} bits in this family",
                f"choose numbers from 1 to {len(self.words)}, 14 bits, or a distance of 1",
            )
        return self.words[number - 1]

    def number(self, word: int) -> int | None:
        """The number of the target that shows ``word`` in any rotation, None when none does."""
        return self._numbers.get(canonical(word, self.bits))

    def mirror_number(self, word: int) -> int | None:
        """The number of the target that a mirror would turn into ``word``; None for none.

        None too for a code that looks the same in a mirror: it tells nothing.
        """
        turned = canonical(mirrored(word, self.bits), self.bits)
        return None if turned == canonical(word, self.bits) else self._numbers.get(turned)
