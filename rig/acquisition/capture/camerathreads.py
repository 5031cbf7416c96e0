"""One thread per camera: the only one that touches it, so that one slow camera stops no other."""

from __future__ import annotations

import contextlib
import queue
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future, wait
from concurrent.futures import TimeoutError as FutureTimeout
from typing import TypeVar

from common.errors import RigwrightError
from rig.acquisition.cameras.base import CameraDevice, CameraHealth
from rig.acquisition.station.spec import CameraPlan

T = TypeVar("T")
LOOK_S = 0.1
"""How often somebody who waits looks whether to stop."""


class CameraThread:
    """An open camera and its thread.

    Jobs are done in order. A job that hangs (a library that waits for a dead device) cannot be
    ended from outside; the jobs behind it wait, and nobody waits for the thread: it is a daemon.
    """

    def __init__(self, plan: CameraPlan, device: CameraDevice) -> None:
        self.plan = plan
        self.device = device
        self.set_up = False
        """Whether the camera was given the settings of its plan since it was opened."""
        self._jobs: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._work, name=f"camera-{plan.name}", daemon=True)
        self._thread.start()

    def _work(self) -> None:
        while (job := self._jobs.get()) is not None:
            job()

    def do(self, job: Callable[[CameraDevice], T]) -> Future[T]:
        """Queue ``job``; its result or error is the future's."""
        future: Future[T] = Future()

        def run() -> None:
            if not future.set_running_or_notify_cancel():
                return
            try:
                future.set_result(job(self.device))
            except BaseException as error:  # noqa: BLE001  it is raised again where it is awaited
                future.set_exception(error)

        self._jobs.put(run)
        return future

    def health(self) -> CameraHealth:
        """How the camera is; never waits for the thread."""
        return self.device.health()

    def close(self, timeout_s: float = 2.0) -> None:
        """Disarm and close the camera, and end the thread; gives up on one that hangs."""
        done = self.do(_put_away)
        self._jobs.put(None)
        # Whatever a dead camera's library throws, the others and the box must still be closed.
        with contextlib.suppress(Exception):
            done.result(timeout_s)


def _put_away(device: CameraDevice) -> None:
    try:
        device.disarm()
    finally:
        device.close()


def outcomes(
    futures: Mapping[str, Future[T]],
    timeout_s: float,
    stop: Callable[[], bool] = lambda: False,
) -> tuple[dict[str, T], dict[str, str]]:
    """Results, and a sentence for each camera without, by name; waits ``timeout_s`` in all.

    ``timeout_s`` may be infinite; ``stop`` ends the waiting at once. Jobs are never taken back: a
    disarm that waits behind a hanging arm must still be done.
    """
    until = time.monotonic() + timeout_s
    done: dict[str, T] = {}
    problems: dict[str, str] = {}
    for name, future in futures.items():
        while not future.done() and time.monotonic() < until and not stop():
            wait([future], max(0.0, min(LOOK_S, until - time.monotonic())))
        try:
            done[name] = future.result(0.0)
        except FutureTimeout:
            problems[name] = f"it did not answer within {timeout_s:.3g} s"
        except RigwrightError as error:
            problems[name] = error.problem
        except Exception as error:  # noqa: BLE001
            # After FIRE the other cameras' pictures are precious: a fault of one backend costs
            # its own camera only, and is named.
            problems[name] = f"its backend failed ({type(error).__name__}: {error})"
    return done, problems


def do_all(
    threads: Iterable[CameraThread], job: Callable[[CameraDevice], T], timeout_s: float
) -> tuple[dict[str, T], dict[str, str]]:
    """The same job on all cameras at once."""
    return outcomes({thread.plan.name: thread.do(job) for thread in threads}, timeout_s)
