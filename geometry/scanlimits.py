"""How large a scan may be, and the errors of scans that are larger or broken."""

from __future__ import annotations

from common.errors import InputError, TooLargeError

MAX_FILE_BYTES = 1 << 30
"""Largest scan file, and largest sum of what it unpacks to or refers to."""

MAX_FACES = 5_000_000
"""Most faces of a scan."""

MAX_POINTS = 15_000_000
"""Most vertices of a file: three for each face, as in formats that do not share vertices."""


MAX_SHARED_POINTS = 3_000_000
"""Most vertices of a 3MF, whose faces share them: a closed mesh has half as many as faces."""

MAX_GROWTH = 100
"""How many times its own size an archive may unpack to; meshes as text unpack to some ten times."""

GROWTH_FREE_BYTES = 1 << 26
"""What an archive may unpack to whatever its own size."""


def check_counts(faces: int, points: int) -> None:
    """Raise :class:`TooLargeError` for more faces or points than are accepted."""
    for count, limit, what in ((faces, MAX_FACES, "faces"), (points, MAX_POINTS, "points")):
        if count > limit:
            problem = f"the scan has {count:,} {what}; at most {limit:,} are read"
            raise TooLargeError(f"scan-{what}", problem, "decimate it, 200,000 faces are plenty")


def format_error(kind: str, reason: str) -> InputError:
    """The error for a file that is not the ``kind`` it claims to be."""
    problem = f"the file is not a sound {kind} file: {reason}"
    return InputError("scan-format", problem, "export the scan again")
