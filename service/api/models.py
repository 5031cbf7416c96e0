"""What all resources have in common on the wire."""

from __future__ import annotations

from typing import Annotated, Generic

from fastapi import Header, Query
from pydantic import AwareDatetime, Field

from service.api.responses import Responses
from service.kinds.base import LARGEST_JSON_INTEGER, Model, ResultT
from service.store.tables import JobStatus

Limit = Annotated[int, Query(ge=1, le=200, description="How many to list.")]
Cursor = Annotated[
    int | None,
    Query(ge=1, le=LARGEST_JSON_INTEGER, description="Where to go on: `next` of the page before."),
]
IdempotencyKeyHeader = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        min_length=1,
        max_length=200,
        pattern=r"^[!-~]+$",
        description="A name you choose for this request, such as a UUID. Sent again with the same "
        "key, the request is answered as the first time and nothing is done twice.",
    ),
]
LastEventIdHeader = Annotated[
    int | None,
    Header(
        alias="Last-Event-ID",
        ge=0,
        le=LARGEST_JSON_INTEGER,
        description="The last event you have seen; the stream goes on after it.",
    ),
]


class Fault(Model):
    """One thing that is wrong with a request."""

    location: str
    message: str


class Problem(Model):
    """An error, as RFC 9457 has it. ``type`` is stable; ``docs/how-to/api.md`` lists them."""

    type: str
    title: str
    status: int
    detail: str
    remedy: str
    errors: list[Fault] = Field(default_factory=list)


class JobProgress(Model):
    """How far a job is. ``fraction`` goes from 0 to 1."""

    stage: str
    fraction: float
    start: int
    iteration: int
    cost: float | None
    violation: float | None


class Job(Model, Generic[ResultT]):
    """A piece of long work. ``status`` alone tells whether it is over."""

    id: str
    kind: str
    status: JobStatus
    scan_id: str | None
    cancel_requested: bool
    created_at: AwareDatetime
    started_at: AwareDatetime | None
    ended_at: AwareDatetime | None
    progress: JobProgress | None
    result: ResultT | None
    problem: Problem | None
    links: dict[str, str]


class File(Model):
    """A file that a job made."""

    name: str
    media_type: str
    size_bytes: int
    sha256: str
    href: str


class FileList(Model):
    """The files of a job."""

    items: list[File]


def problems(*statuses: int) -> Responses:
    """The documentation of error answers: problem details and nothing else."""
    schema = {"$ref": "#/components/schemas/Problem"}
    return {
        status: {
            "description": _MEANING[status],
            "content": {"application/problem+json": {"schema": schema}},
        }
        for status in statuses
    }


_MEANING = {
    400: "The request is not well formed.",
    401: "A key is needed, and none came, or none that is valid.",
    403: "The key may not do this; or a web page of another origin, or one that did not have to "
    "ask, wants to change something.",
    404: "There is no such thing.",
    408: "The body did not come in time.",
    409: "Not possible in the present state.",
    413: "What was sent is too large.",
    415: "This media type is not accepted.",
    421: "The service is not called by this name.",
    429: "Too many wrong keys came from this address.",
    423: "The interlock is open: nothing may fire.",
    422: "What was sent cannot be used; the detail says what to change.",
    503: "A device is missing, too much work is waiting, or the service is stopping; try again "
    "later.",
    507: "The disk is full.",
}
