"""``/v1`` and ``/v1/health``: what this is and how it is."""

from __future__ import annotations

import shutil
from typing import Literal

from fastapi import APIRouter

from common.version import program_version
from service.api.context import Service, ServiceDep
from service.kinds.base import Model
from service.stations.worker import GONE, StationWorker
from service.store.tables import JobStatus

router = APIRouter(tags=["service"])

_LITTLE_DISK_BYTES = 1 << 30


_RESOURCES = (
    *("health", "scans", "rig-examples", "designs", "plans", "evaluations"),
    *("rigs", "captures", "rig-tests", "sessions"),
    *(
        "target-sets",
        "target-set-proposals",
        "picture-sets",
        "calibrations",
        "checks",
        "acceptances",
    ),
)


class ServiceDocument(Model):
    """What this service is. ``id`` stays the same for the life of its data folder."""

    id: str
    name: Literal["rigwright"]
    version: str
    links: dict[str, str]


class Subsystem(Model):
    """How one part is; ``reason`` when it is not ok."""

    status: Literal["ok", "degraded"]
    reason: str | None = None


class Health(Model):
    """How the service is. Answered with 200 even when a part is degraded."""

    status: Literal["ok", "degraded"]
    subsystems: dict[str, Subsystem]
    jobs_running: int
    jobs_pending: int


@router.get("/v1", response_model=ServiceDocument)
def read_service(service: ServiceDep) -> ServiceDocument:
    """Read what this service is and what it offers."""
    links = {name: f"/v1/{name}" for name in _RESOURCES}
    return ServiceDocument(
        id=service.store.service_uuid,
        name="rigwright",
        version=program_version(),
        links=links | {"openapi": "/openapi.json"},
    )


def _rigs(service: Service) -> dict[str, Subsystem]:
    """Each rig with its box and its cameras."""
    return {f"rig {worker.name}": _rig(worker) for worker in service.rigs.all()}


def _rig(worker: StationWorker) -> Subsystem:
    health, problem, _ = worker.health()
    if health is None:
        why = "it is being opened" if problem is None else str(problem)
        return Subsystem(status="degraded", reason=why)
    wrong = [
        f"camera {name}: {camera.problem or 'not connected'}"
        for name, camera in health.cameras.items()
        if not camera.connected
    ]
    box = health.box
    if box is not None and box.state in GONE:
        wrong.insert(0, f"trigger box: {box.last_problem or box.state.value}")
    if box is not None and box.interlock_closed is False:
        wrong.insert(0, "the interlock is open")
    if wrong:
        return Subsystem(status="degraded", reason="; ".join(wrong))
    return Subsystem(status="ok")


@router.get("/v1/health", response_model=Health)
def read_health(service: ServiceDep) -> Health:
    """Read how the parts of the service are."""
    counts = service.store.jobs.counts()
    free = shutil.disk_usage(service.store.folder).free
    disk = (
        Subsystem(status="ok")
        if free >= _LITTLE_DISK_BYTES
        else Subsystem(status="degraded", reason=f"{free / (1 << 20):.0f} MiB are free")
    )
    waiting = counts.get(JobStatus.PENDING, 0)
    jobs = (
        Subsystem(status="ok")
        if waiting < service.settings.max_queued_jobs
        else Subsystem(status="degraded", reason="no more jobs are accepted for now")
    )
    refused = service.store.database.refused
    store = (
        Subsystem(status="degraded", reason=f"it cannot be written ({refused})")
        if refused
        else Subsystem(status="ok")
    )
    parts = {"store": store, "disk": disk, "jobs": jobs, **_rigs(service)}
    degraded = any(part.status == "degraded" for part in parts.values())
    return Health(
        status="degraded" if degraded else "ok",
        subsystems=parts,
        jobs_running=counts.get(JobStatus.RUNNING, 0),
        jobs_pending=waiting,
    )
