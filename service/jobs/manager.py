"""Takes pending jobs from the store, has them run, and writes down how they end.

The queue is the table of jobs itself: a few driver threads each claim the oldest pending job,
hand it to the engine and wait. Nothing about a job is remembered here that the store does not
know, except the means to cancel it.
"""

from __future__ import annotations

import mimetypes
import shutil
import threading
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from sqlalchemy.exc import SQLAlchemyError

from common.errors import CancelledError, InternalError, RigwrightError
from common.files.plain import plain
from common.progress import Progress
from service import logs
from service.ipc import error_fields
from service.jobs.cancels import Cancels
from service.jobs.engine import Engine, Task
from service.jobs.notifier import Notifier
from service.jobs.writing import RETRY_S, write_at_last
from service.kinds.base import JobKind, Result
from service.store import Store, interrupted
from service.store.blobs import StagedFile
from service.store.jobrecords import JobRecord
from service.store.tables import JobStatus

_MEDIA_TYPES = mimetypes.MimeTypes()
for _ending, _media_type in (
    (".glb", "model/gltf-binary"),
    (".stl", "model/stl"),
    (".3mf", "model/3mf"),
    (".dxf", "image/vnd.dxf"),
):
    _MEDIA_TYPES.add_type(_media_type, _ending)


class JobManager:
    """Drives ``at_once`` jobs at a time."""

    def __init__(
        self,
        store: Store,
        engine: Engine,
        kinds: Mapping[str, JobKind[Any, Any]],
        notifier: Notifier,
        cancels: Cancels,
        at_once: int,
    ) -> None:
        self._store = store
        self._engine = engine
        self._kinds = kinds
        self._notifier = notifier
        self._news = threading.Condition()
        self._stopping = threading.Event()
        self._cancels = cancels
        self._drivers = [
            threading.Thread(target=self._drive, name=f"job-driver-{n}", daemon=True)
            for n in range(at_once)
        ]

    def start(self) -> None:
        """Begin with what is pending."""
        for driver in self._drivers:
            driver.start()

    def wake(self) -> None:
        """Look for pending jobs again; to be called when one was added."""
        with self._news:
            self._news.notify_all()

    def stop(self) -> None:
        """Stop what runs and mark it interrupted. What is pending begins at the next start."""
        with self._news:
            self._stopping.set()
            self._news.notify_all()
        self._cancels.stop_all()
        for driver in self._drivers:
            driver.join()

    def _drive(self) -> None:
        while (job := self._next()) is not None:
            token = logs.job_id.set(job.id)
            try:
                self._run(job)
            except Exception:  # noqa: BLE001 - the other jobs depend on this thread
                logs.log.exception("a job could not be driven to its end")
                self._give_up(job)
            logs.job_id.reset(token)

    def _next(self) -> JobRecord | None:
        with self._news:
            while not self._stopping.is_set():
                try:
                    job = self._store.jobs.claim_next()
                except SQLAlchemyError:
                    # A full disk, most likely: jobs go on when there is room again.
                    logs.log.exception("the store cannot be written")
                    self._news.wait(RETRY_S)
                    continue
                if job is not None:
                    return job
                self._news.wait()
        return None

    def _run(self, job: JobRecord) -> None:
        self._notifier.notify(job.id)
        logs.log.info("job started", extra={"fields": {"kind": job.kind}})
        folder = self._store.work_folder(job.id)
        try:
            with self._cancels.running(job.id) as cancel:
                if self._stopping.is_set():
                    cancel.set()
                self._keep(job, self._work(job, folder, cancel), folder / "files")
        except RigwrightError as error:
            failed = error
            write_at_last(
                lambda: end_without_result(self._store, self._cancels, job.id, failed),
                self._stopping,
            )
        finally:
            shutil.rmtree(folder, ignore_errors=True)
            self._notifier.notify(job.id)

    def _give_up(self, job: JobRecord) -> None:
        lost = InternalError("job-lost", "the job could not be finished", "see the log")
        jobs = self._store.jobs
        # Where even this cannot be written, the next start finds the job and marks it.
        with suppress(SQLAlchemyError):
            write_at_last(
                lambda: jobs.end(job.id, JobStatus.FAILED, error_fields(lost)), self._stopping
            )
            self._notifier.notify(job.id)

    def _kind(self, job: JobRecord) -> JobKind[Any, Any]:
        if job.kind not in self._kinds:
            raise InternalError(
                "job-kind",
                f"this version cannot do {job.kind!r} jobs",
                "use the version that made the job",
            )
        return self._kinds[job.kind]

    def _work(self, job: JobRecord, folder: Path, cancel: threading.Event) -> Result:
        kind = self._kind(job)
        request, run = kind.from_row(job.request)
        (folder / "files").mkdir()

        def report(progress: Progress, /) -> None:
            # How far a job is may go unwritten; what comes of it may not.
            with suppress(SQLAlchemyError):
                self._store.jobs.record_progress(job.id, plain(progress))
            self._notifier.notify(job.id)

        inputs = self._inputs(job, folder)
        result: Result = self._engine.run(
            Task(kind, request, folder / "files", inputs, run), report, cancel
        )
        return result

    def _inputs(self, job: JobRecord, folder: Path) -> dict[str, Path]:
        """Links to the job's files under their own names.

        Readers tell formats apart by the suffix, which files kept by hash do not have. Each has
        a folder of its own, where it cannot meet another file's name.
        """
        given = self._store.jobs.inputs(job.id)
        if job.scan_id is not None:
            scan = self._store.scans.get(job.scan_id)
            given["scan"] = (scan.plain_name, self._store.scans.path(scan))
        links = {}
        for role, (name, path) in given.items():
            links[role] = folder / "inputs" / role / name
            links[role].parent.mkdir(parents=True)
            links[role].symlink_to(path.resolve())
        return links

    def _keep(self, job: JobRecord, result: Result, folder: Path) -> None:
        """Write down a result with its files; while the disk is full, until it is not."""
        row = self._kind(job).result_row(result)
        # Once: an attempt that fails may have moved files to their places already.
        files = write_at_last(lambda: self._staged(folder), self._stopping)
        write_at_last(lambda: self._store.jobs.complete(job.id, row, files), self._stopping)
        logs.log.info("job completed")

    def _staged(self, folder: Path) -> dict[str, tuple[StagedFile, str]]:
        return {
            path.relative_to(folder).as_posix(): (
                self._store.files.stage_existing(path),
                _MEDIA_TYPES.guess_type(path.name)[0] or "application/octet-stream",
            )
            for path in sorted(folder.rglob("*"))
            if path.is_file()
        }


def end_without_result(store: Store, cancels: Cancels, job_id: str, error: RigwrightError) -> None:
    """Write down how a job ended that has no result: failed, cancelled, or interrupted."""
    if not isinstance(error, CancelledError):
        status, fields = JobStatus.FAILED, error_fields(error)
    elif cancels.asked(job_id):
        status, fields = JobStatus.CANCELLED, None
    else:
        status, fields = JobStatus.INTERRUPTED, error_fields(interrupted())
    store.jobs.end(job_id, status, fields)
    logs.log.info("job ended", extra={"fields": {"status": status, "problem": fields}})
