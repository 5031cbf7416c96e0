"""Progress on standard error: a bar on a terminal, plain lines elsewhere."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from common.progress import Progress, ProgressCallback

_LINE_EVERY_S = 2.0


@contextmanager
def show_progress() -> Iterator[ProgressCallback]:
    """Something to hand progress to."""
    if sys.stderr.isatty():
        with _bar() as report:
            yield report
    else:
        yield _Lines()


def _number(value: float, form: str) -> str:
    return "-" if math.isnan(value) else format(value, form)


def details(progress: Progress) -> str:
    """Start, iteration, cost and violation, as far as they mean something now."""
    if progress.start < 0:
        return ""
    cost, violation = _number(progress.cost, ".4g"), _number(progress.violation, ".1e")
    where = f"start {progress.start + 1}, iteration {progress.iteration}"
    return f"{where}, cost {cost}, violation {violation}"


class _Lines:
    """A line for each new stage and start, and one now and then in between."""

    def __init__(self) -> None:
        self._seen: set[tuple[str, int]] = set()
        self._written_s = 0.0

    def __call__(self, progress: Progress, /) -> None:
        where, now_s = (progress.stage, progress.start), time.monotonic()
        if where in self._seen and now_s - self._written_s < _LINE_EVERY_S:
            return
        self._seen.add(where)
        self._written_s = now_s
        more = details(progress)
        line = f"{100.0 * progress.fraction:3.0f} % {progress.stage}{': ' if more else ''}{more}"
        sys.stderr.write(line + "\n")
        sys.stderr.flush()


@contextmanager
def _bar() -> Iterator[ProgressCallback]:
    from rich.console import Console
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[details]}", style="dim"),
    )
    with Bar(*columns, console=Console(stderr=True), transient=True) as shown:
        bar = shown.add_task("starting", total=1.0, details="")

        def report(progress: Progress, /) -> None:
            shown.update(
                bar,
                description=progress.stage,
                completed=progress.fraction,
                details=details(progress),
            )

        yield report
