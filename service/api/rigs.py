"""``/v1/rigs``: the stations of this service, their devices, and the way to stop them."""

from __future__ import annotations

from typing import Literal
from urllib.parse import quote

from fastapi import APIRouter

from common.errors import RigwrightError
from common.files.plain import plain
from rig.acquisition.cameras.base import CameraHealth
from rig.acquisition.capture.results import RigHealth
from rig.acquisition.station.spec import CameraPlan
from rig.acquisition.trigger.box import TriggerHealth
from service.api.context import ServiceDep
from service.api.models import Problem, problems
from service.api.rigmodels import CameraStatus, RigList, RigStatus, TriggerStatus
from service.kinds.rigs import CAPTURE, RIG_TEST
from service.problems import problem_document
from service.stations.worker import StationWorker

router = APIRouter(tags=["rigs"])
_PLURALS = {CAPTURE.name: "captures", RIG_TEST.name: "rig-tests"}
State = Literal["ready", "busy", "degraded", "closed"]


def rig_path(name: str) -> str:
    """The path of a rig."""
    return f"/v1/rigs/{quote(name, safe='')}"


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
    cameras = [
        _camera(plan, None if health is None else health.cameras.get(plan.name))
        for plan in worker.station.cameras
    ]
    return RigStatus(
        name=worker.name,
        status=_status(health, doing is not None, problem),
        doing=None if doing is None else f"/v1/{_PLURALS[doing.kind]}/{doing.id}",
        problem=None if problem is None else Problem.model_validate(problem_document(problem)),
        trigger=None if health is None or health.box is None else _trigger(health.box),
        cameras=cameras,
        links={
            "self": own,
            **{word: f"{own}/{word}" for word in ("captures", "tests", "abort", "reset")},
        },
    )


def _trigger(box: TriggerHealth) -> TriggerStatus:
    return TriggerStatus.model_validate(plain(box))


def _camera(plan: CameraPlan, health: CameraHealth | None) -> CameraStatus:
    health = health or CameraHealth(connected=False, problem="the rig is not open")
    return CameraStatus(
        name=plan.name,
        backend=plan.backend,
        id=plan.id,
        output=plan.output,
        connected=health.connected,
        armed=health.armed,
        problem=health.problem,
        counters=dict(health.counters),
    )


def _status(health: RigHealth | None, busy: bool, problem: RigwrightError | None) -> State:
    if busy:
        return "busy"
    if health is None or problem is not None:
        return "closed"
    well = all(camera.connected for camera in health.cameras.values())
    if health.box is not None:
        well = (
            well and health.box.state.value == "ready" and health.box.interlock_closed is not False
        )
    return "ready" if well else "degraded"
