"""``rigwright study``."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from service.cli.options import ForceOption, JsonOption, OutOption, WorkersOption

if TYPE_CHECKING:
    from service.kinds.study import StudyRequest, StudyResult

UNITS = "units"


def study(
    plan: Annotated[
        Path,
        typer.Argument(metavar="STUDY.toml", help="Rigs, heads, choices.", show_default=False),
    ],
    out: OutOption,
    workers: WorkersOption = None,
    dask: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Compute on the workers of a Dask scheduler (tcp://host:port); extra 'dask'.",
            show_default=False,
        ),
    ] = None,
    as_json: JsonOption = False,
    force: ForceOption = False,
) -> None:
    """Compare rigs over a grid of choices: numbers of cameras, distances, forms, lenses, people.

    Each design is kept in DIR/units as soon as it is finished. Whatever ended a study, the same
    command goes on with it; designs that another study in DIR has too are not computed again.

    Exit code: 0 done, 2 bad input, 3 no design holds its limits, 130 interrupted.

    Example:  rigwright study study.toml --out my-study
    """
    from common.files.folders import grown_folder
    from common.files.ownership import files_of
    from rig.study.cache import is_unit
    from rig.study.heads import heads_of, study_identity
    from rig.study.resultfile import identity_in
    from service.cli.output import print_result_json
    from service.cli.running import one_line_errors, processes, run_task
    from service.cli.tables import study_tables
    from service.cli.tables.design_tables import print_files
    from service.kinds.base import RunContext
    from service.kinds.study import STUDY
    from service.problems import EXIT_INFEASIBLE

    with one_line_errors():

        @cache
        def asked() -> tuple[StudyRequest, dict[str, Path], list[Path]]:
            return _read(plan)

        def same() -> bool:
            request, inputs, _ = asked()
            heads, _ = heads_of(request.study, request.head_names, inputs)
            identity = study_identity(request.study, request.rigs, heads)
            return identity_in(out / "study.json") in (None, identity)

        kept = str((out / UNITS).absolute())
        run = RunContext(workers=processes(workers), cache=kept, cluster=dask)
        with grown_folder(
            out, UNITS, force=force, ours=is_unit, same=same, spare=lambda: asked()[2]
        ) as folder:
            request, inputs, _ = asked()
            result = run_task(STUDY, request, inputs, folder, run)
        files = {
            name: path for name, path in files_of(out).items() if not name.startswith(f"{UNITS}/")
        }
        if as_json:
            print_result_json(result, files)
        else:
            study_tables.print_study(result)
            print_files(files)
    if result.recommended is None:
        sys.stderr.write(f"rigwright: {_why(result)}\n")
        raise typer.Exit(EXIT_INFEASIBLE)


def _why(result: StudyResult) -> str:
    return (
        f"none of the {result.designs} designs holds its limits; report.html says which, relax "
        "one of them"
    )


def _read(plan: Path) -> tuple[StudyRequest, dict[str, Path], list[Path]]:
    """The request, the scans by role, and all files that are read for it."""
    from rig.specification.rigfile import read_rig_file
    from rig.study.heads import ROLE
    from rig.study.studyfile import read_study_file
    from service.cli.running import require_files
    from service.kinds.study import StudyRequest

    require_files([plan])
    file = read_study_file(plan)
    rigs = [plan.parent / name for name in file.rigs]
    heads = [plan.parent / name for name in file.heads]
    require_files([*rigs, *heads])
    request = StudyRequest(
        study=file.study(),
        rigs=[read_rig_file(path) for path in rigs],
        head_names=[path.name for path in heads],
    )
    inputs = {ROLE.format(number): path for number, path in enumerate(heads, 1)}
    return request, inputs, [plan, *rigs, *heads]
