"""Words that people write, beside those that are known."""

from __future__ import annotations

import difflib
import math
import os
from collections.abc import Collection, Sequence
from pathlib import PurePath


def did_you_mean(word: str, known: Collection[str], otherwise: str | None = None) -> str:
    """A remedy for an unknown ``word``: the nearest of the known ones, or else what there is.

    ``otherwise`` is said where nothing known comes close; without it, all that is known.
    """
    close = difflib.get_close_matches(word, known, 1, 0.5)
    if close:
        return f"did you mean {close[0]}?"
    return f"choose one of {', '.join(known)}" if otherwise is None else otherwise


def as_text(name: str | PurePath) -> str:
    """A file's name as one line of text; by their codes what is no text, or moves the cursor."""
    text = os.fsencode(name).decode("utf-8", "backslashreplace")
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def percent_cut(share: float, decimals: int = 2) -> str:
    """A share (0 to 1) in percent with ``decimals`` places, cut: 100 says that it is all of it."""
    scale = 10.0**decimals
    # A binary 0.29 is a little less than 0.29: what only rounding took away is given back.
    return f"{math.floor(100.0 * share * scale + 1e-9) / scale:.{decimals}f} %"


def counted(count: int, noun: str) -> str:
    """How many of something, such as ``1 capture`` and ``2 captures``."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def of_limits(broken: Sequence[str], most: int = 6) -> str:
    """Limits by their kind, with what they are of: ``scale (cam01, cam02); coverage``.

    ``broken`` are names such as ``scale/cam01``. Of each kind ``most`` are named, the rest counted.
    """
    groups: dict[str, list[str]] = {}
    for name in broken:
        kind, _, what = name.partition("/")
        groups.setdefault(kind, []).extend([what] if what else [])
    words = []
    for kind, ones in groups.items():
        named = ones if len(ones) <= most else [*ones[:most], f"{len(ones) - most} more"]
        words.append(f"{kind} ({', '.join(named)})" if named else kind)
    return "; ".join(words)
