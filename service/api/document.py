"""The OpenAPI document: what FastAPI makes of the routes, and what it cannot know."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from pydantic import AwareDatetime, BaseModel

from service.api.door import COOKIE
from service.api.models import Problem, problems
from service.api.scopes import OPEN, needed_scope
from service.kinds.base import Model
from service.kinds.examples import body_examples
from service.store.tables import JobStatus

Json = dict[str, Any]
EVENTS = ("pending", "running", "progress", "completed", "failed", "cancelled", "interrupted")
"""What a job's stream tells; the last four end it."""

_REF = "#/components/schemas/{model}"


_SCHEMES: Json = {
    "key": {
        "type": "http",
        "scheme": "bearer",
        "description": "What `rigwright keys add` showed. A service that listens on 127.0.0.1 "
        "alone asks for none.",
    },
    "signIn": {
        "type": "apiKey",
        "in": "cookie",
        "name": COOKIE,
        "description": "A browser's sign-in; changes something only together with `Origin` and "
        "`X-Rigwright`.",
    },
}


class JobEventData(Model):
    """The data of an event: of `progress` how far the job is, of all others its status.

    `failed` and `interrupted` have a problem.
    """

    at: AwareDatetime
    status: JobStatus | None = None
    stage: str | None = None
    fraction: float | None = None
    start: int | None = None
    iteration: int | None = None
    cost: float | None = None
    violation: float | None = None
    problem: Problem | None = None


_making = threading.Lock()


def openapi_text(app: FastAPI, prefix: str) -> bytes:
    """The document as it is sent, made once for all; ``prefix`` is what a proxy puts first."""
    with _making:
        return _text(app, prefix)


@lru_cache(maxsize=4)
def _text(app: FastAPI, prefix: str) -> bytes:
    schema = app.openapi()
    if prefix:
        schema = {**schema, "servers": [{"url": prefix}]}
    return json.dumps(schema, ensure_ascii=False, separators=(",", ":")).encode()


def openapi(app: FastAPI) -> Json:
    """The document of an application, made once."""
    if app.openapi_schema is None:
        document = get_openapi(
            title=app.title, version=app.version, description=app.description, routes=app.routes
        )
        schemas = document.setdefault("components", {}).setdefault("schemas", {})
        for model in (Problem, JobEventData):
            _add_schema(schemas, model)
        _drop_the_framework_errors(document)
        examples = body_examples()
        document["components"]["securitySchemes"] = _SCHEMES
        for _, method, operation in _operations(document):
            _add_the_answers_of_the_gate(method, operation)
            _add_the_scope(method, operation)
            _add_headers(method, operation)
            _add_links(document, method, operation)
            _add_example(operation, examples)
            _tell_events(operation)
        document["components"]["schemas"] = dict(sorted(schemas.items()))
        app.openapi_schema = document
    return app.openapi_schema


def _operations(document: Json) -> Iterator[tuple[str, str, Json]]:
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            yield path, method, operation


def _add_schema(schemas: Json, model: type[BaseModel]) -> None:
    schema = model.model_json_schema(ref_template=_REF)
    schemas.update(schema.pop("$defs", {}))
    schemas[model.__name__] = schema


def _add_the_answers_of_the_gate(method: str, operation: Json) -> None:
    statuses = [401, 421, 429, 503]
    if method != "get":
        statuses += [403, 408, 413, 415]
    for status, answer in problems(*statuses).items():
        operation["responses"].setdefault(str(status), answer)


def _add_the_scope(method: str, operation: Json) -> None:
    if operation["operationId"] in OPEN:
        operation["security"] = []
        return
    # A scheme that is not OAuth has roles here (OpenAPI 3.1); the empty one: on 127.0.0.1.
    role = [needed_scope(method.upper(), operation["operationId"]).value]
    operation["security"] = [{}, {"key": role}, {"signIn": role}]


def _add_headers(method: str, operation: Json) -> None:
    answers = operation["responses"]
    if {"201", "202"} & answers.keys():
        for status in {"200", "201", "202"} & answers.keys():
            answers[status].setdefault("headers", {})["Location"] = {
                "description": "Where it is to be found.",
                "required": True,
                "schema": {"type": "string", "format": "uri-reference"},
            }
    kinds = answers.get("200", {}).get("content", {}).keys()
    if method == "get" and not kinds & {"text/event-stream", "application/zip", "text/plain"}:
        answers["200"].setdefault("headers", {})["ETag"] = {
            "description": "Names the content; sent as `If-None-Match` it saves sending it again.",
            "schema": {"type": "string"},
        }
        answers["304"] = {"description": "You have it: `If-None-Match` names its content."}


def _add_links(document: Json, method: str, operation: Json) -> None:
    """Where what was made is read, followed, cancelled and removed."""
    made = operation["responses"].get("201")
    if method != "post" or made is None:
        return
    schema = made["content"]["application/json"]["schema"].get("$ref", "")
    for other, reading, found in _operations(document):
        content = found["responses"].get("200", {}).get("content", {}).get("application/json", {})
        one = other.endswith("}") and other.count("{") == 1 and reading == "get"
        if one and content.get("schema", {}).get("$ref") == schema:
            made["links"] = dict(_links_below(document, other))


def _links_below(document: Json, path: str) -> Iterator[tuple[str, Json]]:
    name = path[path.index("{") + 1 : -1]
    for other, method, operation in _operations(document):
        if other.startswith(path) and other.count("{") == 1:
            word = other[len(path) :].strip("/") or {"get": "self", "delete": "remove"}[method]
            yield (
                word,
                {
                    "operationId": operation["operationId"],
                    "parameters": {name: "$response.body#/id"},
                },
            )


def _add_example(operation: Json, examples: Mapping[str, Any]) -> None:
    example = examples.get(operation["operationId"])
    if example is not None:
        operation["requestBody"]["content"]["application/json"]["example"] = example


def _tell_events(operation: Json) -> None:
    content = operation["responses"].get("200", {}).get("content", {})
    if "text/event-stream" not in content:
        return
    data = {
        "type": "string",
        "contentMediaType": "application/json",
        "contentSchema": {"$ref": _REF.format(model=JobEventData.__name__)},
    }
    properties = {
        "event": {"type": "string", "enum": list(EVENTS)},
        "id": {"type": "string", "pattern": "^[0-9]+$"},
        "data": data,
    }
    content["text/event-stream"] = {
        "schema": {"type": "string"},
        # Of OpenAPI 3.2; older readers see a string.
        "itemSchema": {
            "type": "object",
            "required": list(properties),
            "properties": properties,
        },
        "example": 'event: completed\ndata: {"at": "2026-01-31T12:00:00Z"}\nid: 12\n\n',
    }


def _drop_the_framework_errors(document: Json) -> None:
    # FastAPI adds its own error shape to every operation with a parameter that does not declare
    # 422; ours are declared where they can occur.
    for _, _, operation in _operations(document):
        unprocessable = operation["responses"].get("422", {})
        if "application/json" in unprocessable.get("content", {}):
            del operation["responses"]["422"]
    for name in ("HTTPValidationError", "ValidationError"):
        document["components"]["schemas"].pop(name, None)
