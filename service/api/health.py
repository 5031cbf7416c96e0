"""``/v1/health`` and ``/v1/ready``: how the service and its rigs are, and whether they can work."""

from __future__ import annotations

import shutil
from typing import Literal

from fastapi import APIRouter

from common.errors import ConflictError
from service.api.context import Service, ServiceDep
from service.api.models import problems
from service.kinds.base import Model
from service.stations.status import device_faults
from service.stations.worker import StationWorker
from service.store.tables import JobStatus

router = APIRouter(tags=["service"])

_LITTLE_DISK_BYTES = 1 << 30


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


class Ready(Model):
    """Everything is as it should be."""

    ready: Literal[True]


@router.get("/v1/health", response_model=Health)
def read_health(service: ServiceDep) -> Health:
    """Read how the parts of the service are: store, disk, jobs, each rig with box and cameras."""
    counts = service.store.jobs.counts()
    waiting = counts.get(JobStatus.PENDING, 0)
    parts = {
        "store": _store(service),
        "disk": _disk(service),
        "jobs": _jobs(service, waiting),
        **{f"rig {worker.name}": _rig(worker) for worker in service.rigs.all()},
    }
    degraded = any(part.status == "degraded" for part in parts.values())
    return Health(
        status="degraded" if degraded else "ok",
        subsystems=parts,
        jobs_running=counts.get(JobStatus.RUNNING, 0),
        jobs_pending=waiting,
    )


@router.get("/v1/ready", response_model=Ready, responses=problems(503))
def read_ready(service: ServiceDep) -> Ready:
    """Ask whether all can be worked with: 503, and what is wrong, where a part is not ok."""
    parts = read_health(service).subsystems
    wrong = [f"{name}: {part.reason}" for name, part in parts.items() if part.status != "ok"]
    if wrong:
        raise ConflictError("not-ready", "; ".join(wrong), "see /v1/health and /v1/rigs")
    return Ready(ready=True)


def _store(service: Service) -> Subsystem:
    refused = service.store.database.refused
    return _part(f"it cannot be written ({refused})" if refused else "")


def _disk(service: Service) -> Subsystem:
    free = shutil.disk_usage(service.store.folder).free
    return _part("" if free >= _LITTLE_DISK_BYTES else f"{free / (1 << 20):.0f} MiB are free")


def _jobs(service: Service, waiting: int) -> Subsystem:
    full = waiting >= service.settings.max_queued_jobs
    return _part("no more jobs are accepted for now" if full else "")


def _rig(worker: StationWorker) -> Subsystem:
    health, problem, _ = worker.health()
    if health is None:
        return _part("it is being opened" if problem is None else str(problem))
    return _part("; ".join(device_faults(health)))


def _part(reason: str) -> Subsystem:
    if reason:
        return Subsystem(status="degraded", reason=reason)
    return Subsystem(status="ok")
