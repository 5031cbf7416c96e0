"""``rigwright plan``."""

from __future__ import annotations

import contextlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from service.kinds.defaults import PAPER

if TYPE_CHECKING:
    from service.kinds.plan import PlanNetwork, PlanResult


def plan(
    mount: Annotated[
        Path,
        typer.Option(
            metavar="SYSTEM.toml",
            help='What to build with; `kind = "t-slot"` is enough.',
            show_default=False,
        ),
    ],
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder to write into.", show_default=False)
    ],
    design: Annotated[
        Path | None,
        typer.Argument(metavar="[DESIGN.json]", help="The cameras to hold.", show_default=False),
    ] = None,
    rig: Annotated[
        Path | None,
        typer.Option(
            metavar="RIG.toml",
            help="In place of a design: a rig file with [[fixed]] cameras, of a rig that stands.",
            show_default=False,
        ),
    ] = None,
    scan: Annotated[
        Path | None,
        typer.Option(
            metavar="SCAN",
            help="The head it was designed for; the design knows where it was without it.",
            show_default=False,
        ),
    ] = None,
    name: Annotated[str, typer.Option(help="What to call it; as the design without it.")] = "",
    seed: Annotated[int, typer.Option(min=0, help="Of the trials of tolerances.")] = 0,
    paper: Annotated[str, typer.Option(help="Of drilling templates: A4 or A3.")] = PAPER,
    step: Annotated[bool, typer.Option("--step", help="Write printed parts as STEP too.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON document instead of tables.")
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace what is in the folder.")] = False,
) -> None:
    """Plan what holds the cameras: parts to cut, drill and print, settings, drawings, steps.

    Settings are rounded to what a person can set, and the loss is told.

    Exit code: 0 done, 2 bad input, 3 something clashes, 130 interrupted.

    Example:  rigwright plan rig/design.json --mount t-slot.toml --out plan

    Example:  rigwright plan --rig rig.toml --scan head.ply --mount tripods.toml --out plan
    """
    import tempfile

    from common.errors import InputError
    from common.files.folders import new_folder
    from rig.build.mounts.systemfile import read_system_file
    from service.cli.commands.design import standing_design
    from service.cli.running import one_line_errors, require_files, run_task
    from service.cli.scans import scan_of
    from service.kinds.plan import PAPERS, PLAN, PlanRequest
    from service.problems import EXIT_INFEASIBLE

    with one_line_errors():
        if paper not in PAPERS:
            raise InputError("paper", f"there is no paper {paper!r}", "give A4 or A3")
        with contextlib.ExitStack() as stack:
            given = _asked(design, rig, scan)
            head = scan or scan_of(given)
            folder = stack.enter_context(new_folder(out, force=force, spare=[given, mount, head]))
            require_files([given, mount, head])
            request = PlanRequest(
                mount=read_system_file(mount), name=name, seed=seed, paper=PAPERS[paper], step=step
            )
            if rig is not None:
                beside = stack.enter_context(tempfile.TemporaryDirectory())
                given = standing_design(rig, head, Path(beside))
            result = run_task(PLAN, request, {"design": given, "scan": head}, folder)
        _show(result, out, as_json=as_json)
    why = why_not(result)
    if why:
        sys.stderr.write(f"rigwright: {why}\n")
        raise typer.Exit(EXIT_INFEASIBLE)
    if not as_json:
        sys.stdout.write(
            f"Next: build by {out / 'steps.txt'}, and set each camera by its sheet in "
            f"{out / 'settings'}\n"
        )
    words = caution(result)
    if words:
        sys.stderr.write(f"rigwright: note: {words}\n")


def _asked(design: Path | None, rig: Path | None, scan: Path | None) -> Path:
    """The file that says where the cameras are."""
    from common.errors import InputError

    given = design or rig
    if given is None or (design and rig):
        raise InputError("plan-of-what", "a plan is of one rig", "give DESIGN.json, or --rig")
    if rig is not None and scan is None:
        raise InputError("no-scan", "a rig file does not know its head", "give --scan")
    return given


def why_not(result: PlanResult) -> str:
    """Why the rig of a plan that was written should not be built so; empty for a sound one."""
    if not result.price.designed.feasible:
        return (
            f"the design itself breaks its limits ({_broken(result.price.designed)}); the plan was "
            "written, but its rig breaks them as well: design again"
        )
    if result.clashes:
        first, more = result.clashes[0], len(result.clashes) - 1
        what = "stands in the view of" if first.kind == "view" else "is in the way of"
        return (
            f"{first.other} {what} {first.one}{f', and {more} more' if more else ''}; the plan "
            "was written, but cannot be built so: try another mount or other zones"
        )
    return ""


def caution(result: PlanResult) -> str:
    """What is to be known of a rig that can be built; empty when it keeps every limit as set."""
    over = [sag.too_far for sag in result.sags if sag.too_far]
    over += [stance.too_little for stance in result.stances if stance.too_little]
    if result.price.built.feasible:
        return f"{over[0]}; plan.html says what would hold it" if over else ""
    return (
        f"as it is set, the rig breaks limits a little that the design keeps "
        f"({_broken(result.price.built)}); a mount with finer settings would keep them"
    )


def _broken(network: PlanNetwork) -> str:
    shown, more = network.broken[:3], len(network.broken) - 3
    return ", ".join(shown) + (f", and {more} more" if more > 0 else "")


def _show(result: PlanResult, out: Path, *, as_json: bool) -> None:
    from common.files.ownership import files_of
    from service.cli.output import print_result_json
    from service.cli.tables import plan_tables

    files = files_of(out)
    if as_json:
        print_result_json(result, files)
        return
    plan_tables.print_plan(result)
    sys.stdout.write(f"Written: {len(files)} files under {out}, begin with {out / 'plan.html'}\n")
