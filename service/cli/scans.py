"""Which scan a design was made for: its place and checksum, kept beside the design."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path

from common.errors import InputError
from common.files.reading import json_in

FILE = "scan.json"
SCHEMA = "rigwright.design-scan/1"
_REMEDY = "give --scan"


def remember_scan(folder: Path, out: Path, scan: Path) -> None:
    """Note in ``folder``, which will be ``out``, which scan its design was made for."""
    place = os.path.relpath(scan.resolve(), out.resolve())
    document = {"schema": SCHEMA, "path": Path(place).as_posix(), "sha256": _sha256(scan)}
    (folder / FILE).write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def scan_of(design: Path) -> Path:
    """The scan that a design was made for.

    Raises :class:`InputError` where the design is not there, or its scan is not where it was, or
    is not the same any more.
    """
    if not design.is_file():
        what = "is a folder" if design.is_dir() else "does not exist"
        raise InputError("no-file", f"the design {design} {what}", "give a design.json")
    noted = _noted(design.with_name(FILE))
    if noted is None:
        return _named(design)
    path, digest = noted
    scan = design.parent / path
    if not scan.is_file():
        raise InputError("no-scan", f"the head {scan.resolve()} is not there any more", _REMEDY)
    if _sha256(scan) != digest:
        raise InputError("scan-changed", f"{scan} has changed since the design was made", _REMEDY)
    return scan


def _noted(file: Path) -> tuple[str, str] | None:
    try:
        document = json_in(file)
        if document["schema"] != SCHEMA:
            return None
        return str(document["path"]), str(document["sha256"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _named(design: Path) -> Path:
    """The scan that a design names, in the design's own folder."""
    try:
        name = str(json_in(design)["scan"]["name"])
    except (OSError, ValueError, KeyError, TypeError):
        name = ""
    beside = design.parent / Path(name).name
    if not name or not beside.is_file():
        told = f"the head {name} that {design} was made for" if name else f"the head of {design}"
        raise InputError("no-scan", f"{told} is not beside it", _REMEDY)
    return beside


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
