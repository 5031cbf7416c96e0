"""Orders to the thread that owns a port."""

from __future__ import annotations

import os
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any

PATIENCE_S = 1.9
"""How long an order may take in all; whoever gave it is told by then."""


@dataclass
class PortJob:
    """One order. ``work`` runs on the owner's thread, before ``deadline_ns`` or not at all."""

    work: Callable[[], Any]
    deadline_ns: int
    urgent: bool = False
    future: Future[Any] = field(default_factory=Future)


class JobQueue:
    """Orders in turn, urgent ones first. ``handle`` is readable when there is something to do."""

    def __init__(self) -> None:
        self._jobs: deque[PortJob] = deque()
        self._lock = threading.Lock()
        self._read, self._write = os.pipe()
        os.set_blocking(self._write, False)
        self._closed = False
        self._urgent = 0

    @property
    def urgent(self) -> bool:
        """Whether an urgent order waits: what can be left undone should be."""
        return self._urgent > 0

    @property
    def handle(self) -> int:
        """To wait on."""
        return self._read

    def put(self, work: Callable[[], Any], urgent: bool = False) -> PortJob:
        """A new order."""
        job = PortJob(work, time.monotonic_ns() + int(PATIENCE_S * 1e9), urgent)
        with self._lock:
            if self._closed:
                job.future.cancel()
            elif urgent:
                self._jobs.appendleft(job)
                self._urgent += 1
            else:
                self._jobs.append(job)
        self.wake()
        return job

    def take(self) -> PortJob | None:
        """The next order that its giver still waits for."""
        while True:
            with self._lock:
                if not self._jobs:
                    return None
                job = self._jobs.popleft()
                self._urgent -= job.urgent
            if job.future.set_running_or_notify_cancel():
                return job

    def fail_overdue(self, error: Exception, margin_s: float) -> None:
        """Give up those that cannot be met in time any more."""
        now = time.monotonic_ns() + int(margin_s * 1e9)
        with self._lock:
            overdue = [job for job in self._jobs if job.deadline_ns <= now]
            for job in overdue:
                self._jobs.remove(job)
                self._urgent -= job.urgent
        for job in overdue:
            if job.future.set_running_or_notify_cancel():
                job.future.set_exception(error)

    def wake(self) -> None:
        """Make :attr:`handle` readable."""
        with self._lock:
            if not self._closed:
                try:
                    os.write(self._write, b"w")
                except BlockingIOError:
                    return  # full: it is readable already

    def close(self) -> None:
        """No orders any more; those waiting are cancelled."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
            left, self._jobs = list(self._jobs), deque()
            os.close(self._read)
            os.close(self._write)
        for job in left:
            job.future.cancel()
