"""``rigwright check``."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from calibration.defaults import HIDDEN_LIMIT_MM, TOLERANCE_MM
from service.cli.options import (
    CaptureOption,
    ForceOption,
    JsonOption,
    OutOption,
    PicturesArgument,
    ReferenceOption,
    WorkersOption,
)

HISTORY_PAGE = "history.html"


def check(
    pictures: PicturesArgument,
    reference: ReferenceOption,
    out: OutOption,
    target_set: Annotated[
        Path | None,
        typer.Option(
            "--targets",
            metavar="SET.toml",
            help="The targets in the pictures; those of the calibration without it.",
            show_default=False,
        ),
    ] = None,
    capture: CaptureOption = None,
    history: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Folder of all checks of this rig: this one is added, and a page shows the drift.",
            show_default=False,
        ),
    ] = None,
    tolerance_mm: Annotated[
        float, typer.Option(min=0.0, help="Smaller effects at the subject turn no light red.")
    ] = TOLERANCE_MM,
    hidden_limit_mm: Annotated[
        float, typer.Option(min=1e-6, help="A camera that could hide more is not called fine.")
    ] = HIDDEN_LIMIT_MM,
    workers: WorkersOption = None,
    as_json: JsonOption = False,
    force: ForceOption = False,
) -> None:
    """Check that a rig is still as it was calibrated: which camera moved, and by how much.

    Exit code: 0 fine (green or yellow), 4 the rig must be looked after (red), 2 bad input.

    Example:  rigwright check sessions/today --reference calibration --out check
    """
    from common.files.folders import new_folder
    from common.files.ownership import files_of
    from service.cli.output import NOT_WELL, print_result_json, say_next
    from service.cli.pictures import picture_source, reference_file
    from service.cli.running import one_line_errors, run_task
    from service.cli.tables import measurement_tables
    from service.cli.tables.design_tables import print_files
    from service.kinds.check import CHECK, CheckRequest

    with one_line_errors():
        source = picture_source(pictures, capture, workers)
        request = CheckRequest(tolerance_mm=tolerance_mm, hidden_limit_mm=hidden_limit_mm)
        inputs = {
            **source.inputs,
            "calibration": reference_file(reference),
            "targets": target_set or _targets_beside(reference),
            **_earlier(history),
        }
        with new_folder(out, force=force, spare=[pictures, *inputs.values()]) as folder:
            result = run_task(CHECK, request, inputs, folder, source.run)
        if history is not None:
            _add_to_history(out, history, source.run.made_utc)
        if as_json:
            print_result_json(result, files_of(out))
        else:
            measurement_tables.print_check(result)
            print_files(files_of(out))
    if result.light == "red":
        if not as_json:
            say_next(
                f"see {out / 'report.html'}, put right what is named there and check again, or "
                "calibrate anew",
                *("calibrate", "NEW-PICTURES", "--targets", inputs["targets"]),
                *("--out", "new-calibration"),
            )
        raise typer.Exit(NOT_WELL)
    if not as_json:
        say_next(
            f"open {out / 'report.html'} in a browser; a bar tells whether the rig measures right",
            *("accept", "BAR-PICTURES", "--reference", reference),
            *("--targets", "BAR.toml", "--out", "my-acceptance"),
        )


def _targets_beside(reference: Path) -> Path:
    from common.errors import InputError
    from service.cli.pictures import TARGETS, reference_file
    from service.cli.running import require_files

    calibration = reference_file(reference)
    # Where the reference is missing, its targets are too: that would be told of the wrong thing.
    require_files([calibration])
    beside = calibration.with_name(TARGETS)
    if not beside.is_file():
        raise InputError(
            "no-targets", f"there is no {TARGETS} beside the calibration", "give --targets"
        )
    return beside


def _earlier(history: Path | None) -> dict[str, Path]:
    from common.errors import InputError
    from common.files.ownership import refuse_other_list

    if history is None:
        return {}
    for place in (history, *history.parents):
        if os.path.lexists(place) and not place.is_dir():
            raise InputError(
                "history-folder", f"{place} is no folder", "give a folder as --history"
            )
    if not history.exists():
        return {}
    refuse_other_list(history)
    _refuse_foreign_page(history / HISTORY_PAGE)
    found = sorted(history.glob("check-*.json"))
    return {f"check-{number}": path for number, path in enumerate(found)}


def _refuse_foreign_page(page: Path) -> None:
    """The page of the history is written anew by each check: only over one of ours."""
    from common.errors import ConflictError

    if page.is_symlink() or (page.exists() and not _is_ours(page)):
        raise ConflictError(
            "history-page",
            f"{page} was not written by this program, or was changed since",
            "give another folder as --history, or move it away",
        )


def _is_ours(page: Path) -> bool:
    from common.files.ownership import unchanged

    if not page.is_file():
        return False
    listed = unchanged(page)
    if listed is not None:
        return listed
    # Histories that began before there was a list.
    with page.open("rb") as file:
        return b'name="generator" content="Rigwright"' in file.read(4096)


def _add_to_history(out: Path, history: Path, made_utc: str) -> None:
    from common.files.ownership import mark_also
    from common.files.writing import write_whole

    history.mkdir(parents=True, exist_ok=True)
    stamp = "".join(letter for letter in made_utc if letter.isdigit())[:14]
    write_whole(_free(history, f"check-{stamp}"), (out / "check.json").read_bytes())
    page = out / HISTORY_PAGE
    if page.exists():
        shown = history / HISTORY_PAGE
        write_whole(shown, page.read_bytes(), overwrite=True)
        mark_also(history, shown)


def _free(folder: Path, stem: str) -> Path:
    """A name for one more file: checks of one second must not replace one another."""
    path, number = folder / f"{stem}.json", 2
    while path.exists() or path.is_symlink():
        path, number = folder / f"{stem}-{number}.json", number + 1
    return path
