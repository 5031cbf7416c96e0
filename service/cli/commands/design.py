"""``rigwright design``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.specification.strategies import Strategy
from service.cli.options import ForceOption, JsonOption, RigOption, ScanArgument, WorkersOption

if TYPE_CHECKING:
    from service.kinds.base import JobKind, RequestT, RunContext
    from service.kinds.design import DesignResult


def design(
    scan: ScanArgument,
    rig: RigOption,
    out: Annotated[
        Path,
        typer.Option(metavar="DIR", help="Folder to write the design into.", show_default=False),
    ],
    cameras: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=500,
            help="Cameras to place, instead of the rig's number; 0: its fixed ones are the rig.",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Seed, instead of the rig's.", show_default=False)
    ] = None,
    starts: Annotated[
        int | None,
        typer.Option(
            min=1, max=1000, help="Starts to try, instead of the rig's number.", show_default=False
        ),
    ] = None,
    strategy: Annotated[
        Strategy | None,
        typer.Option(help="Where cameras begin, instead of the rig's choice.", show_default=False),
    ] = None,
    workers: WorkersOption = None,
    as_json: JsonOption = False,
    force: ForceOption = False,
) -> None:
    """Design a rig: a scan and its limits in, camera poses and a mount layout out.

    When the limits cannot all be met, the nearest design is written and told apart.

    Exit code: 0 done, 2 bad input, 3 limits cannot be met, 130 interrupted.

    Example:  rigwright design head.glb --rig face.toml --out rig --cameras 7
    """
    from rig.specification.rigfile import read_rig_file
    from service.cli.output import say_next
    from service.cli.running import processes, require_files
    from service.kinds.base import RunContext
    from service.kinds.design import DESIGN, DesignRequest

    def request() -> DesignRequest:
        require_files([scan, rig])
        return DesignRequest(
            rig=read_rig_file(rig), cameras=cameras, seed=seed, starts=starts, strategy=strategy
        )

    run = RunContext(workers=processes(workers), scan_name=scan.name)
    run_design(
        DESIGN, request, {"scan": scan}, run, out, spare=[scan, rig], as_json=as_json, force=force
    )
    if not as_json:
        say_next(
            f"open {out / 'report.html'} in a browser, then plan what holds the cameras",
            *("plan", out / "design.json", "--mount", "SYSTEM.toml", "--out", "my-plan"),
        )


def standing_design(rig: Path, scan: Path, folder: Path) -> Path:
    """The design, written into ``folder``, of a rig that stands: its fixed cameras."""
    from rig.specification.rigfile import read_rig_file
    from service.cli.running import run_task
    from service.kinds.base import RunContext
    from service.kinds.design import DESIGN, DesignRequest

    request = DesignRequest(rig=read_rig_file(rig), cameras=0)
    run_task(DESIGN, request, {"scan": scan}, folder, RunContext(scan_name=scan.name))
    return folder / "design.json"


def run_design(
    kind: JobKind[RequestT, DesignResult],
    request: Callable[[], RequestT],
    inputs: Mapping[str, Path],
    run: RunContext,
    out: Path,
    *,
    spare: Sequence[Path] = (),
    as_json: bool,
    force: bool,
) -> None:
    """Run a kind of job that designs, and show what came of it."""
    from common.files.folders import new_folder
    from service.cli.running import one_line_errors, run_task
    from service.cli.scans import remember_scan
    from service.problems import EXIT_INFEASIBLE

    with one_line_errors():
        with new_folder(out, force=force, spare=spare) as folder:
            result = run_task(kind, request(), inputs, folder, run)
            if "scan" in inputs:
                remember_scan(folder, out, inputs["scan"])
        _show(result, out, as_json=as_json)
    if not result.feasible:
        raise typer.Exit(EXIT_INFEASIBLE)


def _show(result: DesignResult, out: Path, *, as_json: bool) -> None:
    from common.files.ownership import files_of
    from rig.design.designfile import read_design
    from service.cli.output import print_result_json

    files = files_of(out)
    constraints = read_design(files["design.json"]).file.constraints or []
    if as_json:
        rows = [row.model_dump(mode="json") for row in constraints]
        print_result_json(result, files, constraints=rows)
    else:
        from service.cli.tables import design_tables

        design_tables.print_notes(result)
        design_tables.print_figures(result, result.start_cost_mm2 if result.placed else None)
        design_tables.print_limits(constraints)
        if result.conflicts:
            design_tables.print_conflicts(result)
        design_tables.print_files(files)
    if not result.feasible:
        sys.stderr.write(f"rigwright: {_why_infeasible(result)}\n")


def _why_infeasible(result: DesignResult) -> str:
    families = list(dict.fromkeys(name.split("/", 1)[0] for name in result.violated))
    if result.placed == 0:
        return f"the rig as it stands breaks limits ({', '.join(families)}); its report was written"
    if result.contradiction is not None:
        return f"the limits cannot all be met: {result.contradiction}; a first network was written"
    in_conflict = [row.family for row in result.conflicts] or families
    return (
        f"the limits cannot all be met ({', '.join(in_conflict)}); the nearest design was written, "
        "relax one of them"
    )
