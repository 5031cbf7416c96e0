"""What a picture file says of its body, its moment and its exposure."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

TAGS = {
    "Make": ("Image Make",),
    "Model": ("Image Model",),
    "BodySerialNumber": ("EXIF BodySerialNumber", "MakerNote SerialNumber"),
    "DateTimeOriginal": ("EXIF DateTimeOriginal",),
    "SubSecTimeOriginal": ("EXIF SubSecTimeOriginal",),
    "OffsetTimeOriginal": ("EXIF OffsetTimeOriginal",),
    "ExposureTime": ("EXIF ExposureTime",),
    "FNumber": ("EXIF FNumber",),
    "ISOSpeedRatings": ("EXIF ISOSpeedRatings",),
}
"""Our name of a tag, then where files keep it."""


TIME_TAGS = ("DateTimeOriginal", "SubSecTimeOriginal", "OffsetTimeOriginal")
"""Those of :data:`TAGS` that say when."""


def read_exif(path: Path) -> Mapping[str, str]:
    """The tags of :data:`TAGS` that the file has, as text; empty when it has none.

    A body's number that stands only in the maker's notes (older bodies) is found too. OSError
    when the file cannot be opened.
    """
    found = _process(path, details=False)
    if found and "EXIF BodySerialNumber" not in found:
        found = _process(path, details=True) or found
    texts = {}
    for name, places in TAGS.items():
        text = next((str(found[place]).strip() for place in places if place in found), "")
        if text:
            texts[name] = text
    return texts


def _process(path: Path, *, details: bool) -> Mapping[str, Any]:
    import exifread

    # It warns of every file without EXIF, which is none of the user's business.
    logging.getLogger("exifread").setLevel(logging.ERROR)
    with path.open("rb") as file:
        try:
            return dict(exifread.process_file(file, details=details))
        except Exception:  # noqa: BLE001  makers' notes break parsers in any way; the picture is good
            return {}


def exposure_us(tags: Mapping[str, str]) -> float | None:
    """The exposure in microseconds, where the file tells it."""
    above, slash, below = tags.get("ExposureTime", "").partition("/")
    try:
        return float(above) / (float(below) if slash else 1.0) * 1e6
    except (ValueError, ZeroDivisionError):
        return None
