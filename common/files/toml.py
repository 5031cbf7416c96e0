"""Files that people write as TOML: read with a limit, and with one-line errors of their kind."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from common.errors import InputError
from common.files.reading import BYTE_ORDER_MARK, readable

LARGEST_FILE_BYTES = 1_000_000
"""What people write by hand is a page or two; a larger file is another one, given by mistake."""

_PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+"""
_MANY_PARTS = re.compile(rf"(?<![\w-])(?:{_PART}){{100}}")
"""A key of so many parts is nobody's, and the time to read one grows as their square."""


def read_text(path: Path, kind: str, words: str, largest_bytes: int = LARGEST_FILE_BYTES) -> str:
    """The text of a file; ``kind`` stands in error codes, ``words`` says what it is.

    Raises :class:`InputError` ``<kind>-unreadable`` and ``<kind>-not-toml``,
    :class:`TooLargeError` ``<kind>-too-large``.
    """
    remedy = f"give a {words} as TOML"
    with readable(path, kind, words, remedy, largest_bytes):
        try:
            return path.read_text(encoding="utf-8")
        except UnicodeDecodeError as error:
            problem = f"{path.name} is not a text file"
            raise InputError(f"{kind}-not-toml", problem, remedy) from error


def parsed(text: str, name: str, kind: str, words: str) -> dict[str, Any]:
    """A file's text as data; ``name`` stands in front of the error.

    A mark of the byte order, which some editors put in front unseen, is left out of account.
    """
    try:
        if _MANY_PARTS.search(text):
            raise RecursionError
        return tomllib.loads(text.removeprefix(BYTE_ORDER_MARK))
    except tomllib.TOMLDecodeError as error:
        why = str(error)
    except ValueError:
        why = "a number in it has more digits than can be read"
    except RecursionError:
        why = "it is nested too deeply"
    problem = f"{name} is not a {words}: {why}"
    raise InputError(f"{kind}-not-toml", problem, "write it as TOML")
