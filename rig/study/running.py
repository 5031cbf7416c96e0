"""Units side by side behind one seam, :class:`concurrent.futures.Executor`.

A unit is computed by nobody but a worker; what it gave is written by nobody but this process.
"""

from __future__ import annotations

import multiprocessing as mp
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from contextlib import AbstractContextManager, contextmanager
from multiprocessing.synchronize import Event
from pathlib import Path

from common.errors import RigwrightError
from common.processes import end_with_parent, single_threaded_children
from common.progress import CancelToken, NeverCancelled, Progress, ProgressCallback, go_on
from rig.study.cache import UnitCache
from rig.study.solving import fault_of, solve_unit
from rig.study.unit import Unit, UnitResult

_POLL_S = 0.1
_DIED = "the process that computed it died, twice; see how much memory it needs"

Files = Mapping[str, Path]
OpenExecutor = Callable[[CancelToken], AbstractContextManager[Executor]]
"""Opens who computes units; units still computed when ``cancel`` is set end soon."""


class UnitLostError(Exception):
    """Whoever computed a unit died of it, again and again; the others go on."""


_cancelled: CancelToken = NeverCancelled()


def processes(workers: int) -> OpenExecutor:
    """Worker processes on this machine, one BLAS thread each."""

    @contextmanager
    def opened(cancel: CancelToken) -> Iterator[Executor]:
        context = mp.get_context("spawn")
        stop = context.Event()
        with single_threaded_children():
            pool = ProcessPoolExecutor(workers, context, _begin, (stop,))
            try:
                yield pool
            finally:
                if cancel.is_set():
                    stop.set()
                pool.shutdown(wait=True, cancel_futures=True)

    return opened


def _begin(cancelled: Event) -> None:
    global _cancelled  # a pool's initializer has no other way to hand things over
    _cancelled = cancelled
    end_with_parent()


def compute(unit: Unit, files: Files) -> UnitResult:
    """What a worker does."""
    return solve_unit(unit, files, _cancelled)


class StudyRun:
    """All units of a study, from the cache or computed."""

    def __init__(
        self, units: Sequence[Unit], files: Files, cache: UnitCache, report: ProgressCallback
    ) -> None:
        self._units, self._files, self._cache, self._report = units, files, cache, report
        self._keys = [unit.key() for unit in units]
        self._results: dict[str, UnitResult] = {}
        self._waiting: deque[int] = deque()
        self._suspects: deque[int] = deque()
        self._on_trial = -1
        self._flying: dict[Future[UnitResult], int] = {}
        self._began_s, self._computed = time.monotonic(), 0
        self.reused = 0

    def results(
        self, open_executor: OpenExecutor, at_once: int, cancel: CancelToken
    ) -> list[UnitResult]:
        """One result for each unit, in their order; ``at_once`` are computed side by side.

        Raises :class:`CancelledError`; what was finished by then is kept.
        """
        self._look_up()
        self._tell()
        while self._waiting or self._suspects:
            go_on(cancel)
            self._with_new_workers(open_executor, at_once, cancel)
        return [self._results[key] for key in self._keys]

    def _look_up(self) -> None:
        """Take what was computed before; each of the rest waits, once."""
        self._cache.clean()
        met = set()
        for number, key in enumerate(self._keys):
            found = None if key in met else self._cache.get(key)
            if found is not None:
                self._results[key] = found
                self.reused += 1
            elif key not in met:
                self._waiting.append(number)
            met.add(key)

    def _with_new_workers(
        self, open_executor: OpenExecutor, at_once: int, cancel: CancelToken
    ) -> None:
        """Go on until all is done or a worker dies."""
        self._on_trial = -1
        try:
            with open_executor(cancel) as executor:
                while self._waiting or self._suspects or self._flying:
                    self._submit(executor, at_once)
                    done, _ = wait(self._flying, _POLL_S, FIRST_COMPLETED)
                    for future in done:
                        self._take(future)
                    go_on(cancel)
        except BrokenExecutor:
            self._lost()
        finally:
            self._flying.clear()

    def _lost(self) -> None:
        """Nobody says which unit killed the worker: each that was under way is tried alone."""
        lost = list(self._flying.values())
        if self._on_trial in lost:
            lost.remove(self._on_trial)
            self._keep_row(self._on_trial, _DIED)
        self._suspects.extend(lost)

    def _submit(self, executor: Executor, at_once: int) -> None:
        """Fill the workers; units that were under way when one died fly last and alone."""
        while self._waiting and len(self._flying) < at_once:
            self._fly(executor, self._waiting)
        if self._suspects and not self._flying:
            self._on_trial = self._suspects[0]
            self._fly(executor, self._suspects)

    def _fly(self, executor: Executor, queue: deque[int]) -> None:
        number = queue[0]
        self._flying[executor.submit(compute, self._units[number], self._files)] = number
        queue.popleft()

    def _take(self, future: Future[UnitResult]) -> None:
        number = self._flying[future]
        try:
            result = future.result()
        except (BrokenExecutor, RigwrightError):
            raise
        except UnitLostError:
            del self._flying[future]
            self._keep_row(number, _DIED)
            return
        except Exception as error:  # noqa: BLE001 - a fault in one unit must not end the others
            result = fault_of(self._units[number], error)
        else:
            result = self._checked(number, result)
        del self._flying[future]
        self._done(result)

    def _checked(self, number: int, result: UnitResult) -> UnitResult:
        """The result, kept; a worker's with another program is not what was asked for."""
        if result.key == self._keys[number]:
            self._cache.put(result)
            return result
        reason = "the worker runs another state of the program; install the same there"
        return UnitResult(key=self._keys[number], reason=reason, designed_for=result.designed_for)

    def _keep_row(self, number: int, reason: str) -> None:
        unit = self._units[number]
        row = UnitResult(key=self._keys[number], reason=reason, designed_for=unit.designed_for)
        self._done(row)

    def _done(self, result: UnitResult) -> None:
        self._results[result.key] = result
        self._computed += 1
        self._tell()

    def _tell(self) -> None:
        total, done = len(set(self._keys)), len(self._results)
        words = f"{done} of {total} designs"
        if self._computed > 0 and done < total:
            spent_s = time.monotonic() - self._began_s
            words += f", about {_duration(spent_s / self._computed * (total - done))} left"
        elif done and not self._computed:
            words += " were finished before"
        self._report(Progress(words, done / total))


def _duration(seconds: float) -> str:
    if seconds < 90.0:
        return f"{max(seconds, 1.0):.0f} s"
    minutes = seconds / 60.0
    return f"{minutes:.0f} min" if minutes < 90.0 else f"{minutes / 60.0:.1f} h"
