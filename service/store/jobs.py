"""Jobs of any kind: their state, their events and the files they leave.

The state of a job is written here and nowhere else. Whatever runs a job is disposable: after a
crash the rows tell what was finished and what was not.
"""

from __future__ import annotations

import uuid
from collections.abc import Collection, Mapping
from pathlib import Path

from sqlalchemy import Connection, delete, exists, func, insert, select, update

from common.errors import ConflictError, NotFoundError
from service.store import idempotency
from service.store.blobs import Blobs, StagedFile
from service.store.database import Database
from service.store.idempotency import IdempotencyKey
from service.store.jobrecords import (
    JSON,
    FileRecord,
    JobEvent,
    JobInput,
    JobRecord,
    NewJob,
    append_event,
    end_job,
    one_job,
    record_of,
    restored,
    set_status,
)
from service.store.tables import (
    JobStatus,
    blobs,
    job_events,
    job_files,
    job_inputs,
    jobs,
    scans,
    utc_now,
)


class Jobs:
    """The jobs of a store."""

    def __init__(self, database: Database, files: Blobs) -> None:
        self._database = database
        self._files = files

    def create(
        self,
        new: NewJob,
        *,
        max_pending: int,
        idempotency_key: IdempotencyKey | None = None,
        request_sha256: str = "",
    ) -> JobRecord:
        """Add a pending job, or return the one that the same key has created before.

        Raises :class:`ConflictError` when ``max_pending`` jobs are waiting already, and
        :class:`NotFoundError` when the scan is gone.
        """

        def change(connection: Connection) -> JobRecord:
            if idempotency_key is not None:
                stored = idempotency.claim(connection, idempotency_key)
                if stored is not None:
                    return JobRecord(**restored(idempotency.replay(stored, request_sha256)))
            waiting = connection.scalar(
                select(func.count()).where(jobs.c.status == JobStatus.PENDING)
            )
            if (waiting or 0) >= max_pending:
                raise ConflictError(
                    "queue-full", f"{waiting} jobs are waiting already", "try again later"
                )
            record = self._insert(connection, new)
            if idempotency_key is not None:
                given = {**record.__dict__}
                idempotency.answer(connection, idempotency_key, request_sha256, given)
            return record

        return self._database.write(change)

    def begin(self, new: NewJob, job_id: str) -> tuple[JobRecord, bool]:
        """A job that runs from now on under an id that its client chose, and whether it is new.

        Sent again, the same request gives the job that is there, however it ended. Raises
        :class:`ConflictError` when the id stands for another request.
        """

        def change(connection: Connection) -> tuple[JobRecord, bool]:
            known = connection.execute(select(jobs).where(jobs.c.id == job_id)).mappings().first()
            if known is None:
                return self._insert(connection, new, job_id, JobStatus.RUNNING), True
            if (known["kind"], known["request"]) != (new.kind, new.request):
                raise ConflictError(
                    "id-used",
                    f"{job_id!r} stands for another request already",
                    "choose a new id for a new request",
                )
            return record_of(known), False

        return self._database.write(change)

    def _insert(
        self,
        connection: Connection,
        new: NewJob,
        job_id: str | None = None,
        status: JobStatus = JobStatus.PENDING,
    ) -> JobRecord:
        job_id = job_id or str(uuid.uuid4())
        now = utc_now()
        if new.scan_id is not None and not connection.scalar(
            select(exists().where(scans.c.id == new.scan_id))
        ):
            raise NotFoundError(
                "scan", f"there is no scan {new.scan_id!r}", "upload it again, then ask again"
            )
        connection.execute(
            insert(jobs).values(
                id=job_id,
                kind=new.kind,
                status=status,
                request=new.request,
                scan_id=new.scan_id,
                cancel_requested=False,
                created_at=now,
                started_at=now if status is JobStatus.RUNNING else None,
            )
        )
        for given in new.inputs:
            _give(connection, job_id, given)
        append_event(connection, job_id, status, {"status": status})
        return one_job(connection, job_id)

    def get(self, job_id: str, kind: str | None = None) -> JobRecord:
        """One job, of the given kind. Raises :class:`NotFoundError`."""
        return self._database.read(lambda connection: one_job(connection, job_id, kind))

    def find(self, job_id: str) -> JobRecord | None:
        """One job of whatever kind, None when there is none."""
        query = select(jobs).where(jobs.c.id == job_id)
        row = self._database.read(lambda connection: connection.execute(query).mappings().first())
        return None if row is None else record_of(row)

    def page(self, kind: str, limit: int, before: int | None) -> list[JobRecord]:
        """Newest first; ``before`` is the ``seq`` at which the page before ended."""
        query = select(jobs).where(jobs.c.kind == kind).order_by(jobs.c.seq.desc()).limit(limit)
        if before is not None:
            query = query.where(jobs.c.seq < before)
        return self._database.read(
            lambda connection: [record_of(row) for row in connection.execute(query).mappings()]
        )

    def completed_against(self, kind: str, reference: str, limit: int) -> list[JobRecord]:
        """The completed jobs of a kind whose request names ``reference``, newest first."""
        named = jobs.c.request["reference"].as_string() == reference
        query = select(jobs).where(jobs.c.kind == kind, jobs.c.status == JobStatus.COMPLETED, named)
        query = query.order_by(jobs.c.seq.desc()).limit(limit)
        return self._database.read(
            lambda connection: [record_of(row) for row in connection.execute(query).mappings()]
        )

    def need_session(self, session: str) -> bool:
        """Whether a job that has not ended reads the session of that path."""
        active = jobs.c.status.in_([JobStatus.PENDING, JobStatus.RUNNING])
        query = select(exists().where(jobs.c.request["session"].as_string() == session, active))
        return bool(self._database.read(lambda connection: connection.scalar(query)))

    def counts(self) -> dict[JobStatus, int]:
        """How many jobs are in each state."""
        query = select(jobs.c.status, func.count()).group_by(jobs.c.status)
        rows = self._database.read(lambda connection: connection.execute(query).all())
        return {JobStatus(status): int(count) for status, count in rows}

    def events_after(self, job_id: str, event_id: int) -> list[JobEvent]:
        """The events of a job that follow ``event_id``, in order."""
        query = (
            select(job_events.c.id, job_events.c.type, job_events.c.data, job_events.c.at)
            .where(job_events.c.job_id == job_id, job_events.c.id > event_id)
            .order_by(job_events.c.id)
        )
        return self._database.read(
            lambda connection: [JobEvent(**row) for row in connection.execute(query).mappings()]
        )

    def files(self, job_id: str) -> list[FileRecord]:
        """The files that a job left, by name."""
        query = (
            select(job_files.c.name, job_files.c.media_type, blobs.c.size_bytes, blobs.c.sha256)
            .join_from(job_files, blobs, job_files.c.blob_sha256 == blobs.c.sha256)
            .where(job_files.c.job_id == job_id)
            .order_by(job_files.c.name)
        )
        rows = self._database.read(lambda connection: connection.execute(query).mappings().all())
        return [FileRecord(**row, path=self._files.path(row["sha256"])) for row in rows]

    def given(self, job_id: str) -> list[JobInput]:
        """The files a job was given."""
        query = select(job_inputs).where(job_inputs.c.job_id == job_id)
        rows = self._database.read(lambda connection: connection.execute(query).mappings().all())
        return [JobInput(row["role"], row["name"], row["blob_sha256"]) for row in rows]

    def inputs(self, job_id: str) -> dict[str, tuple[str, Path]]:
        """The same: by role the name, and where it is kept."""
        return {
            given.role: (given.name, self._files.path(given.sha256)) for given in self.given(job_id)
        }

    def claim_next(self) -> JobRecord | None:
        """Turn the oldest pending job into a running one; None when nothing waits."""

        def change(connection: Connection) -> JobRecord | None:
            job_id = connection.scalar(
                select(jobs.c.id)
                .where(jobs.c.status == JobStatus.PENDING)
                .order_by(jobs.c.seq)
                .limit(1)
            )
            if job_id is None:
                return None
            set_status(connection, job_id, JobStatus.RUNNING, {}, started_at=utc_now())
            return one_job(connection, job_id)

        return self._database.write(change)

    def record_progress(self, job_id: str, progress: JSON) -> None:
        """Note how far a running job is."""

        def change(connection: Connection) -> None:
            connection.execute(update(jobs).where(jobs.c.id == job_id).values(progress=progress))
            append_event(connection, job_id, "progress", progress)

        self._database.write(change)

    def complete(
        self, job_id: str, result: JSON, files: Mapping[str, tuple[StagedFile, str]]
    ) -> None:
        """The job's result and files (name: file, media type) become durable in one step."""

        def change(connection: Connection) -> None:
            for name, (staged, media_type) in files.items():
                self._files.adopt(connection, staged)
                connection.execute(
                    insert(job_files).values(
                        job_id=job_id, name=name, blob_sha256=staged.sha256, media_type=media_type
                    )
                )
            end_job(connection, job_id, JobStatus.COMPLETED, {"result": result}, result=result)

        self._database.write(change)

    def end(self, job_id: str, status: JobStatus, problem: JSON | None = None) -> None:
        """The job ended without a result."""
        self._database.write(
            lambda connection: end_job(
                connection, job_id, status, {"problem": problem}, problem=problem
            )
        )

    def request_cancel(self, job_id: str, kind: str) -> JobRecord:
        """Ask a job to stop. A pending one ends at once; asking twice changes nothing.

        Raises :class:`ConflictError` when the job has ended.
        """

        def change(connection: Connection) -> JobRecord:
            job = one_job(connection, job_id, kind)
            if job.status.terminal:
                raise ConflictError(
                    "job-ended",
                    f"the job has already ended ({job.status})",
                    "there is nothing to cancel",
                )
            connection.execute(
                update(jobs).where(jobs.c.id == job_id).values(cancel_requested=True)
            )
            if job.status is JobStatus.PENDING:
                end_job(connection, job_id, JobStatus.CANCELLED, {})
            return one_job(connection, job_id)

        return self._database.write(change)

    def remove(self, job_id: str, kind: str) -> None:
        """Remove a job that has ended, with its events and files."""
        unused: list[str] = []

        def change(connection: Connection) -> None:
            if not one_job(connection, job_id, kind).status.terminal:
                raise ConflictError(
                    "job-active", "the job has not ended", "cancel it first, then remove it"
                )
            connection.execute(delete(jobs).where(jobs.c.id == job_id))
            unused.extend(self._files.forget_unused(connection))

        self._database.write(change, after=lambda: self._files.remove(unused))

    def running(self, kinds: Collection[str]) -> list[JobRecord]:
        """The jobs of some kinds that run, or did when the service died."""
        query = select(jobs).where(jobs.c.status == JobStatus.RUNNING, jobs.c.kind.in_(kinds))
        return self._database.read(
            lambda connection: [record_of(row) for row in connection.execute(query).mappings()]
        )

    def interrupt_running(self, problem: JSON, *, but: Collection[str] = ()) -> list[str]:
        """On start: jobs that ran when the service died are marked, and their ids returned.

        Pending ones stay: they had not begun, and all they need is in the store. Those of the
        kinds in ``but`` stay too: somebody else can still find out how they ended.
        """

        def change(connection: Connection) -> list[str]:
            left = connection.scalars(
                select(jobs.c.id).where(jobs.c.status == JobStatus.RUNNING, jobs.c.kind.not_in(but))
            )
            ids = list(left)
            for job_id in ids:
                end_job(
                    connection, job_id, JobStatus.INTERRUPTED, {"problem": problem}, problem=problem
                )
            return ids

        return self._database.write(change)


def _give(connection: Connection, job_id: str, given: JobInput) -> None:
    kept = exists().where(blobs.c.sha256 == given.sha256)
    if not connection.scalar(select(kept)):
        raise NotFoundError(
            given.role, f"the {given.role} has just been removed", "make it again, then ask again"
        )
    connection.execute(
        insert(job_inputs).values(
            job_id=job_id, role=given.role, name=given.name, blob_sha256=given.sha256
        )
    )
