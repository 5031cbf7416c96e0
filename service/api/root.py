"""``/v1``: what this is."""

from __future__ import annotations

from typing import Literal

from fastapi import APIRouter, Request, Response

from common.version import program_version
from service.api import document
from service.api.addresses import at
from service.api.context import ServiceDep
from service.kinds.base import Model

router = APIRouter(tags=["service"])

_RESOURCES = (
    *("health", "ready", "scans", "rig-examples", "rig-schema", "designs", "studies"),
    *("plans", "evaluations"),
    *("rigs", "captures", "rig-tests", "sessions", "removed-sessions"),
    *(
        "target-sets",
        "target-set-proposals",
        "picture-sets",
        "calibrations",
        "checks",
        "acceptances",
    ),
    *("reconstructions", "comparisons"),
)


class ServiceDocument(Model):
    """What this service is. ``id`` stays the same for the life of its data folder."""

    id: str
    name: Literal["rigwright"]
    version: str
    links: dict[str, str]


@router.get("/v1", response_model=ServiceDocument)
def read_service(service: ServiceDep) -> ServiceDocument:
    """Read what this service is and what it offers."""
    links = {name: at(f"/v1/{name}") for name in _RESOURCES}
    return ServiceDocument(
        id=service.store.service_uuid,
        name="rigwright",
        version=program_version(),
        links=links | {"metrics": at("/metrics"), "openapi": at("/openapi.json")},
    )


@router.get("/openapi.json", name="openapi", include_in_schema=False)
def read_openapi(request: Request) -> Response:
    """Read the document of all paths."""
    text = document.openapi_text(request.app, request.scope.get("root_path", "").rstrip("/"))
    return Response(text, media_type="application/json")
