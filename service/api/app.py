"""The application: all resources together."""

from __future__ import annotations

import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from anyio import to_thread
from fastapi import FastAPI
from starlette.middleware.cors import CORSMiddleware

from service.api import (
    acceptances,
    calibrations,
    captures,
    checks,
    comparisons,
    designs,
    document,
    evaluations,
    examples,
    exports,
    health,
    liveviews,
    marks,
    metrics,
    picturesets,
    plans,
    reconstructions,
    removed,
    rigs,
    rigtests,
    root,
    scans,
    sessions,
    signin,
    studies,
    studyfiles,
    targetsets,
)
from service.api.addresses import Prefix
from service.api.audited import Audited
from service.api.conditional import Conditional
from service.api.context import Service
from service.api.door import Door
from service.api.errors import install_error_handlers
from service.api.gate import Gate
from service.api.limits import PAUSE_S, BodyLimits
from service.api.middleware import RequestLog
from service.page.routes import router as page_router

_DESCRIPTION = (
    "Designs and runs multi-camera rigs that photograph a face. Lengths are in millimetres, angles "
    "in degrees, times in UTC. Errors are problem details (RFC 9457)."
)

_ASKED_WITH = (
    *("Content-Type", "X-Rigwright", "Idempotency-Key", "Last-Event-ID", "If-None-Match"),
    "Authorization",
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
        # Its route would make the document in the event loop, where everybody waits for it.
        openapi_url=None,
        # A redirect would name the host that was asked for.
        redirect_slashes=False,
        generate_unique_id_function=lambda route: route.name,
    )
    resources = (
        *(root, signin, health, metrics, scans, examples, designs, exports, studies, studyfiles),
        *(plans, evaluations),
        *(rigs, liveviews, captures, rigtests, sessions, marks, removed),
        *(targetsets, picturesets, calibrations, checks, acceptances),
        *(reconstructions, comparisons),
    )
    app.state.routers = [module.router for module in resources]
    for router in app.state.routers:
        app.include_router(router)
    app.include_router(page_router)
    install_error_handlers(app)
    app.openapi = lambda: document.openapi(app)  # type: ignore[method-assign]
    return app


def create_app(service: Service) -> FastAPI:
    """The application of a service, which is started and stopped with it, but not closed."""
    app = make_app()
    app.state.service = service
    settings = service.settings
    app.state.requests = metrics.RequestCounts()
    routers = (*app.state.routers, page_router, app.router)
    # The last that is added is the first that a request meets.
    app.add_middleware(Conditional)
    app.add_middleware(BodyLimits, stopping=service.stopping.is_set, pause_s=PAUSE_S)
    app.add_middleware(Door, ring=service.keys, routers=routers)
    if settings.allowed_origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=settings.allowed_origins,
            allow_methods=("GET", "POST", "DELETE"),
            allow_headers=_ASKED_WITH,
            expose_headers=("Location", "ETag", "X-Request-ID"),
        )
    app.add_middleware(Gate, hosts=settings.known_hosts, origins=settings.allowed_origins)
    app.add_middleware(Audited, log=service.audit)
    app.add_middleware(RequestLog, stopping=service.stopping.is_set)
    app.add_middleware(metrics.CountedRequests, counts=app.state.requests)
    app.add_middleware(Prefix, prefix=settings.root_path)
    return app


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    service: Service = app.state.service
    service.start()
    # The first who looks at a form would wait for what is the same ever after.
    threading.Thread(target=examples.prepare, name="examples", daemon=True).start()
    yield
    await to_thread.run_sync(service.stop)
