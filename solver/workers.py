"""Work in parallel processes, one BLAS thread each, with progress and cancel."""

from __future__ import annotations

import multiprocessing as mp
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from multiprocessing.queues import Queue
from multiprocessing.synchronize import Event
from typing import Any, Protocol, TypeVar

from threadpoolctl import threadpool_limits

from common.closing import Closing
from common.errors import CancelledError
from common.processes import end_with_parent, single_threaded_children
from common.progress import CancelToken

_POLL_S = 0.05

Report = Callable[[int, int, float, float], None]
"""Called with outer iteration, iteration, cost relative to the start's, violation."""

ResultT_co = TypeVar("ResultT_co", covariant=True)
ResultT = TypeVar("ResultT")


class Job(Protocol[ResultT_co]):
    """One piece of work. Picklable, so that any process may do it."""

    @property
    def index(self) -> int:
        """Its number, by which its progress is told."""

    def run(self, report: Report, cancel: CancelToken) -> ResultT_co:
        """Do the work; soon after ``cancel`` is set, end with whatever there is."""


class Listener(Protocol):
    """Receives ``(job, outer iteration, step, cost, violation)`` of all jobs."""

    def __call__(
        self, job: int, outer: int, iteration: int, cost: float, violation: float, /
    ) -> None:
        """Take note."""


def silent(*_: float) -> None:
    """Take no note of any progress."""


_Step = tuple[int, int, int, float, float]
_channel: tuple[Queue[_Step], Event] | None = None


def _begin(messages: Queue[_Step], cancelled: Event) -> None:
    """Set up a worker: its channel, and its end when its parent dies."""
    global _channel  # a pool's initializer has no other way to hand things over
    _channel = (messages, cancelled)
    end_with_parent()


def _run_in_worker(job: Job[ResultT]) -> ResultT:
    if _channel is None:
        raise RuntimeError("the worker was not set up")
    messages, cancelled = _channel

    def report(outer: int, iteration: int, cost: float, violation: float) -> None:
        messages.put((job.index, outer, iteration, cost, violation))

    with threadpool_limits(1):
        return job.run(report, cancelled)


class _Processes:
    """Processes that were begun, and what they are told and tell by."""

    def __init__(self, count: int) -> None:
        context = mp.get_context("spawn")
        self.messages: Queue[_Step] = context.Queue()
        self.cancelled = context.Event()
        with single_threaded_children():
            given = (self.messages, self.cancelled)
            self.pool = ProcessPoolExecutor(count, context, _begin, given)
            # Each job makes one more of them, while the environment says one thread.
            for _ in range(count):
                self.pool.submit(silent)

    def attend(
        self, futures: Mapping[int, Future[Any]], listen: Listener, cancel: CancelToken
    ) -> None:
        """Pass on progress of the jobs with these indices until all are done, or it is cancelled.

        What a job of an earlier batch told last may come after its result, and is for nobody.
        """
        pending = set(futures.values())
        while pending:
            done, pending = wait(pending, timeout=_POLL_S, return_when=FIRST_COMPLETED)
            while not self.messages.empty():
                told = self.messages.get()
                if told[0] in futures:
                    listen(*told)
            for future in done:
                future.result()
            if cancel.is_set():
                self.cancelled.set()
                raise CancelledError

    def end(self) -> None:
        """Have all of them stop, and wait for it."""
        self.cancelled.set()
        self.pool.shutdown(wait=True, cancel_futures=True)
        self.messages.close()


class Workers(Closing):
    """So many processes, which do one batch of jobs after the other until they are let go.

    They begin when there is work for more than one; with one there are none, and the work is done
    here. A job gives the same bits wherever it is done.
    """

    def __init__(self, count: int = 1) -> None:
        self.count = max(1, count)
        self._processes: _Processes | None = None

    def close(self) -> None:
        """Have the processes stop, and wait for their end."""
        processes, self._processes = self._processes, None
        if processes is not None:
            processes.end()

    def begin(self) -> None:
        """Have the processes begin, which takes them a second, while other work is done here."""
        if self.count > 1:
            self._begun()

    def run(
        self, jobs: Sequence[Job[ResultT]], listen: Listener, cancel: CancelToken
    ) -> list[ResultT]:
        """Results of all jobs in their order, whatever the number of workers.

        Raises :class:`CancelledError` when ``cancel`` is set before all are done.
        """
        if self.count == 1 or len(jobs) <= 1:
            return _run_here(jobs, listen, cancel)
        processes = self._begun()
        futures = {job.index: processes.pool.submit(_run_in_worker, job) for job in jobs}
        processes.attend(futures, listen, cancel)
        return [f.result() for f in futures.values()]

    def _begun(self) -> _Processes:
        if self._processes is None:
            self._processes = _Processes(self.count)
        return self._processes


def _run_here(jobs: Sequence[Job[ResultT]], listen: Listener, cancel: CancelToken) -> list[ResultT]:
    out = []
    for job in jobs:
        with threadpool_limits(1):
            out.append(job.run(lambda *step, index=job.index: listen(index, *step), cancel))
        if cancel.is_set():
            raise CancelledError
    return out
