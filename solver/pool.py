"""Starts in parallel processes, one BLAS thread each, with progress and cancel."""

from __future__ import annotations

import multiprocessing as mp
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from multiprocessing.queues import Queue
from multiprocessing.synchronize import Event
from typing import Protocol

from threadpoolctl import threadpool_limits

from common.errors import CancelledError
from common.processes import end_with_parent, single_threaded_children
from common.progress import CancelToken
from solver.near_optimum import run_near
from solver.outer_loop import Report, StartResult, run_start
from solver.problem import Problem

_POLL_S = 0.05


@dataclass(frozen=True, eq=False)
class StartJob:
    """One start to be optimised. Picklable, so that any executor may run it.

    ``near``: the start was chosen so well that only short moves are wanted.
    """

    index: int
    kind: str
    problem: Problem
    seed: int
    near: bool = False


Step = tuple[int, int, int, float, float]

_channel: tuple[Queue[Step], Event] | None = None


def _begin(messages: Queue[Step], cancelled: Event) -> None:
    """Set up a worker: its channel, and its end when its parent dies."""
    global _channel  # a pool's initializer has no other way to hand things over
    _channel = (messages, cancelled)
    end_with_parent()


def solve(job: StartJob, report: Report, cancel: CancelToken) -> StartResult:
    """Run one start on one BLAS thread, so that it gives the same bits wherever it runs."""
    with threadpool_limits(1):
        if job.near:
            return run_near(job.problem, report, cancel)
        return run_start(job.problem, report, cancel, job.seed)


def _solve_in_worker(job: StartJob) -> StartResult:
    if _channel is None:
        raise RuntimeError("the worker was not set up")
    messages, cancelled = _channel

    def report(outer: int, iteration: int, cost: float, violation: float) -> None:
        messages.put((job.index, outer, iteration, cost, violation))

    return solve(job, report, cancelled)


class Listener(Protocol):
    """Receives ``(start, round, iteration, cost, violation)`` of all starts."""

    def __call__(
        self, start: int, outer: int, iteration: int, cost: float, violation: float, /
    ) -> None:
        """Take note."""


def run_all(
    jobs: list[StartJob], workers: int, listen: Listener, cancel: CancelToken
) -> list[StartResult]:
    """Results of all jobs in their order, whatever the number of workers.

    Raises :class:`CancelledError` when ``cancel`` is set before all are done.
    """
    if workers <= 1 or len(jobs) == 1:
        return _run_here(jobs, listen, cancel)
    context = mp.get_context("spawn")
    messages: Queue[Step] = context.Queue()
    cancelled = context.Event()
    with single_threaded_children():
        pool = ProcessPoolExecutor(min(workers, len(jobs)), context, _begin, (messages, cancelled))
        try:
            futures = [pool.submit(_solve_in_worker, job) for job in jobs]
            _attend(futures, messages, cancelled, listen, cancel)
            return [f.result() for f in futures]
        finally:
            cancelled.set()
            pool.shutdown(wait=True, cancel_futures=True)
            messages.close()


def _run_here(jobs: list[StartJob], listen: Listener, cancel: CancelToken) -> list[StartResult]:
    out = []
    for job in jobs:
        out.append(solve(job, lambda *step, index=job.index: listen(index, *step), cancel))
        if cancel.is_set():
            raise CancelledError
    return out


def _attend(
    futures: list[Future[StartResult]],
    messages: Queue[Step],
    cancelled: Event,
    listen: Listener,
    cancel: CancelToken,
) -> None:
    """Pass on progress until all are done or the work is cancelled."""
    pending = set(futures)
    while pending:
        done, pending = wait(pending, timeout=_POLL_S, return_when=FIRST_COMPLETED)
        while not messages.empty():
            listen(*messages.get())
        for future in done:
            future.result()
        if cancel.is_set():
            cancelled.set()
            raise CancelledError
