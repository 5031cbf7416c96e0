"""A rig that stands already: nothing to place, all figures of a design all the same."""

from __future__ import annotations

import numpy as np

from common.errors import InputError
from geometry.camera import RigCamera
from geometry.subject import Subject
from solver.limits import Limits
from solver.quality import evaluate
from solver.result import Design, SolverReport, Status


def as_it_stands(
    subject: Subject, cameras: tuple[RigCamera, ...], limits: Limits, seed: int = 0
) -> Design:
    """The design that ``cameras`` are. Raises :class:`InputError` for fewer than two of them."""
    if len(cameras) < 2:
        problem = f"{len(cameras)} cameras stand, and none is to be placed"
        raise InputError("no-cameras", problem, "ask for at least one more camera")
    quality = evaluate(subject, cameras, limits)
    report = SolverReport(
        engine="none",
        status=Status.CONVERGED if quality.feasible else Status.INFEASIBLE,
        why_stopped="no camera was to be placed, so the rig is told of as it stands",
        kkt_error=np.nan,
        iterations=0,
        rounds=0,
        seed=seed,
        seconds=0.0,
        starts=(),
    )
    return Design(cameras, quality, cameras, quality, limits, report)
