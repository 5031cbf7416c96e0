"""Studies whose units are computed in this process: loading the solver anew takes seconds."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import contextmanager
from typing import Any

from common.progress import CancelToken
from rig.study.running import OpenExecutor
from rig.study.unit import Unit


class Inline(Executor):
    """Computes at once. A unit that is ``deadly`` kills it, as it would a worker process."""

    def __init__(self, deadly: Callable[[Unit], bool]) -> None:
        self._deadly = deadly
        self._broken = False

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:  # noqa: ANN401
        """The function's result, or its error, as a future that is done."""
        future: Future[Any] = Future()
        if self._broken:
            raise BrokenExecutor("a worker died")
        if self._deadly(args[0]):
            self._broken = True
            future.set_exception(BrokenExecutor("a worker died"))
            return future
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:  # noqa: BLE001 - it is the caller's
            future.set_exception(error)
        return future


def inline(deadly: Callable[[Unit], bool] = lambda _: False) -> OpenExecutor:
    """In place of worker processes."""

    @contextmanager
    def opened(_cancel: CancelToken) -> Iterator[Executor]:
        yield Inline(deadly)

    return opened
