"""The rows of jobs, and how one row is read and changed within a transaction."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, RowMapping, func, insert, select, update

from common.errors import NotFoundError
from service.store.tables import JobStatus, job_events, jobs, utc_now

JSON = dict[str, Any]


@dataclass(frozen=True)
class JobRecord:
    """A job as it stands."""

    seq: int
    id: str
    kind: str
    status: JobStatus
    request: JSON
    scan_id: str | None
    cancel_requested: bool
    progress: JSON | None
    result: JSON | None
    problem: JSON | None
    created_at: str
    started_at: str | None
    ended_at: str | None


@dataclass(frozen=True)
class JobEvent:
    """Something that happened to a job. ``id`` counts from 1 within the job."""

    id: int
    type: str
    data: JSON
    at: str

    @property
    def problem(self) -> dict[str, str] | None:
        """The error that the event tells of, as fields."""
        return self.data.get("problem")


@dataclass(frozen=True)
class FileRecord:
    """A file that a job left. ``path`` is where it is kept."""

    name: str
    media_type: str
    size_bytes: int
    sha256: str
    path: Path


@dataclass(frozen=True)
class JobInput:
    """A file of the store that a job works on; the job keeps it, whoever else forgets it.

    ``name`` is what the file is called in the job's folder: readers go by the suffix.
    """

    role: str
    name: str
    sha256: str


@dataclass(frozen=True)
class NewJob:
    """What is asked for."""

    kind: str
    request: JSON
    scan_id: str | None = None
    inputs: tuple[JobInput, ...] = ()


def one_job(connection: Connection, job_id: str, kind: str | None = None) -> JobRecord:
    """One job, of the given kind. Raises :class:`NotFoundError`."""
    row = connection.execute(select(jobs).where(jobs.c.id == job_id)).mappings().one_or_none()
    if row is None or kind not in (None, row["kind"]):
        what = kind or "job"
        raise NotFoundError(
            what, f"there is no {what} {job_id!r}", f"list the {what}s to see which exist"
        )
    return record_of(row)


def record_of(row: RowMapping) -> JobRecord:
    """A row of the table of jobs as a record."""
    return replace(JobRecord(**row), status=JobStatus(row["status"]))


def restored(stored: JSON) -> JSON:
    """The fields of a record that went through JSON."""
    return {**stored, "status": JobStatus(stored["status"])}


def set_status(
    connection: Connection,
    job_id: str,
    status: JobStatus,
    event: JSON,
    **values: Any,  # noqa: ANN401 - columns of the table
) -> None:
    """Change a job's status, with the event that tells of it."""
    connection.execute(update(jobs).where(jobs.c.id == job_id).values(status=status, **values))
    append_event(connection, job_id, status, {"status": status, **event})


def end_job(
    connection: Connection,
    job_id: str,
    status: JobStatus,
    event: JSON,
    **values: Any,  # noqa: ANN401 - columns of the table
) -> None:
    """Change a job's status to a terminal one."""
    set_status(connection, job_id, status, event, ended_at=utc_now(), **values)


def append_event(connection: Connection, job_id: str, kind: str, data: JSON) -> None:
    """Add an event to a job; it gets the next number."""
    last = connection.scalar(
        select(func.coalesce(func.max(job_events.c.id), 0)).where(job_events.c.job_id == job_id)
    )
    connection.execute(
        insert(job_events).values(
            job_id=job_id, id=(last or 0) + 1, type=str(kind), data=data, at=utc_now()
        )
    )
