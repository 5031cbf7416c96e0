"""What every resource that is a job can do: look, listen, cancel, fetch files, remove."""

# No postponed annotations here: FastAPI could not resolve those that name a local dependency.
from collections.abc import AsyncIterator, Callable
from datetime import datetime
from typing import Annotated, Generic
from urllib.parse import quote

from anyio import to_thread
from fastapi import APIRouter, Depends, Response
from fastapi.sse import EventSourceResponse, ServerSentEvent
from pydantic import BaseModel

from common.errors import ConflictError, NotFoundError
from service.api.addresses import at
from service.api.conditional import StoredFile
from service.api.context import Service, ServiceDep
from service.api.models import (
    Cursor,
    File,
    FileList,
    Job,
    JobProgress,
    LastEventIdHeader,
    Limit,
    Problem,
    problems,
)
from service.api.responses import a_file
from service.kinds.base import JobKind, RequestT, ResultT
from service.problems import stored_problem
from service.store.jobrecords import JobEvent, JobRecord

_TERMINAL = ("completed", "failed", "cancelled", "interrupted")


class JobResource(Generic[RequestT, ResultT]):
    """The routes of one kind of job under ``/v1/<plural>``.

    ``with_files`` says whether such jobs leave files of their own.
    """

    def __init__(
        self,
        kind: JobKind[RequestT, ResultT],
        plural: str,
        model: type[Job[ResultT]],
        page: type[BaseModel],
        *,
        with_files: bool = True,
    ) -> None:
        self.kind = kind
        self.path = f"/v1/{plural}"
        self._one = kind.name.replace("-", "_")
        self._all = plural.replace("-", "_")
        self._model = model
        self._page = page
        self._with_files = with_files

    def location(self, job: JobRecord) -> str:
        """The address of a job."""
        return at(f"{self.path}/{job.id}")

    def document(self, job: JobRecord) -> Job[ResultT]:
        """A job as it goes over HTTP."""
        own = self.location(job)
        words = ("events", "cancel", "files") if self._with_files else ("events", "cancel")
        return self._model(
            id=job.id,
            kind=job.kind,
            status=job.status,
            scan_id=job.scan_id,
            cancel_requested=job.cancel_requested,
            created_at=datetime.fromisoformat(job.created_at),
            started_at=_time(job.started_at),
            ended_at=_time(job.ended_at),
            progress=None if job.progress is None else JobProgress.model_validate(job.progress),
            result=self.kind.result_from_row(job.result),
            problem=problem_of(job.problem),
            links={"self": own} | {name: f"{own}/{name}" for name in words},
        )

    def add_to(self, router: APIRouter) -> None:
        """Add the routes that all kinds of jobs have."""
        self._add_reading(router)
        self._add_events(router)
        self._add_changing(router)
        if self._with_files:
            self._add_files(router)

    def _add_reading(self, router: APIRouter) -> None:
        @router.get(
            self.path,
            name=f"list_{self._all}",
            response_model=self._page,
            responses=problems(422),
        )
        def list_jobs(service: ServiceDep, limit: Limit = 50, cursor: Cursor = None) -> BaseModel:
            """List jobs, newest first."""
            found = service.store.jobs.page(self.kind.name, limit + 1, cursor)
            shown = found[:limit]
            return self._page.model_validate(
                {
                    "items": [self.document(job) for job in shown],
                    "next": shown[-1].seq if len(found) > limit else None,
                }
            )

        @router.get(
            self.path + "/{job_id}",
            name=f"read_{self._one}",
            response_model=self._model,
            responses=problems(404),
        )
        def read_job(service: ServiceDep, job_id: str) -> Job[ResultT]:
            """Read the status, progress and result of a job."""
            return self.document(service.store.jobs.get(job_id, self.kind.name))

    def _add_events(self, router: APIRouter) -> None:
        def existing(service: ServiceDep, job_id: str) -> JobRecord:
            return service.store.jobs.get(job_id, self.kind.name)

        @router.get(
            self.path + "/{job_id}/events",
            name=f"follow_{self._one}",
            response_class=EventSourceResponse,
            responses=problems(404, 422),
        )
        async def follow_job(
            service: ServiceDep,
            job: Annotated[JobRecord, Depends(existing)],
            last_event_id: LastEventIdHeader = None,
        ) -> AsyncIterator[ServerSentEvent]:
            """Follow a job as server-sent events.

            `pending`, `running` and `progress` come while it goes on; `completed`, `failed`,
            `cancelled` or `interrupted` is the last event.
            """
            async for event in _events(service, job.id, last_event_id or 0):
                yield event

    def _add_changing(self, router: APIRouter) -> None:
        @router.post(
            self.path + "/{job_id}/cancel",
            name=f"cancel_{self._one}",
            status_code=202,
            response_model=self._model,
            responses=problems(404, 409),
        )
        def cancel_job(service: ServiceDep, job_id: str, response: Response) -> Job[ResultT]:
            """Ask a job to stop. Asking again changes nothing; once it has ended: 409."""
            job = service.cancels.cancel(job_id, self.kind.name)
            response.headers["Location"] = self.location(job)
            return self.document(job)

        @router.delete(
            self.path + "/{job_id}",
            name=f"remove_{self._one}",
            status_code=204,
            responses=problems(404, 409),
        )
        def remove_job(service: ServiceDep, job_id: str) -> None:
            """Remove a job that has ended, with its files."""
            service.store.jobs.remove(job_id, self.kind.name)

    def _add_files(self, router: APIRouter) -> None:
        @router.get(
            self.path + "/{job_id}/files",
            name=f"list_{self._one}_files",
            response_model=FileList,
            responses=problems(404),
        )
        def list_files(service: ServiceDep, job_id: str) -> FileList:
            """List the files a job made; none until it is completed."""
            service.store.jobs.get(job_id, self.kind.name)
            items = [
                File(
                    name=file.name,
                    media_type=file.media_type,
                    size_bytes=file.size_bytes,
                    sha256=file.sha256,
                    href=at(f"{self.path}/{job_id}/files/{quote(file.name)}"),
                )
                for file in service.store.jobs.files(job_id)
            ]
            return FileList(items=items)

        @router.get(
            self.path + "/{job_id}/files/{name:path}",
            name=f"read_{self._one}_file",
            response_class=StoredFile,
            responses=problems(404, 409) | a_file("application/octet-stream"),
        )
        def read_file(service: ServiceDep, job_id: str, name: str) -> StoredFile:
            """Fetch one file by its name in the list."""
            return self.file(service, job_id, name)

    def add_shortcut(self, router: APIRouter, word: str, file_name: str, media_type: str) -> None:
        """Give a file a path of its own, ``/{job_id}/<word>``."""

        def read_shortcut(service: ServiceDep, job_id: str) -> StoredFile:
            return self.file(service, job_id, file_name)

        read_shortcut.__doc__ = f"Fetch {file_name}."
        endpoint: Callable[..., StoredFile] = read_shortcut
        router.get(
            f"{self.path}/{{job_id}}/{word}",
            name=f"read_{self._one}_{word}",
            response_class=StoredFile,
            responses=problems(404, 409) | a_file(media_type, description=f"{file_name}."),
        )(endpoint)

    def file(self, service: Service, job_id: str, name: str) -> StoredFile:
        """One file of a job. The name is looked up among the job's files, never used as a path."""
        job = service.store.jobs.get(job_id, self.kind.name)
        if not job.status.terminal:
            raise ConflictError("job-active", "the job has not ended", "wait until it is completed")
        for file in service.store.jobs.files(job_id):
            if file.name == name and file.path.exists():
                return StoredFile(file.path, file.media_type, file.sha256)
        raise NotFoundError(
            "file", f"the {job.status} job has no file {name!r}", f"see {self.path}/{job_id}/files"
        )


