"""Photographs taken by several processes, so that the caller's thread never computes.

Each process builds its own studio once and then takes shots. Processes are started anew (not
forked): a fork of a process with threads may hang. They end with their parent, even if that is
killed.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import connection, get_context, parent_process

from geometry.camera import RigCamera
from rig.acquisition.cameras.base import Image
from rig.simulation.settings import SceneSettings, SensorSettings
from rig.simulation.studio import Shot, Studio

_worker_studio: Studio | None = None


class RenderPool:
    """Takes photographs in ``workers`` processes; 0 takes them in one thread of this process.

    None is one process for each core that may be used. Nothing starts before the first shot.
    May be used by several threads.
    """

    def __init__(
        self,
        cameras: Sequence[RigCamera],
        scene: SceneSettings,
        sensor: SensorSettings,
        workers: int | None = None,
    ) -> None:
        self._parts = (tuple(cameras), scene, sensor)
        self._workers = _cores() if workers is None else workers
        self._lock = threading.Lock()
        self._executor: Executor | None = None
        self._studio: Studio | None = None
        self._closed = False

    def photograph(self, shot: Shot) -> Future[Image]:
        """Order one photograph."""
        with self._lock:
            if self._closed:
                raise RuntimeError("the pool is closed")
            if self._executor is None:
                self._executor = self._started()
            if self._studio is not None:
                return self._executor.submit(self._studio.photograph, shot)
            return self._executor.submit(_photograph, shot)

    def begin(self) -> None:
        """Let the processes start in the background, so that the first shot need not wait."""
        with self._lock:
            if self._closed or self._workers == 0 or self._executor is not None:
                return
            self._executor = self._started()
            for _ in range(self._workers):
                self._executor.submit(_nothing)

    def warm_up(self) -> None:
        """Start the processes and build their studios now rather than at the first shot."""
        first = self._parts[0][0]
        shots = [
            Shot(first.name, 1000.0, pixel_format="Mono8", seed=(number,))
            for number in range(max(self._workers, 1))
        ]
        for picture in [self.photograph(shot) for shot in shots]:
            picture.result()

    def close(self) -> None:
        """Take no more photographs; those not begun are cancelled. Closing twice is nothing."""
        with self._lock:
            self._closed = True
            executor, self._executor = self._executor, None
        if executor is not None:
            executor.shutdown(wait=True, cancel_futures=True)

    def _started(self) -> Executor:
        if self._workers == 0:
            self._studio = Studio(*self._parts)
            return ThreadPoolExecutor(1, thread_name_prefix="simulated-studio")
        return ProcessPoolExecutor(
            self._workers, get_context("spawn"), initializer=_begin, initargs=self._parts
        )


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _begin(cameras: tuple[RigCamera, ...], scene: SceneSettings, sensor: SensorSettings) -> None:
    """Make a process ready: one thread, an end with its parent, a studio."""
    import cv2
    from threadpoolctl import threadpool_limits

    global _worker_studio
    threadpool_limits(1)
    cv2.setNumThreads(1)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _worker_studio = Studio(cameras, scene, sensor)


def _end_with_parent() -> None:
    """Wait for the parent's end, however it comes, and end too.

    The queue between them is open at both ends in each process, so a process whose parent was
    killed would wait on it for ever.
    """
    parent = parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)


def _nothing() -> None:
    """What makes a process start."""


def _photograph(shot: Shot) -> Image:
    if _worker_studio is None:
        raise RuntimeError("the process was not made ready")
    return _worker_studio.photograph(shot)
