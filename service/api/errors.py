"""Every error answer of the application, in one shape."""

from __future__ import annotations

import errno

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import BaseModel
from sqlalchemy.exc import OperationalError
from starlette.exceptions import HTTPException
from starlette.routing import Match

from common.errors import InputError, InternalError, RigwrightError
from common.files.strict import unknown_key
from service.ipc import error_from_fields
from service.keys.ring import WRONG_WITHIN_S
from service.logs import log
from service.problems import HTTP_ERRORS, MEDIA_TYPE, problem_document, status_of

_RETRY_AFTER_S = "5"


class Refusal(HTTPException):
    """An error that reading a body meets: only HTTP errors come through the framework whole."""

    def __init__(self, error: RigwrightError) -> None:
        super().__init__(status_of(error), error.problem)
        self.error = error


def install_error_handlers(app: FastAPI) -> None:
    """Answer every exception with problem details."""
    app.add_exception_handler(RigwrightError, _rigwright_error)
    app.add_exception_handler(RequestValidationError, _invalid_request)
    app.add_exception_handler(HTTPException, _http_error)
    app.add_exception_handler(OperationalError, _store_error)
    app.add_exception_handler(OSError, _system_error)
    app.add_exception_handler(Exception, _fault)


def answer(error: RigwrightError, **more: object) -> JSONResponse:
    """The problem details of an error."""
    document = problem_document(error) | more
    response = JSONResponse(
        document, status_code=int(str(document["status"])), media_type=MEDIA_TYPE
    )
    if response.status_code == 503:
        response.headers["Retry-After"] = _RETRY_AFTER_S
    if response.status_code == 401:
        response.headers["WWW-Authenticate"] = 'Bearer realm="rigwright"'
    if response.status_code == 429:
        response.headers["Retry-After"] = f"{WRONG_WITHIN_S:.0f}"
    if response.status_code in (401, 403, 408, 413, 415, 421, 429):
        # The rest of the body is not read, so nothing else can come on this connection.
        response.headers["Connection"] = "close"
    return response


def _rigwright_error(_request: Request, error: Exception) -> JSONResponse:
    if not isinstance(error, RigwrightError):
        raise error
    if error.kind == "internal":
        log.error("internal error", exc_info=error)
    return answer(error)


def _invalid_request(request: Request, error: Exception) -> JSONResponse:
    if not isinstance(error, RequestValidationError):
        raise error
    # A misspelt key often makes another seem missing: it comes first.
    found = sorted(error.errors(), key=lambda fault: fault["type"] != "extra_forbidden")
    faults = [
        {"location": ".".join(str(part) for part in fault["loc"]), "message": fault["msg"]}
        for fault in found
    ]
    if any(fault["type"] == "json_invalid" for fault in found):
        return answer(
            InputError("malformed-json", "the body is not JSON", "send a JSON object"),
            errors=faults,
        )
    more = f" ({len(faults) - 1} more)" if len(faults) > 1 else ""
    message = faults[0]["message"].removeprefix("Value error, ")
    remedy = "compare the request with GET /openapi.json"
    if found[0]["type"] == "extra_forbidden":
        message, remedy = "this key is not known", _nearest_key(request, found[0]["loc"]) or remedy
    problem = f"{faults[0]['location']}: {message}{more}"
    return answer(InputError("request-invalid", problem, remedy), errors=faults)


def _nearest_key(request: Request, location: tuple[int | str, ...]) -> str:
    """What was meant by a key of the body; empty where its model cannot be told."""
    body = getattr(request.scope.get("route"), "body_field", None)
    model = None if body is None else body.field_info.annotation
    if location[0] != "body" or not isinstance(model, type) or not issubclass(model, BaseModel):
        return ""
    return unknown_key(model, location[1:])


def _http_error(request: Request, error: Exception) -> JSONResponse:
    if not isinstance(error, HTTPException):
        raise error
    if isinstance(error, Refusal):
        return answer(error.error)
    kind, detail, remedy = HTTP_ERRORS.get(error.status_code, HTTP_ERRORS[400])
    response = answer(
        error_from_fields(
            {"kind": kind, "detail": detail, "problem": str(error.detail).lower(), "remedy": remedy}
        )
    )
    response.headers.update(error.headers or {})
    if error.status_code == 405:
        # The router names the methods of the first route with this path only.
        response.headers["Allow"] = ", ".join(sorted(_methods(request)))
    return response


def _methods(request: Request) -> set[str]:
    found: set[str] = set()
    for router in request.app.state.routers:
        for route in router.routes:
            match, _ = route.matches(request.scope)
            if match is not Match.NONE:
                found |= set(route.methods)
    return found


def _store_error(request: Request, error: Exception) -> JSONResponse:
    if "disk is full" in str(error):
        return answer(_disk_full())
    return _fault(request, error)


def _system_error(request: Request, error: Exception) -> JSONResponse:
    if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
        return answer(_disk_full())
    return _fault(request, error)


def _disk_full() -> InternalError:
    return InternalError(
        "disk-full",
        "the disk of the service is full",
        "remove designs or scans that are not needed",
    )


def _fault(_request: Request, error: Exception) -> JSONResponse:
    log.error("a request met a fault", exc_info=error)
    return answer(
        InternalError(
            "fault", "the service met a fault", "see the service's log for the request's id"
        )
    )
