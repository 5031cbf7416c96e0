"""Ways of writing scans as text that the readers of the formats do not know."""

from __future__ import annotations

import re

import numpy as np

from geometry.arrays import Ints
from geometry.scanlimits import format_error

_NEGATIVE = re.compile(rb"^[ \t]*f[ \t][^\n]*-", re.MULTILINE)
_COMMA_VERTEX = re.compile(rb"^[ \t]*v[nt]?[ \t]+[-+]?\d*,\d", re.MULTILINE)
_COMMA_NUMBER = re.compile(r"[-+]?\d*(,\d+)?([eE][-+]?\d+)?")
_DECIMAL_COMMA = re.compile(rb"(?<![\d.,])[-+]?\d+,\d+([eE][-+]?\d+)?(?=[\s;]|$)")
_PADDED = re.compile(r"0\d+")
_LINES_LOOKED_AT = 200


def has_decimal_commas(head: bytes) -> bool:
    """Whether numbers at the beginning of a text file have commas for points."""
    return b"\0" not in head and _DECIMAL_COMMA.search(head) is not None


def plain_obj(text: bytes) -> bytes:
    """An OBJ file with decimal points and with indices from its beginning.

    Negative indices count back from the line they stand in (the format's specification, 1995);
    the reader counts them from the end of the file.
    """
    if _COMMA_VERTEX.search(text):
        text = text.replace(b",", b".")
    return _counted(text) if _NEGATIVE.search(text) else text


def _counted(text: bytes) -> bytes:
    seen = {b"v": 0, b"vt": 0, b"vn": 0}
    lines = text.splitlines()
    for number, line in enumerate(lines):
        words = line.split()
        if not words:
            continue
        if words[0] in seen:
            seen[words[0]] += 1
        elif words[0] == b"f" and b"-" in line:
            counts = tuple(seen.values())
            lines[number] = b"f " + b" ".join(_corner(word, counts) for word in words[1:])
    return b"\n".join(lines) + b"\n"


def _corner(word: bytes, counts: tuple[int, ...]) -> bytes:
    parts = word.split(b"/")
    for k, (part, count) in enumerate(zip(parts, counts, strict=False)):
        if part.startswith(b"-"):
            index = count + 1 + int(part)
            if index < 1:
                raise format_error(
                    "OBJ", f"a face counts back to before its first vertex ({part.decode()})"
                )
            parts[k] = b"%d" % index
    return b"/".join(parts)


def plain_points(text: str) -> str:
    """Points as text with decimal points and blanks between the numbers.

    Raises :class:`~common.errors.InputError` where a comma may be either.
    """
    text = text.replace(";", " ")
    if "," not in text:
        return text
    lines = [line.split("#")[0].strip() for line in text.splitlines()]
    looked_at = [line for line in lines if line][:_LINES_LOOKED_AT]
    split = [line.split() for line in looked_at]
    if split and all(
        len(words) >= 3 and all(_COMMA_NUMBER.fullmatch(word) for word in words) for words in split
    ):
        return text.replace(",", ".")
    _refuse_both(looked_at)
    return text.replace(",", " ")


def _refuse_both(lines: list[str]) -> None:
    rows = [line.replace(" ", "").split(",") for line in lines]
    if any("." in line for line in lines) or any(len(row) < 6 or len(row) % 2 for row in rows):
        return
    # Only what follows a decimal comma begins with zeros.
    if any(_PADDED.fullmatch(word) for row in rows for word in row[1::2]):
        raise format_error("XYZ", "commas stand both within its numbers and between them")


def strip_faces(corners: Ints) -> Ints:
    """Triangles (n, 3) of strips of vertices (m,), one after the other with -1 between.

    Every other triangle of a strip is wound the other way about.
    """
    ends = np.flatnonzero(np.append(corners, -1) < 0)
    faces = []
    start = 0
    for end in ends.tolist():
        strip = corners[start:end]
        start = end + 1
        if len(strip) < 3:
            continue
        rows = np.stack([strip[:-2], strip[1:-1], strip[2:]], axis=1)
        rows[1::2] = rows[1::2, [1, 0, 2]]
        faces.append(rows)
    return np.concatenate(faces) if faces else np.zeros((0, 3), dtype=np.int64)