async def _events(service: Service, job_id: str, last: int) -> AsyncIterator[ServerSentEvent]:
    with service.notifier.listen(job_id) as news:
        while not service.notifier.closed:
            # Cleared before reading: what happens after the read then sets it again.
            news.clear()
            # Asked before reading as well: a job seen to have ended has all its events written.
            goes_on = await to_thread.run_sync(_goes_on, service, job_id)
            for event in await to_thread.run_sync(service.store.jobs.events_after, job_id, last):
                last = event.id
                yield _sent(event)
                if event.type in _TERMINAL:
                    return
            if not goes_on:
                return
            await news.wait()


def _goes_on(service: Service, job_id: str) -> bool:
    # A client that has seen the last event already, or whose job was removed, has nothing more
    # to wait for.
    try:
        return not service.store.jobs.get(job_id).status.terminal
    except NotFoundError:
        return False


def _sent(event: JobEvent) -> ServerSentEvent:
    data = {**event.data, "at": event.at}
    if event.problem is not None:
        data["problem"] = stored_problem(event.problem)
    return ServerSentEvent(data=data, event=event.type, id=str(event.id))


def _time(stored: str | None) -> datetime | None:
    return None if stored is None else datetime.fromisoformat(stored)


def problem_of(stored: dict[str, str] | None) -> Problem | None:
    """The problem of an error that the store has kept."""
    document = stored_problem(stored)
    return None if document is None else Problem.model_validate(document)
