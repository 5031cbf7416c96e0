"""How a job that runs is told to stop, whoever runs it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from service.jobs.notifier import Notifier
from service.store import Store
from service.store.jobrecords import JobRecord


class Cancels:
    """The jobs that run in this process, each with the event that asks it to stop.

    What was asked for stands in the store first: a job that is found there as cancelled ends as
    cancelled even where its event came too late to be heard.
    """

    def __init__(self, store: Store, notifier: Notifier) -> None:
        self._store = store
        self._notifier = notifier
        self._lock = threading.Lock()
        self._events: dict[str, threading.Event] = {}

    @contextmanager
    def running(self, job_id: str) -> Iterator[threading.Event]:
        """The event of a job, while the job runs."""
        event = threading.Event()
        with self._lock:
            self._events[job_id] = event
        if self._store.jobs.get(job_id).cancel_requested:
            # Asked for between the job's claim and the moment the event could be found.
            event.set()
        try:
            yield event
        finally:
            with self._lock:
                del self._events[job_id]

    def cancel(self, job_id: str, kind: str) -> JobRecord:
        """Ask a job to stop. Raises :class:`~common.errors.ConflictError` if it has ended."""
        record = self._store.jobs.request_cancel(job_id, kind)
        with self._lock:
            event = self._events.get(job_id)
        if event is not None:
            event.set()
        self._notifier.notify(job_id)
        return record

    def stop_all(self) -> None:
        """Ask all to stop; unlike cancelled ones they are marked as interrupted."""
        with self._lock:
            for event in self._events.values():
                event.set()
