"""EXIF for pictures: what photogrammetry programs look for, written where it is absent."""

from __future__ import annotations

import math
import struct
import zlib
from dataclasses import dataclass
from datetime import datetime
from io import BytesIO

from PIL import Image
from PIL.ExifTags import IFD, Base
from PIL.TiffImagePlugin import IFDRational

LARGEST_SEGMENT = 65_533
DENOMINATOR = 1_000_000


@dataclass(frozen=True)
class PictureFacts:
    """What is known of a picture beside its pixels. Empty strings and None are left out."""

    unique_id: str
    taken_at: datetime
    make: str = ""
    model: str = ""
    serial_number: str = ""
    exposure_us: float | None = None
    f_number: float | None = None
    iso: int | None = None
    focal_length_mm: float | None = None


def exif_of(facts: PictureFacts) -> Image.Exif:
    """The facts as EXIF tags."""
    exif = Image.Exif()
    for tag, value in _main_tags(facts).items():
        exif[tag] = value
    exif.get_ifd(IFD.Exif).update(_exif_tags(facts))
    return exif


def _main_tags(facts: PictureFacts) -> dict[int, object]:
    tags: dict[int, object] = {
        Base.Make: _ascii(facts.make),
        Base.Model: _ascii(facts.model),
        Base.Software: "Rigwright",
        Base.DateTime: facts.taken_at.strftime("%Y:%m:%d %H:%M:%S"),
    }
    return {int(tag): value for tag, value in tags.items() if value}


def _exif_tags(facts: PictureFacts) -> dict[int, object]:
    offset = facts.taken_at.strftime("%z")
    exposure_s = None if facts.exposure_us is None else facts.exposure_us / 1e6
    tags: dict[int, object] = {
        Base.ExifVersion: b"0232",
        Base.DateTimeOriginal: facts.taken_at.strftime("%Y:%m:%d %H:%M:%S"),
        Base.SubsecTimeOriginal: facts.taken_at.strftime("%f"),
        Base.OffsetTimeOriginal: f"{offset[:3]}:{offset[3:5]}" if offset else "",
        Base.ExposureTime: _rational(exposure_s),
        Base.FNumber: _rational(facts.f_number),
        Base.ISOSpeedRatings: facts.iso,
        Base.FocalLength: _rational(facts.focal_length_mm),
        Base.BodySerialNumber: _ascii(facts.serial_number),
        Base.ImageUniqueID: _ascii(facts.unique_id),
    }
    return {int(tag): value for tag, value in tags.items() if value not in (None, "")}


def _ascii(text: str) -> str:
    """EXIF text is ASCII; other letters would make readers refuse the whole block."""
    return text.encode("ascii", "replace").decode()


def _rational(value: float | None) -> IFDRational | None:
    if value is None or not math.isfinite(value) or value <= 0.0:
        return None
    return IFDRational(round(value * DENOMINATOR), DENOMINATOR)


def with_exif(data: bytes, facts: PictureFacts) -> bytes:
    """A camera's JPEG with what its EXIF lacks; the picture itself is not coded again.

    A file whose EXIF holds a maker note stays as it is, bit for bit: maker notes point into
    their own block and break when it is written anew. So does a file that is no sound JPEG.
    """
    if not data.startswith(b"\xff\xd8"):
        return data
    try:
        exif = Image.open(BytesIO(data)).getexif()
        details = exif.get_ifd(IFD.Exif)
    except (OSError, SyntaxError, ValueError, struct.error):
        # Damaged files are filed as they came; they are named as unreadable elsewhere.
        return data
    if Base.MakerNote in details:
        return data
    for tag, value in _main_tags(facts).items():
        exif.setdefault(tag, value)
    for tag, value in _exif_tags(facts).items():
        details.setdefault(tag, value)
    block = exif.tobytes()
    if not block.startswith(b"Exif\0\0"):
        block = b"Exif\0\0" + block
    if len(block) > LARGEST_SEGMENT:
        return data
    segment = b"\xff\xe1" + struct.pack(">H", len(block) + 2) + block
    return data[:2] + segment + _without_exif(data[2:])


def _without_exif(rest: bytes) -> bytes:
    """JPEG segments without the EXIF one; stops at the first that is not an APP segment."""
    kept, at = b"", 0
    while rest[at : at + 1] == b"\xff" and 0xE0 <= rest[at + 1] <= 0xEF:
        end = at + 2 + int.from_bytes(rest[at + 2 : at + 4], "big")
        if rest[at + 4 : at + 10] != b"Exif\0\0":
            kept += rest[at:end]
        at = end
    return kept + rest[at:]


def png_with_exif(data: bytes, facts: PictureFacts) -> bytes:
    """A PNG with an eXIf chunk behind its header."""
    block = exif_of(facts).tobytes().removeprefix(b"Exif\0\0")
    body = b"eXIf" + block
    chunk = struct.pack(">I", len(block)) + body + struct.pack(">I", zlib.crc32(body))
    after_header = 8 + 25
    return data[:after_header] + chunk + data[after_header:]
