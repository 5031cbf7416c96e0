"""What calibrations, checks and acceptance tests have in common over HTTP."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from common.errors import ConflictError, NotFoundError
from service.api.context import Service
from service.api.picturesets import KIND as PICTURE_SET
from service.api.targetsets import KIND as TARGET_SET
from service.kinds.base import Id, Model, RunContext
from service.kinds.sessions import CaptureId
from service.pictures.listing import pictures_in_session
from service.store.jobrecords import JobInput, JobRecord
from service.store.tables import utc_now


class Pictures(Model):
    """Where the pictures are: an uploaded set, or a session of a rig of this service."""

    picture_set_id: Id | None = None
    session: Annotated[
        str | None, Field(max_length=100, description="Name of a session with captures.")
    ] = None
    captures: Annotated[
        list[CaptureId],
        Field(max_length=10_000, description="Captures of the session; all without a list."),
    ] = Field(default_factory=list)

    @model_validator(mode="after")
    def _one_source(self) -> Pictures:
        if (self.picture_set_id is None) == (self.session is None):
            raise ValueError("give picture_set_id or session, one of them")
        if self.captures and self.session is None:
            raise ValueError("captures are those of a session")
        return self


def picture_source(
    service: Service, pictures: Pictures, reference: str = ""
) -> tuple[RunContext, tuple[JobInput, ...]]:
    """The part of a task's run, and its inputs, that name the pictures.

    ``reference``: the calibration they are compared with. Raises :class:`NotFoundError` and
    :class:`~common.errors.InputError` for what is not there.
    """
    run = RunContext(made_utc=utc_now(), reference=reference)
    if pictures.picture_set_id is not None:
        found = service.store.documents.get(PICTURE_SET, pictures.picture_set_id)
        return run, (found.as_input("pictures"),)
    folder = service.rigs.session_folder(str(pictures.session))
    pictures_in_session(folder, pictures.captures)
    return run.model_copy(update={"session": str(folder), "captures": pictures.captures}), ()


def target_input(service: Service, target_set_id: str) -> JobInput:
    """A target set as a task's input."""
    return service.store.documents.get(TARGET_SET, target_set_id).as_input("targets")


def made_file(service: Service, job_id: str, kind: str, name: str, role: str) -> JobInput:
    """A file that a completed job of ``kind`` made, as another task's input."""
    completed(service, job_id, kind)
    for file in service.store.jobs.files(job_id):
        if file.name == name:
            return JobInput(role, name, file.sha256)
    raise NotFoundError("file", f"the {kind} {job_id!r} has no file {name!r}", "make it again")


def completed(service: Service, job_id: str, kind: str) -> JobRecord:
    """A job that has a result. Raises :class:`NotFoundError` and :class:`ConflictError`."""
    job = service.store.jobs.get(job_id, kind)
    if not job.status.terminal:
        raise ConflictError("job-active", "the job has not ended", "wait until it is completed")
    if job.result is None:
        raise ConflictError(
            "job-without-result",
            f"the {kind} {job_id!r} has no result ({job.status})",
            f"give a completed {kind}",
        )
    return job
