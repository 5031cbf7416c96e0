"""A rig file's rig, solved."""

from __future__ import annotations

from common.progress import CancelToken, ProgressCallback, ignore_progress
from geometry.subject import Subject
from rig.specification.spec import RigSpec
from solver.design import design
from solver.result import Design
from solver.standing import as_it_stands
from solver.workers import Workers


def solved(
    subject: Subject,
    spec: RigSpec,
    *,
    workers: int | Workers = 1,
    bound: bool = False,
    progress: ProgressCallback = ignore_progress,
    cancel: CancelToken | None = None,
) -> Design:
    """The cameras that ``spec`` asks for before ``subject``, or those it has where none is placed.

    With ``bound`` a design that holds its limits says how good any other could be.
    Raises as :func:`solver.design.design`.
    """
    if spec.count == 0:
        return as_it_stands(subject, spec.fixed, spec.limits, spec.seed)
    return design(
        subject,
        spec.camera,
        spec.limits,
        count=spec.count,
        seed=spec.seed,
        starts=spec.starts,
        fixed=spec.fixed,
        start=spec.start or None,
        strategy=spec.strategy,
        workers=workers,
        bound=bound,
        progress=progress,
        cancel=cancel,
    )
