"""How a job that runs is told to stop, whoever runs it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from sqlalchemy.exc import SQLAlchemyError

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
        self._unwritten: set[str] = set()

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
        """Ask a job to stop. Raises :class:`~common.errors.ConflictError` if it has ended.

        A job that runs here stops also where the disk is too full to write that it should.
        """
        try:
            record = self._store.jobs.request_cancel(job_id, kind)
        except SQLAlchemyError:
            with self._lock:
                if job_id not in self._events:
                    raise
                self._unwritten.add(job_id)
            record = replace(self._store.jobs.get(job_id, kind), cancel_requested=True)
        with self._lock:
            event = self._events.get(job_id)
        if event is not None:
            event.set()
        self._notifier.notify(job_id)
        return record

    def asked(self, job_id: str) -> bool:
        """Whether a job was asked to stop, written down or not."""
        with self._lock:
            if job_id in self._unwritten:
                return True
        return self._store.jobs.get(job_id).cancel_requested

    def stop_all(self) -> None:
        """Ask all to stop; unlike cancelled ones they are marked as interrupted."""
        with self._lock:
            for event in self._events.values():
                event.set()
