"""Whether an image file is all there: programs that fetch pictures write them bit by bit."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

MEDIA_TYPES = {
    ".jpg": "image/jpeg",
    ".jpeg": "image/jpeg",
    ".png": "image/png",
    ".tif": "image/tiff",
    ".tiff": "image/tiff",
    ".heic": "image/heic",
    ".nef": "image/x-nikon-nef",
    ".cr2": "image/x-canon-cr2",
    ".cr3": "image/x-canon-cr3",
    ".arw": "image/x-sony-arw",
    ".dng": "image/x-adobe-dng",
    ".orf": "image/x-olympus-orf",
    ".rw2": "image/x-panasonic-rw2",
    ".pef": "image/x-pentax-pef",
    ".raf": "image/x-fuji-raf",
}
"""Kinds of files that are pictures, by suffix in small letters."""

_TIFF_MAGIC = {b"II*\0": "<", b"MM\0*": ">", b"IIU\0": "<", b"IIRO": "<", b"IIRS": "<"}
_TIFF_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 13: 4}
_PARTS = ((273, 279), (324, 325), (513, 514))
"""Tags of where parts of the picture lie, and of how long they are: strips, tiles, JPEG."""
_SUB_IFDS = (330, 34665)
_MAX_IFDS = 64
SECTOR = 512
_PIECE = 1 << 20
_MAX_PARTS = 1 << 18
"""Of a picture, in all its directories: one strip for each row of the largest sensor is a tenth."""


def is_whole(path: Path) -> bool:
    """Whether the file has everything its own header promises.

    JPEG to its end mark, PNG to its last chunk, TIFF and the raw formats built on it to the last
    strip, HEIC and CR3 to the last box, Fuji's RAF to the end of its three parts. False for a
    file that cannot be read or is not what its suffix says.
    """
    suffix = path.suffix.lower()
    try:
        with path.open("rb") as file:
            size = path.stat().st_size
            if suffix in (".jpg", ".jpeg"):
                return _jpeg(file)
            if suffix == ".png":
                return _png(file, size)
            if suffix in (".cr3", ".heic"):
                return _boxes(file, size)
            if suffix == ".raf":
                return _raf(file, size)
            return _tiff(file, size)
    except (OSError, struct.error, ValueError):
        return False


def has_gaps(path: Path) -> bool:
    """Whether a whole sector of the picture is zeros: room that was made and is not yet filled.

    Programs that copy set a file's size first, and its header may come before its picture. True
    too for pictures that are truly black, where nothing compresses them. OSError when it is gone.
    """
    with path.open("rb") as file:
        size = path.stat().st_size
        try:
            parts = _apart(_tiff_parts(file, size), size) or [(0, size)]
        except (struct.error, ValueError):
            parts = [(0, size)]
        return any(_empty_sector(file, begin, end) for begin, end in parts)


def _apart(parts: list[tuple[int, int]], size: int) -> list[tuple[int, int]]:
    """The same places of the file, each once: a directory may name one as often as it likes."""
    apart: list[tuple[int, int]] = []
    for begin, end in sorted(parts):
        if apart and begin <= apart[-1][1]:
            apart[-1] = apart[-1][0], min(max(end, apart[-1][1]), size)
        elif begin < size:
            apart.append((begin, min(end, size)))
    return apart


def _empty_sector(file: BinaryIO, begin: int, end: int) -> bool:
    place = -(-begin // SECTOR) * SECTOR
    file.seek(place)
    while place + SECTOR <= end:
        piece = file.read(min(_PIECE, end - place))
        for start in range(0, len(piece) - SECTOR + 1, SECTOR):
            if piece[start] == 0 and not any(piece[start : start + SECTOR]):
                return True
        if not piece:
            break
        place += len(piece)
    return False


def _read(file: BinaryIO, form: str) -> tuple[int, ...]:
    return struct.unpack(form, file.read(struct.calcsize(form)))


def _raf(file: BinaryIO, size: int) -> bool:
    """Whether the three parts that Fuji's header names lie within the file.

    At byte 84 stand offset and length of the JPEG preview, of the raw picture's own header and of
    the raw picture, in big-endian numbers.
    """
    if file.read(16) != b"FUJIFILMCCD-RAW ":
        return False
    file.seek(84)
    places = _read(file, ">6I")
    parts = list(zip(places[::2], places[1::2], strict=True))
    return all(start >= 108 and start + length <= size for start, length in parts)


def _jpeg(file: BinaryIO) -> bool:
    if file.read(2) != b"\xff\xd8":
        return False
    while True:
        start, kind = _read(file, ">BB")
        while kind == 0xFF:
            (kind,) = _read(file, ">B")
        if start != 0xFF:
            return False
        (length,) = _read(file, ">H")
        if length < 2:
            return False
        file.seek(length - 2, 1)
        if kind == 0xDA:
            # From here on FF stands before 00 or a mark, so an end mark is the end; the one of
            # the small preview lies in a segment before.
            return b"\xff\xd9" in file.read()


def _png(file: BinaryIO, size: int) -> bool:
    if file.read(8) != b"\x89PNG\r\n\x1a\n":
        return False
    while file.tell() + 12 <= size:
        length, kind = struct.unpack(">I4s", file.read(8))
        file.seek(length + 4, 1)
        if kind == b"IEND":
            return file.tell() <= size
    return False


def _boxes(file: BinaryIO, size: int) -> bool:
    kinds = set()
    while file.tell() < size:
        begin = file.tell()
        length, kind = struct.unpack(">I4s", file.read(8))
        if length == 1:
            (length,) = _read(file, ">Q")
        kinds.add(kind)
        if length == 0:
            break
        if length < 8 or begin + length > size:
            return False
        file.seek(begin + length)
    return {b"ftyp", b"mdat"} <= kinds


def _tiff(file: BinaryIO, size: int) -> bool:
    parts = _tiff_parts(file, size)
    return bool(parts) and all(begin <= end <= size for begin, end in parts)


def _tiff_parts(file: BinaryIO, size: int) -> list[tuple[int, int]]:
    """Where the parts of the picture lie, begin and end; none for what is no such file.

    ValueError and struct.error where a directory is not there.
    """
    order = _TIFF_MAGIC.get(file.read(4))
    if order is None:
        return []
    (first,) = _read(file, order + "I")
    todo, seen, parts = [first], set[int](), list[tuple[int, int]]()
    while todo:
        place = todo.pop()
        if place == 0 or place in seen:
            continue
        seen.add(place)
        if len(seen) > _MAX_IFDS or place + 2 > size:
            raise ValueError("a directory lies beyond the end")
        tags, following = _ifd(file, order, place, size)
        todo += [following, *(offset for tag in _SUB_IFDS for offset in tags.get(tag, ()))]
        parts += _extents(tags)
        if len(parts) > _MAX_PARTS:
            raise ValueError("there are more parts than a picture has")
    return parts


def _ifd(file: BinaryIO, order: str, place: int, size: int) -> tuple[dict[int, list[int]], int]:
    """The tags that matter of one directory, and where the next directory is."""
    file.seek(place)
    (count,) = _read(file, order + "H")
    raw = file.read(12 * count)
    (following,) = _read(file, order + "I")
    wanted = {*_SUB_IFDS, *(tag for pair in _PARTS for tag in pair)}
    tags = {}
    for entry in range(count):
        tag, kind, number = struct.unpack_from(order + "HHI", raw, 12 * entry)
        length = _TIFF_SIZES.get(kind, 0) * number
        if tag not in wanted:
            if length > 4:
                (begin,) = struct.unpack_from(order + "I", raw, 12 * entry + 8)
                if begin + length > size:
                    raise ValueError("a value lies beyond the end")
            continue
        tags[tag] = _values(file, order, kind, number, raw[12 * entry + 8 : 12 * entry + 12])
    return tags, following


def _values(file: BinaryIO, order: str, kind: int, number: int, inline: bytes) -> list[int]:
    letter = {3: "H", 4: "I", 13: "I"}.get(kind)
    if letter is None or number > _MAX_PARTS:
        return []
    form = f"{order}{number}{letter}"
    if struct.calcsize(form) <= 4:
        return list(struct.unpack_from(form, inline))
    file.seek(struct.unpack(order + "I", inline)[0])
    return list(_read(file, form))


def _extents(tags: dict[int, list[int]]) -> Iterator[tuple[int, int]]:
    for where, how_long in _PARTS:
        for begin, length in zip(tags.get(where, ()), tags.get(how_long, ()), strict=False):
            yield begin, begin + length
