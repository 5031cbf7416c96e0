"""Words that people write, beside those that are known."""

from __future__ import annotations

import difflib
from collections.abc import Collection


def did_you_mean(word: str, known: Collection[str], otherwise: str | None = None) -> str:
    """A remedy for an unknown ``word``: the nearest of the known ones, or else what there is.

    ``otherwise`` is said where nothing known comes close; without it, all that is known.
    """
    close = difflib.get_close_matches(word, known, 1, 0.5)
    if close:
        return f"did you mean {close[0]}?"
    return f"choose one of {', '.join(known)}" if otherwise is None else otherwise
