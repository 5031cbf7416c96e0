"""``rigwright calibrate``, ``check`` and ``accept``."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import typer

from common.errors import InputError
from service.cli.output import NOT_WELL, print_json
from service.cli.running import new_folder, one_line_errors, run_task

JSON = dict[str, Any]
TARGETS = "targets.toml"
_TASKS = "service.tasks.calibrating"


@dataclass(frozen=True)
class Calibrating:
    """How to calibrate."""

    design: Path | None
    hold: tuple[str, ...]
    free: tuple[str, ...]
    poses_known_to: tuple[float, float] | None
    name: str
    workers: int | None


@dataclass(frozen=True)
class Checking:
    """What to check against, and what matters."""

    reference: Path
    targets: Path | None
    history: Path | None
    tolerance_mm: float
    hidden_limit_mm: float
    workers: int | None


@dataclass(frozen=True)
class Accepting:
    """What to test with, and against which limit."""

    reference: Path
    targets: Path
    limit: tuple[float, float, float]
    volume: tuple[float, float, float]
    rig: str
    operator: str
    temperature_degc: float | None
    workers: int | None


def run_calibrate_command(
    pictures: Path,
    captures: Sequence[str] | None,
    targets: Path,
    out: Path,
    options: Calibrating,
    *,
    as_json: bool,
    force: bool,
) -> None:
    """Calibrate and write into ``out``, with a copy of the target set for later checks."""
    with one_line_errors():
        request, inputs = _asked(pictures, captures, options.workers)
        request |= {"name": options.name, "hold": options.hold, "free": options.free}
        request |= {"poses_known_to": options.poses_known_to}
        inputs |= {"targets": targets}
        if options.design is not None:
            inputs["design"] = options.design
        with new_folder(out, force=force, spare=_given(pictures, inputs)) as folder:
            result = run_task(f"{_TASKS}:calibration", request, inputs, folder)
            shutil.copyfile(targets, folder / TARGETS)
        _show("calibration", result, out, as_json=as_json)


def run_check_command(
    pictures: Path,
    captures: Sequence[str] | None,
    out: Path,
    options: Checking,
    *,
    as_json: bool,
    force: bool,
) -> None:
    """Check, write into ``out``, and end with an exit code that scripts can go by."""
    with one_line_errors():
        request, inputs = _asked(pictures, captures, options.workers)
        request |= {
            "tolerance_mm": options.tolerance_mm,
            "hidden_limit_mm": options.hidden_limit_mm,
        }
        inputs |= {
            "calibration": _reference(options.reference),
            "targets": options.targets or _targets_beside(options.reference),
            **_earlier(options.history),
        }
        with new_folder(out, force=force, spare=_given(pictures, inputs)) as folder:
            result = run_task(f"{_TASKS}:rig_check", request, inputs, folder)
        if options.history is not None:
            _add_to_history(out, options.history, request["made_utc"])
        _show("check", result, out, as_json=as_json)
    if result["light"] == "red":
        raise typer.Exit(NOT_WELL)


def run_accept_command(
    pictures: Path,
    captures: Sequence[str] | None,
    out: Path,
    options: Accepting,
    *,
    as_json: bool,
    force: bool,
) -> None:
    """Test, write the certificate into ``out``; the exit code tells whether it was passed."""
    with one_line_errors():
        request, inputs = _asked(pictures, captures, options.workers)
        request |= {
            "limit": options.limit,
            "volume": options.volume,
            "rig": options.rig,
            "operator": options.operator,
            "temperature_degc": options.temperature_degc,
        }
        inputs |= {"calibration": _reference(options.reference), "targets": options.targets}
        with new_folder(out, force=force, spare=_given(pictures, inputs)) as folder:
            result = run_task(f"{_TASKS}:acceptance", request, inputs, folder)
        _show("acceptance", result, out, as_json=as_json)
    if result["outcome"] != "passed":
        raise typer.Exit(NOT_WELL)


def _asked(
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


def _given(pictures: Path, inputs: dict[str, Path]) -> list[Path]:
    return [pictures, *inputs.values()]


def _reference(given: Path) -> Path:
    return given / "calibration.json" if given.is_dir() else given


def _targets_beside(reference: Path) -> Path:
    beside = _reference(reference).with_name(TARGETS)
    if not beside.is_file():
        raise InputError(
            "no-targets", f"there is no {TARGETS} beside the calibration", "give --targets"
        )
    return beside


def _earlier(history: Path | None) -> dict[str, Path]:
    if history is None or not history.exists():
        return {}
    if not history.is_dir():
        raise InputError("history-folder", f"{history} is a file", "give a folder as --history")
    found = sorted(history.glob("check-*.json"))
    return {f"check-{number}": path for number, path in enumerate(found)}


def _add_to_history(out: Path, history: Path, made_utc: str) -> None:
    history.mkdir(parents=True, exist_ok=True)
    stamp = "".join(letter for letter in made_utc if letter.isdigit())[:14]
    shutil.copyfile(out / "check.json", _free(history, f"check-{stamp}"))
    page = out / "history.html"
    if page.exists():
        shutil.copyfile(page, history / page.name)


def _free(folder: Path, stem: str) -> Path:
    """A name for one more file: checks of one second must not replace one another."""
    path, number = folder / f"{stem}.json", 2
    while path.exists():
        path, number = folder / f"{stem}-{number}.json", number + 1
    return path


def _show(what: str, result: JSON, out: Path, *, as_json: bool) -> None:
    files = {path.name: path for path in sorted(out.iterdir())}
    if as_json:
        print_json({"result": result, "files": {name: str(path) for name, path in files.items()}})
        return
    from service.cli import measuretables
    from service.cli.tables import print_files

    getattr(measuretables, f"print_{what}")(result)
    sys.stdout.flush()
    print_files(files)
