"""Wakes the event streams when a job has news."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager


class Notifier:
    """Rung from any thread, heard on the event loop."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._listeners: dict[str, set[tuple[asyncio.AbstractEventLoop, asyncio.Event]]] = {}
        self._closed = False

    @property
    def closed(self) -> bool:
        """Whether the service is stopping, so that streams must end."""
        return self._closed

    def notify(self, job_id: str) -> None:
        """Wake everyone who listens to a job."""
        with self._lock:
            listeners = list(self._listeners.get(job_id, ()))
        _wake(listeners)

    def close(self) -> None:
        """Wake everyone for the last time."""
        with self._lock:
            self._closed = True
            listeners = [one for some in self._listeners.values() for one in some]
        _wake(listeners)

    @contextmanager
    def listen(self, job_id: str) -> Iterator[asyncio.Event]:
        """An event that is set whenever the job has news."""
        listener = (asyncio.get_running_loop(), asyncio.Event())
        with self._lock:
            self._listeners.setdefault(job_id, set()).add(listener)
        try:
            yield listener[1]
        finally:
            with self._lock:
                self._listeners[job_id].discard(listener)
                if not self._listeners[job_id]:
                    del self._listeners[job_id]


def _wake(listeners: list[tuple[asyncio.AbstractEventLoop, asyncio.Event]]) -> None:
    for loop, heard in listeners:
        if not loop.is_closed():
            loop.call_soon_threadsafe(heard.set)
