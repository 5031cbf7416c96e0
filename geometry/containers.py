"""Checks on the two scan formats that are containers: glTF (JSON and buffers) and 3MF (ZIP)."""

from __future__ import annotations

import json
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any
from urllib.parse import unquote

from common.errors import InputError, TooLargeError
from geometry.scanlimits import (
    GROWTH_FREE_BYTES,
    MAX_FILE_BYTES,
    MAX_GROWTH,
    MAX_SHARED_POINTS,
    check_counts,
    format_error,
)

_GLB_HEADER_BYTES = 20
_TRIANGLES = 4


def check_glb(path: Path, size: int) -> None:
    """Raise :class:`InputError` for a GLB whose header, counts or references are not acceptable."""
    with path.open("rb") as file:
        head = file.read(_GLB_HEADER_BYTES)
        length, chunk = int.from_bytes(head[8:12], "little"), int.from_bytes(head[12:16], "little")
        if length != size or len(head) < _GLB_HEADER_BYTES or chunk > size - _GLB_HEADER_BYTES:
            raise format_error("GLB", "it is cut short or its header gives a wrong length")
        _check_document(file.read(chunk), path, "GLB")


def check_gltf(path: Path) -> None:
    """Raise :class:`InputError` for a glTF whose counts or references are not acceptable."""
    _check_document(path.read_bytes(), path, "glTF")


def _check_document(text: bytes, path: Path, kind: str) -> None:
    # The document is untrusted and any value may have any type; what does not fit is refused here
    # in one place rather than tested for at every step down.
    try:
        document = json.loads(text)
        _check_references(document, path)
        faces, points = _gltf_counts(document)
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError) as error:
        raise format_error(kind, "its JSON part is broken") from error
    check_counts(faces, points)


def _check_references(document: dict[str, Any], path: Path) -> None:
    required = [name for name in document.get("extensionsRequired", []) if "compression" in name]
    if required:
        problem = f"the file is compressed with {required[0]}, which is not read"
        raise InputError("scan-format", problem, "export it without mesh compression")
    total = 0
    for entry in [*document.get("buffers", []), *document.get("images", [])]:
        uri = entry.get("uri")
        if uri is None or uri.startswith("data:"):
            continue
        plain = unquote(uri).replace("\\", "/")
        if plain.startswith("/") or ":" in plain or ".." in plain.split("/"):
            problem = "the file refers to data outside its own folder"
            raise InputError("scan-reference", problem, "export it as GLB, which holds everything")
        beside = path.parent / plain
        total += beside.stat().st_size if beside.is_file() else 0
    if total > MAX_FILE_BYTES:
        problem = "the files that the scan refers to are larger than 1 GiB"
        raise TooLargeError("scan-file-size", problem, "decimate the scan and export it again")


def _gltf_counts(document: dict[str, Any]) -> tuple[int, int]:
    """Faces and points once the scene graph is laid out flat."""
    nodes = document.get("nodes", [])
    children = Counter(child for node in nodes for child in node.get("children", []))
    # glTF gives a node one parent at most. A file that breaks this can grow exponentially.
    if children and max(children.values()) > 1:
        raise ValueError("a node has two parents")
    uses = Counter(node["mesh"] for node in nodes if "mesh" in node)
    accessors = document.get("accessors", [])
    faces = points = 0
    for index, mesh in enumerate(document.get("meshes", [])):
        for primitive in mesh.get("primitives", []):
            vertices = int(accessors[primitive["attributes"]["POSITION"]]["count"])
            corners = primitive.get("indices")
            corners = vertices if corners is None else int(accessors[corners]["count"])
            # Strips and fans make about one triangle for each corner.
            step = 3 if primitive.get("mode", _TRIANGLES) == _TRIANGLES else 1
            faces += max(uses[index], 1) * corners // step
            points += max(uses[index], 1) * vertices
    # An accessor that no mesh uses is unpacked all the same.
    return faces, max([points, *(int(accessor["count"]) for accessor in accessors)])


def check_threemf(path: Path) -> None:
    """Raise :class:`InputError` for a 3MF that is no sound archive or unpacks to too much."""
    try:
        with zipfile.ZipFile(path) as archive:
            entries = archive.infolist()
            unpacked = sum(entry.file_size for entry in entries)
            if unpacked > MAX_FILE_BYTES:
                problem = "the 3MF file unpacks to more than 1 GiB"
                raise TooLargeError("scan-file-size", problem, "decimate the scan first")
            if unpacked > max(GROWTH_FREE_BYTES, MAX_GROWTH * path.stat().st_size):
                times = unpacked // path.stat().st_size
                problem = f"the 3MF file unpacks to {times} times its size, which no scan does"
                raise TooLargeError("scan-growth", problem, "export the scan again")
            models = [e for e in entries if e.filename.lower().endswith(".model")]
            if not models:
                problem = "the file is a ZIP archive without a 3D model, not 3MF"
                raise InputError("scan-format", problem, "export the scan as 3MF")
            _check_models(archive, models)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise format_error("3MF", "its archive is damaged or encrypted") from error


def _check_models(archive: zipfile.ZipFile, models: list[zipfile.ZipInfo]) -> None:
    faces = points = placements = 0
    for model in models:
        for chunk in _chunks(archive, model):
            if b"<!DOCTYPE" in chunk or b"<!ENTITY" in chunk:
                # Entities can pull in other files or unfold without end; 3MF has no use for them.
                raise format_error("3MF", "it declares XML entities")
            faces += chunk.count(b"<triangle ")
            points += chunk.count(b"<vertex ")
            placements += chunk.count(b"<component ")
            # While unpacking: what is too large already need not be unpacked to its end.
            check_counts(faces, 0)
            if points > MAX_SHARED_POINTS:
                problem = f"the scan has more than {MAX_SHARED_POINTS:,} vertices"
                raise TooLargeError("scan-points", problem, "decimate it, 200,000 faces are plenty")
    if placements:
        for model in models:
            with archive.open(model) as file:
                check_counts(_placed_faces(file), 0)


def _placed_faces(model: IO[bytes]) -> int:
    """Faces of a model once all its parts are placed.

    Objects made of objects made of objects can grow exponentially with the size of the file.
    """
    total: dict[str, int] = {}
    faces = placed = 0
    try:
        for name, attributes in _elements(model):
            if name == "triangle":
                faces += 1
            elif name == "component":
                # Parts must come before the objects made of them, so no circle can be.
                faces += total[attributes["objectid"]]
            elif name == "object":
                total[attributes["id"]], faces = faces, 0
            else:
                placed += total[attributes["objectid"]]
    except KeyError as error:
        raise format_error("3MF", "an object has a part that does not come before it") from error
    return placed


def _elements(model: IO[bytes]) -> Iterator[tuple[str, dict[str, str]]]:
    """Names and attributes of the elements that place faces, each when it ends."""
    from lxml import etree  # type: ignore[import-untyped]

    tags = tuple(f"{{*}}{name}" for name in ("triangle", "component", "object", "item"))
    try:
        for _, element in etree.iterparse(model, tag=tags, resolve_entities=False):
            yield element.tag.rpartition("}")[2], dict(element.attrib)
            element.clear()
    except etree.XMLSyntaxError as error:
        raise format_error("3MF", "its model part is broken") from error


def _chunks(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> Iterator[bytes]:
    # Each chunk repeats the end of the one before, short of a whole token, so that none is missed.
    overlap = len(b"<!ENTITY") - 1
    with archive.open(entry) as file:
        tail = b""
        while chunk := file.read(1 << 22):
            yield tail + chunk
            tail = chunk[-overlap:]
