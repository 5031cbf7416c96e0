"""What ``rigwright targets`` does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from common.errors import InputError
from service.cli.output import print_json
from service.cli.running import new_folder, one_line_errors, run_task

JSON = dict[str, Any]


def run_targets_command(
    target_set: Path | None,
    design: Path | None,
    out: Path,
    page: str,
    *,
    as_json: bool,
    force: bool,
) -> None:
    """Print a set, or propose one for a rig and print that."""
    with one_line_errors():
        given = {"targets": target_set, "design": design}
        inputs = {role: path for role, path in given.items() if path is not None}
        if len(inputs) != 1:
            raise InputError(
                "targets-which",
                "give a target set to print, or a design to propose one for",
                "for example: rigwright targets --design rig/design.json --out targets",
            )
        # A set that was printed before is printed anew, with its ruler measured: it is kept.
        spare = [path for path in inputs.values() if path != out / "targets.toml"]
        with new_folder(out, force=force, spare=spare) as folder:
            result = run_task("service.tasks.targeting:targets", {"page": page}, inputs, folder)
        _show(result, out, as_json=as_json)


def _show(result: JSON, out: Path, *, as_json: bool) -> None:
    files = {path.name: path for path in sorted(out.iterdir())}
    if as_json:
        print_json({"result": result, "files": {name: str(path) for name, path in files.items()}})
        return
    from service.cli import measuretables
    from service.cli.tables import print_files

    measuretables.print_targets(result)
    print_files(files)
