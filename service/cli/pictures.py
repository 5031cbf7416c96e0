"""Where the pictures of a command are, and what it measures against."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from common.errors import InputError
from common.files.ownership import files_of
from service.cli.output import print_json

JSON = dict[str, Any]
TARGETS = "targets.toml"


def asked(
    pictures: Path, captures: Sequence[str] | None, workers: int | None
) -> tuple[JSON, dict[str, Path]]:
    """The part of the request and the inputs that all three have."""
    request: JSON = {
        "workers": workers or os.cpu_count() or 1,
        "made_utc": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    session = (pictures / "session.json").is_file()
    if captures and not session:
        raise InputError(
            "no-session", f"{pictures} is no session, so it has no captures", "leave --capture out"
        )
    if session:
        return request | {"session": str(pictures.resolve()), "captures": list(captures or ())}, {}
    if pictures.is_dir():
        return request | {"pictures": str(pictures.resolve())}, {}
    return request, {"pictures": pictures}


def given(pictures: Path, inputs: dict[str, Path]) -> list[Path]:
    """What a command was given, which must not be lost."""
    return [pictures, *inputs.values()]


def reference_file(given: Path) -> Path:
    """The file of a calibration that is given as a file or as its folder."""
    return given / "calibration.json" if given.is_dir() else given


def show_measured(what: str, result: JSON, out: Path, *, as_json: bool) -> None:
    """A result as JSON or as tables, and its files."""
    files = files_of(out)
    if as_json:
        print_json({"result": result, "files": {name: str(path) for name, path in files.items()}})
        return
    from service.cli.tables import measurement_tables
    from service.cli.tables.design_tables import print_files

    getattr(measurement_tables, f"print_{what}")(result)
    sys.stdout.flush()
    print_files(files)
