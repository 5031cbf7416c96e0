"""Progress of a stage as part of the whole."""

from __future__ import annotations

from dataclasses import replace

from common.progress import Progress, ProgressCallback


def between(report: ProgressCallback, first: float, last: float) -> ProgressCallback:
    """Progress of a stage that goes from ``first`` to ``last`` (0 to 1) of the whole."""

    def within(inner: Progress, /) -> None:
        report(replace(inner, fraction=first + (last - first) * inner.fraction))

    return within
