"""Progress and cancel are parameters of a call, never globals."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

from common.errors import CancelledError


@dataclass(frozen=True)
class Progress:
    """Where a solve is. ``fraction`` (0 to 1) never falls within one solve.

    ``start`` counts from 0, -1 outside a start. ``cost`` is relative to the start's cost;
    ``violation`` is the largest scaled breach of a limit.
    """

    stage: str
    fraction: float
    start: int = -1
    iteration: int = 0
    cost: float = float("nan")
    violation: float = float("nan")


class ProgressCallback(Protocol):
    """Receives progress; must return quickly."""

    def __call__(self, progress: Progress, /) -> None:
        """Take note of ``progress``."""
        ...


class CancelToken(Protocol):
    """Anything with ``is_set()``, such as ``threading.Event`` or ``multiprocessing.Event``."""

    def is_set(self) -> bool:
        """Whether the work should stop."""
        ...


def within(report: ProgressCallback, low: float, high: float, doing: str = "") -> ProgressCallback:
    """Progress of a part that goes from ``low`` to ``high`` (0 to 1) of the whole.

    ``doing`` is said before the part's own stages.
    """

    def tell(inner: Progress, /) -> None:
        stage = f"{doing}, {inner.stage}" if doing else inner.stage
        report(replace(inner, stage=stage, fraction=low + (high - low) * inner.fraction))

    return tell


class Rising:
    """Hands progress on with a fraction that never falls, whatever the parts of a work report."""

    def __init__(self, report: ProgressCallback) -> None:
        self._report = report
        self._reached = 0.0

    def __call__(self, progress: Progress, /) -> None:
        """Take note of ``progress``."""
        self._reached = max(self._reached, progress.fraction)
        self._report(replace(progress, fraction=self._reached))


def ignore_progress(progress: Progress, /) -> None:
    """The progress callback that does nothing."""


class NeverCancelled:
    """The cancel token that is never set."""

    def is_set(self) -> bool:
        """Never."""
        return False


def go_on(cancel: CancelToken) -> None:
    """Nothing, unless ``cancel`` is set: then ``CancelledError``."""
    if cancel.is_set():
        raise CancelledError
