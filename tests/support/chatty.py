"""A job that tells much until its very end, for whoever listens to several."""

from __future__ import annotations

from dataclasses import dataclass

from common.progress import CancelToken
from solver.workers import Report


@dataclass(frozen=True)
class Chatty:
    """Tells ``times`` steps and is done."""

    index: int
    times: int = 3000

    def run(self, report: Report, cancel: CancelToken) -> int:  # noqa: ARG002 - as jobs have it
        """Its own number."""
        for step in range(self.times):
            report(0, step, 1.0, 0.0)
        return self.index
