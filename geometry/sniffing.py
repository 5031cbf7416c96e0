"""What kind of scan a file is and how much it declares to hold, before anything is loaded."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from common.errors import InputError, NotFoundError, TooLargeError
from geometry.containers import check_glb, check_gltf, check_threemf
from geometry.scanlimits import MAX_FILE_BYTES, check_counts, format_error

KINDS = {
    ".glb": "GLB",
    ".gltf": "glTF",
    ".obj": "OBJ",
    ".ply": "PLY",
    ".stl": "STL",
    ".3mf": "3MF",
    ".off": "OFF",
    ".xyz": "XYZ",
    ".txt": "XYZ",
    ".csv": "XYZ",
    ".asc": "XYZ",
}
"""Kind of scan by file extension."""

_MAGIC = (
    (b"PK\x03\x04", "ZIP archive", "3MF"),
    (b"glTF", "GLB file", "GLB"),
    (b"ply\n", "PLY file", "PLY"),
    (b"ply\r", "PLY file", "PLY"),
    (b"\x1f\x8b", "gzip archive", ""),
    (b"\x89PNG", "PNG image", ""),
    (b"\xff\xd8\xff", "JPEG image", ""),
    (b"%PDF", "PDF document", ""),
    (b"Kaydara FBX", "FBX file", ""),
)
_NEEDS_MAGIC = ("GLB", "PLY", "3MF")
_TEXT_KINDS = ("OBJ", "OFF", "XYZ", "glTF")
_STL_HEADER_BYTES, _STL_FACE_BYTES = 84, 50
_CHUNK_BYTES = 1 << 22
_HEAD_BYTES = 1 << 16


def check_file(path: Path) -> str:
    """The kind of the scan at ``path``, after its size, content and declared counts are checked.

    Raises :class:`NotFoundError` when there is no such file, :class:`TooLargeError` when it is
    or declares too much, :class:`InputError` when the content is not what the name says.
    """
    if not path.is_file():
        folder = path.is_dir()
        what = f"{path.name!r} is a folder" if folder else f"there is no file {path.name!r}"
        raise NotFoundError("scan-file", what, "check the path of the scan")
    kind = KINDS.get(path.suffix.lower())
    if kind is None:
        known = ", ".join(sorted(set(KINDS.values())))
        problem = f"files named {path.suffix or 'without extension'!r} are not known as scans"
        raise InputError("scan-format", problem, f"export the scan as one of {known}")
    size = path.stat().st_size
    if size == 0:
        raise InputError(
            "scan-empty", "the scan file is empty", "export it again with its geometry"
        )
    if size > MAX_FILE_BYTES:
        problem = (
            f"the scan file has {size / 2**30:.1f} GiB; at most {MAX_FILE_BYTES >> 30} GiB is read"
        )
        raise TooLargeError("scan-file-size", problem, "decimate the scan and export it again")
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    _check_magic(kind, head)
    _check_declared(path, kind, head, size)
    return kind


def _check_magic(kind: str, head: bytes) -> None:
    for magic, name, its_kind in _MAGIC:
        if head.startswith(magic) and its_kind != kind:
            remedy = f"name it by what it is, or export the scan as {kind}"
            raise InputError("scan-format", f"the file is a {name}, not {kind}", remedy)
    if kind in _NEEDS_MAGIC and not any(head.startswith(m) for m, _, k in _MAGIC if k == kind):
        raise format_error(kind, "it does not begin as one")
    # Text may come as UTF-16 from a spreadsheet; that too has NUL bytes and is not read.
    if kind in _TEXT_KINDS and not (kind == "OFF" and b"BINARY" in head[:64]) and b"\0" in head:
        raise format_error(kind, "it is binary, not plain text")


def _check_declared(path: Path, kind: str, head: bytes, size: int) -> None:
    if kind == "GLB":
        check_glb(path, size)
    elif kind == "glTF":
        check_gltf(path)
    elif kind == "3MF":
        check_threemf(path)
    elif kind == "PLY":
        check_counts(_ply_count(head, b"face"), _ply_count(head, b"vertex"))
    elif kind == "STL":
        check_counts(_stl_faces(path, head, size), 0)
    elif kind == "OFF":
        check_counts(*_off_counts(head))
    elif kind == "OBJ":
        check_counts(_count(path, b"\nf "), _count(path, b"\nv "))
    else:
        check_counts(0, _count(path, b"\n"))


def _ply_count(head: bytes, element: bytes) -> int:
    match = re.search(rb"^element[ \t]+" + element + rb"[ \t]+(\d{1,18})", head, re.MULTILINE)
    return int(match[1]) if match else 0


def _stl_faces(path: Path, head: bytes, size: int) -> int:
    declared = int.from_bytes(head[80:84], "little") if len(head) >= _STL_HEADER_BYTES else 0
    expected = _STL_HEADER_BYTES + _STL_FACE_BYTES * declared
    # Binary files may begin with "solid" too, so only NUL bytes or a fitting size tell them apart.
    if size == expected or not head.lstrip().lower().startswith(b"solid") or b"\0" in head:
        check_counts(declared, 0)
        if size != expected:
            raise format_error("STL", "its length does not match the number of faces it declares")
        return declared
    return _count(path, b"endfacet")


def _off_counts(head: bytes) -> tuple[int, int]:
    """Faces and vertices that an OFF header declares."""
    lines = (line.split(b"#")[0].strip() for line in head.splitlines())
    words = b" ".join(line for line in lines if line)[:256].split()
    if not words or not words[0].upper().endswith(b"OFF"):
        raise format_error("OFF", "it does not begin with the word OFF")
    numbers = [int(w) for w in words[1:4] if w.isdigit() and len(w) < 19]
    if len(numbers) < 2:
        raise format_error("OFF", "its numbers of vertices and faces are missing")
    return numbers[1], numbers[0]


def _count(path: Path, token: bytes) -> int:
    """How often ``token`` occurs, in constant memory."""
    return sum(chunk.count(token) for chunk in _overlapping_chunks(path, len(token) - 1))


def _overlapping_chunks(path: Path, overlap: int) -> Iterator[bytes]:
    # The overlap is one byte shorter than the token: long enough that none is missed at a seam,
    # too short for one to be counted twice.
    with path.open("rb") as file:
        tail = b"\n"[:overlap]
        while chunk := file.read(_CHUNK_BYTES):
            yield tail + chunk
            tail = chunk[len(chunk) - overlap :] if overlap else b""
