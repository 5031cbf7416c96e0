"""The one place that turns errors into HTTP problems (RFC 9457) and exit codes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from common.errors import RigwrightError
from service.ipc import error_from_fields

MEDIA_TYPE = "application/problem+json"


@dataclass(frozen=True)
class ErrorKind:
    """What a kind of error means outside: HTTP status, exit code, title."""

    status: int
    exit_code: int
    title: str


KINDS: Mapping[str, ErrorKind] = {
    "input": ErrorKind(422, 2, "What was given cannot be used"),
    "too-large": ErrorKind(413, 2, "What was given is too large"),
    "not-found": ErrorKind(404, 2, "There is no such thing"),
    "conflict": ErrorKind(409, 2, "Not possible in the present state"),
    "unsatisfiable": ErrorKind(422, 3, "The limits cannot all be met"),
    "device": ErrorKind(503, 4, "A device is missing or silent"),
    "interlock": ErrorKind(423, 4, "The interlock is open"),
    "cancelled": ErrorKind(409, 130, "Cancelled by request"),
    "internal": ErrorKind(500, 1, "A fault of the program"),
}
"""By the ``kind`` of the error."""

STATUS_OF_CODE: Mapping[str, int] = {
    "input/malformed-json": 400,
    "input/bad-request": 400,
    "input/method-not-allowed": 405,
    "input/media-type": 415,
    "input/key-needed": 401,
    "input/key-wrong": 401,
    "input/signed-out": 401,
    "input/key-scope": 403,
    "input/cookie-bare": 403,
    "conflict/keys-guessed": 429,
    "input/host": 421,
    "input/origin": 403,
    "input/unmarked": 403,
    "input/body-slow": 408,
    "conflict/queue-full": 503,
    "conflict/not-ready": 503,
    "conflict/too-many-look": 503,
    "internal/disk-full": 507,
    "conflict/disk-full": 507,
    "internal/stopping": 503,
}
"""Where HTTP has a more telling status than that of the kind."""

EXIT_CODE_OF_CODE: Mapping[str, int] = {"internal/disk-full": 2}
"""Where the exit code is not that of the kind."""

HTTP_ERRORS: Mapping[int, tuple[str, str, str]] = {
    400: ("input", "bad-request", "send a request as the documentation describes it"),
    404: ("not-found", "path", "see GET /v1 for what there is"),
    405: ("input", "method-not-allowed", "use a method that the Allow header names"),
    413: ("too-large", "body", "send less, a design without its points for example"),
    415: ("input", "media-type", "send the media type that the documentation names"),
}
"""Kind, detail and remedy of the errors that the web framework raises by itself."""

EXIT_INFEASIBLE = KINDS["unsatisfiable"].exit_code


def status_of(error: RigwrightError) -> int:
    """The HTTP status of an error."""
    return STATUS_OF_CODE.get(error.code, KINDS[error.kind].status)


def exit_code_of(error: RigwrightError) -> int:
    """The exit code of a command that ends with an error."""
    return EXIT_CODE_OF_CODE.get(error.code, KINDS[error.kind].exit_code)


def problem_document(error: RigwrightError) -> dict[str, object]:
    """The problem details of an error, as they go over HTTP."""
    return {
        "type": f"/problems/{error.code}",
        "title": KINDS[error.kind].title,
        "status": status_of(error),
        "detail": str(error),
        "remedy": error.remedy,
    }


def stored_problem(fields: dict[str, str] | None) -> dict[str, object] | None:
    """The problem details of an error that the store has kept as fields."""
    return None if fields is None else problem_document(error_from_fields(fields))
