"""``/v1/rigs``: the stations of this service, their devices, and the way to stop them."""

from __future__ import annotations

from urllib.parse import quote

from fastapi import APIRouter

from service.api.addresses import at
from service.api.context import ServiceDep
from service.api.models import Problem, problems
from service.api.rigmodels import RigList, RigStatus
from service.kinds.rigs import CAPTURE, RIG_TEST
from service.problems import problem_document
from service.stations.status import camera_statuses, rig_state, trigger_status
from service.stations.worker import StationWorker

router = APIRouter(tags=["rigs"])
_PLURALS = {CAPTURE.name: "captures", RIG_TEST.name: "rig-tests"}


def rig_path(name: str) -> str:
    """The address of a rig."""
    return at(f"/v1/rigs/{quote(name, safe='')}")


@router.get("/v1/rigs", response_model=RigList)
def list_rigs(service: ServiceDep) -> RigList:
    """List the rigs with the health of their devices."""
    return RigList(items=[_document(worker) for worker in service.rigs.all()])


@router.get("/v1/rigs/{rig}", response_model=RigStatus, responses=problems(404))
def read_rig(service: ServiceDep, rig: str) -> RigStatus:
    """Read how a rig and its devices are. Asks nothing of the devices."""
    return _document(service.rigs.get(rig))


@router.post("/v1/rigs/{rig}/abort", response_model=RigStatus, responses=problems(404, 503))
def abort_rig(service: ServiceDep, rig: str) -> RigStatus:
    """Take all outputs low, now, and end what the rig does. Allowed in every state."""
    worker = service.rigs.get(rig)
    worker.abort()
    return _document(worker)


@router.post(
    "/v1/rigs/{rig}/reset", response_model=RigStatus, responses=problems(404, 409, 423, 503)
)
def reset_rig(service: ServiceDep, rig: str) -> RigStatus:
    """Let the trigger box leave its fault: 423 while the interlock is open. Fires nothing."""
    worker = service.rigs.get(rig)
    worker.reset()
    return _document(worker)


def _document(worker: StationWorker) -> RigStatus:
    health, problem, doing = worker.health()
    own = rig_path(worker.name)
    return RigStatus(
        name=worker.name,
        status=rig_state(health, doing is not None, problem),
        doing=None if doing is None else at(f"/v1/{_PLURALS[doing.kind]}/{doing.id}"),
        asked_by=worker.asked_by,
        aborts=worker.aborts,
        problem=None if problem is None else Problem.model_validate(problem_document(problem)),
        trigger=trigger_status(health, worker.box_abilities()),
        cameras=camera_statuses(worker.station, health),
        links={
            "self": own,
            **{word: f"{own}/{word}" for word in ("captures", "tests", "abort", "reset")},
        },
    )
