"""Starts as jobs for worker processes."""

from __future__ import annotations

from dataclasses import dataclass

from common.progress import CancelToken
from solver.near_optimum import run_near
from solver.outer_loop import StartResult, run_start
from solver.problem import Problem
from solver.workers import Report


@dataclass(frozen=True, eq=False)
class StartJob:
    """One start to be optimised.

    ``near``: the start was chosen so well that only short moves are wanted.
    """

    index: int
    kind: str
    problem: Problem
    seed: int
    near: bool = False

    def run(self, report: Report, cancel: CancelToken) -> StartResult:
        """See :class:`solver.workers.Job`."""
        if self.near:
            return run_near(self.problem, report, cancel)
        return run_start(self.problem, report, cancel, self.seed)
