"""What ``rigwright plan`` does."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import typer

from common.errors import InputError
from service.cli.output import print_json
from service.cli.running import new_folder, one_line_errors, run_task
from service.problems import EXIT_INFEASIBLE

JSON = dict[str, Any]
PAPERS = ("A4", "A3")


@dataclass(frozen=True)
class Planning:
    """How to plan."""

    name: str
    seed: int
    paper: str
    step: bool


def run_plan_command(
    design: Path,
    mount: Path,
    scan: Path | None,
    out: Path,
    options: Planning,
    *,
    as_json: bool,
    force: bool,
) -> None:
    """Plan and write into ``out``."""
    with one_line_errors():
        if options.paper not in PAPERS:
            raise InputError("paper", f"there is no paper {options.paper!r}", "give A4 or A3")
        inputs = {"design": design, "mount": mount, "scan": scan or _scan_beside(design)}
        with new_folder(out, force=force, spare=inputs.values()) as folder:
            result = run_task("service.tasks.planning:plan", asdict(options), inputs, folder)
        _show(result, out, as_json=as_json)
    if not result["buildable"]:
        sys.stderr.write(f"rigwright: {_why(result)}\n")
        raise typer.Exit(EXIT_INFEASIBLE)


def _scan_beside(design: Path) -> Path:
    """The scan that a design names, in the design's own folder."""
    try:
        name = json.loads(design.read_text(encoding="utf-8"))["scan"]["name"]
    except (OSError, ValueError, KeyError, TypeError):
        name = ""
    beside = design.parent / Path(str(name)).name
    if not name or not beside.is_file():
        raise InputError(
            "no-scan", "the head that the design was made for is not beside it", "give --scan"
        )
    return beside


def _why(result: JSON) -> str:
    first, more = result["clashes"][0], len(result["clashes"]) - 1
    what = "stands in the view of" if first["kind"] == "view" else "is in the way of"
    return (
        f"{first['other']} {what} {first['one']}{f', and {more} more' if more else ''}; the plan "
        "was written, but cannot be built so: try another mount or other zones"
    )


def _show(result: JSON, out: Path, *, as_json: bool) -> None:
    files = {p.relative_to(out).as_posix(): p for p in sorted(out.rglob("*")) if p.is_file()}
    if as_json:
        print_json({"result": result, "files": {name: str(path) for name, path in files.items()}})
        return
    from service.cli import plantables

    plantables.print_plan(result)
    sys.stdout.write(f"Written: {len(files)} files under {out}, begin with {out / 'plan.html'}\n")
