"""Studies: units of a grid computed side by side, and what they say together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from common.errors import InputError
from common.progress import Progress, within
from rig.specification.rigfile import RigFile
from rig.study.assembling import row_of, study_result, write_study
from rig.study.cache import UnitCache
from rig.study.cluster import AT_ONCE, cluster
from rig.study.findings import usable
from rig.study.grid import Choice, choices, rig_of
from rig.study.heads import heads_of, study_identity
from rig.study.resultfile import Row, StudyResultFile
from rig.study.running import StudyRun, processes
from rig.study.unit import Head, Unit, UnitResult
from service.jobs.engine import Running, Task
from service.kinds.study import Recommended, StudyRequest, StudyResult

_RUNNING = 0.98
UNITS = "units"


@dataclass(frozen=True, eq=False)
class Planned:
    """A point of the grid: its rig and unit, or why there is none."""

    choice: Choice
    rig: RigFile
    unit: Unit | None
    refused: InputError | None


def study(task: Task[StudyRequest, StudyResult], running: Running) -> StudyResult:
    """Write ``study.json``, ``study.csv``, ``report.html``, ``recommended.toml``.

    Inputs: ``head-1``, ``head-2``, ... Finished units are kept in the run's ``cache``, or in
    ``units`` beside the results where it has none. Raises :class:`InputError` where no point of
    the grid can be.
    """
    request = task.request
    heads, files = heads_of(request.study, request.head_names, task.inputs)
    planned = plan(request, heads)
    units = [p.unit for p in planned if p.unit is not None]
    cache = UnitCache(Path(task.run.cache) if task.run.cache else task.folder / UNITS)
    run = StudyRun(units, files, cache, within(running.report, 0.0, _RUNNING))
    if task.run.cluster:
        done = run.results(cluster(task.run.cluster), AT_ONCE, running.cancel)
    else:
        workers = max(1, task.run.workers)
        done = run.results(processes(workers), workers, running.cancel)
    running.report(Progress("comparing", _RUNNING))
    rows = _rows(planned, done, request)
    names = list(dict.fromkeys(p.choice.rig for p in planned))
    identity = study_identity(request.study, request.rigs, heads)
    result = study_result(request.study, identity, names, [h.name for h in heads], rows)
    number = result.findings.recommended
    write_study(task.folder, result, None if number is None else planned[number].rig)
    running.report(Progress("done", 1.0))
    return _in_short(result, run.reused)


def plan(request: StudyRequest, heads: Sequence[Head]) -> list[Planned]:
    """All points of the grid. Raises :class:`InputError` where none of them can be."""
    rigs = _named([rig.name for rig in request.rigs])
    people = _named([head.name for head in heads])
    named = [h.model_copy(update={"name": n}) for h, n in zip(heads, people, strict=True)]
    by_name = dict(zip(rigs, request.rigs, strict=True))
    planned = []
    for choice in choices(request.study, rigs, people):
        base = by_name[choice.rig]
        try:
            rig = rig_of(choice, base, request.study)
            unit = Unit(rig=rig, heads=named, designed_for=people.index(choice.head))
            planned.append(Planned(choice, rig, unit, None))
        except InputError as error:
            planned.append(Planned(choice, base, None, error))
    refused = [p.refused for p in planned if p.refused is not None]
    if refused and len(refused) == len(planned):
        raise refused[0]
    return planned


def _named(names: Sequence[str]) -> list[str]:
    """Names that differ: what is called the same is numbered."""
    seen: dict[str, int] = {}
    out = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        out.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return out


def _rows(
    planned: Sequence[Planned], done: Sequence[UnitResult], request: StudyRequest
) -> list[Row]:
    results = iter(done)
    prices = request.study.prices
    return [
        row_of(
            p.choice,
            p.rig,
            UnitResult(key="", reason=str(p.refused)) if p.unit is None else next(results),
            prices,
        )
        for p in planned
    ]


def _in_short(result: StudyResultFile, reused: int) -> StudyResult:
    found, rows = result.findings, result.rows
    chosen = None if found.recommended is None else rows[found.recommended]
    recommended = None
    if chosen is not None:
        recommended = Recommended(
            choice=chosen.choice.words(),
            rig=chosen.choice.rig,
            head=chosen.choice.head,
            cameras=chosen.cameras,
            sigma_median_mm=chosen.sigma_median_mm,
            sigma_p95_mm=chosen.sigma_p95_mm,
            size_mm=chosen.size_mm,
            price=chosen.price,
        )
    return StudyResult(
        name=result.study.name,
        designs=len(rows),
        feasible=len(usable(rows)),
        reused=reused,
        on_front=len(found.front),
        recommended=recommended,
        why=found.why,
    )
