"""The application: all resources together."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from anyio import to_thread
from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from service.api import (
    acceptances,
    calibrations,
    captures,
    checks,
    designs,
    evaluations,
    examples,
    exports,
    picturesets,
    plans,
    rigs,
    rigtests,
    root,
    scans,
    sessions,
    targetsets,
)
from service.api.context import Service
from service.api.errors import install_error_handlers
from service.api.gate import Gate
from service.api.limits import PAUSE_S, BodyLimits
from service.api.middleware import RequestLog
from service.api.models import Problem, problems
from service.page.routes import router as page_router

_DESCRIPTION = (
    "Designs and runs multi-camera rigs that photograph a face. Lengths are in millimetres, angles "
    "in degrees, times in UTC. Errors are problem details (RFC 9457)."
)


def make_app() -> FastAPI:
    """The routes without a service behind them: enough for their documentation."""
    # The framework's pages of documentation load their scripts from elsewhere; a lab's network
    # often has no elsewhere.
    app = FastAPI(
        title="Rigwright",
        version="1",
        description=_DESCRIPTION,
        lifespan=_lifespan,
        docs_url=None,
        redoc_url=None,
        # A redirect would name the host that was asked for.
        redirect_slashes=False,
    )
    resources = (
        *(root, scans, examples, designs, exports, plans, evaluations),
        *(rigs, captures, rigtests, sessions),
        *(targetsets, picturesets, calibrations, checks, acceptances),
    )
    app.state.routers = [module.router for module in resources]
    for router in app.state.routers:
        app.include_router(router)
    app.include_router(page_router)
    install_error_handlers(app)
    app.openapi = lambda: _openapi(app)  # type: ignore[method-assign]
    return app


def create_app(service: Service) -> FastAPI:
    """The application of a service, which is started and stopped with it, but not closed."""
    app = make_app()
    app.state.service = service
    settings = service.settings
    # The last that is added is the first that a request meets.
    app.add_middleware(BodyLimits, stopping=service.stopping.is_set, pause_s=PAUSE_S)
    app.add_middleware(Gate, hosts=settings.known_hosts, origins=settings.allowed_origins)
    app.add_middleware(RequestLog)
    return app


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    service: Service = app.state.service
    service.start()
    yield
    await to_thread.run_sync(service.stop)


def _openapi(app: FastAPI) -> dict[str, Any]:
    if app.openapi_schema is None:
        document = get_openapi(
            title=app.title, version=app.version, description=app.description, routes=app.routes
        )
        schemas = document.setdefault("components", {}).setdefault("schemas", {})
        problem = Problem.model_json_schema(ref_template="#/components/schemas/{model}")
        schemas.update(problem.pop("$defs", {}))
        schemas["Problem"] = problem
        _drop_the_framework_errors(document)
        _add_the_answers_of_the_gate(document)
        document["components"]["schemas"] = dict(sorted(schemas.items()))
        app.openapi_schema = document
    return app.openapi_schema


def _add_the_answers_of_the_gate(document: dict[str, Any]) -> None:
    for path in document["paths"].values():
        for method, operation in path.items():
            statuses = (403, 408, 413, 415, 421, 503) if method != "get" else (421, 503)
            for status, answer in problems(*statuses).items():
                operation["responses"].setdefault(str(status), answer)


def _drop_the_framework_errors(document: dict[str, Any]) -> None:
    # FastAPI adds its own error shape to every operation with a parameter that does not declare
    # 422; ours are declared where they can occur.
    for path in document["paths"].values():
        for operation in path.values():
            unprocessable = operation["responses"].get("422", {})
            if "application/json" in unprocessable.get("content", {}):
                del operation["responses"]["422"]
    for name in ("HTTPValidationError", "ValidationError"):
        document["components"]["schemas"].pop(name, None)
