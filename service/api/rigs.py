"""``/v1/rigs``: the stations of this service, their devices, and the way to stop them."""

from __future__ import annotations

import dataclasses
from typing import Any
from urllib.parse import quote

from fastapi import APIRouter

from common.errors import RigwrightError
from common.files.plain import plain
from rig.acquisition.cameras.base import CameraHealth
from rig.acquisition.capture.results import RigHealth
from rig.acquisition.station.spec import CameraPlan
from service.api.context import ServiceDep
from service.api.models import problems
from service.api.rigmodels import RigList, RigStatus
from service.problems import problem_document
from service.rigs.desk import RigDesk
from service.rigs.orders import CAPTURE, TEST

JSON = dict[str, Any]
router = APIRouter(tags=["rigs"])
_PLURALS = {CAPTURE: "captures", TEST: "rig-tests"}


def rig_path(name: str) -> str:
    """The path of a rig."""
    return f"/v1/rigs/{quote(name, safe='')}"


@router.get("/v1/rigs", response_model=RigList)
def list_rigs(service: ServiceDep) -> JSON:
    """List the rigs with the health of their devices."""
    return {"items": [_document(desk) for desk in service.rigs.all()]}


@router.get("/v1/rigs/{rig}", response_model=RigStatus, responses=problems(404))
def read_rig(service: ServiceDep, rig: str) -> JSON:
    """Read how a rig and its devices are. Asks nothing of the devices."""
    return _document(service.rigs.get(rig))


@router.post("/v1/rigs/{rig}/abort", response_model=RigStatus, responses=problems(404, 503))
def abort_rig(service: ServiceDep, rig: str) -> JSON:
    """Take all outputs low, now, and end what the rig does. Allowed in every state."""
    desk = service.rigs.get(rig)
    desk.abort()
    return _document(desk)


@router.post(
    "/v1/rigs/{rig}/reset", response_model=RigStatus, responses=problems(404, 409, 423, 503)
)
def reset_rig(service: ServiceDep, rig: str) -> JSON:
    """Let the trigger box leave its fault: 423 while the interlock is open. Fires nothing."""
    desk = service.rigs.get(rig)
    desk.reset()
    return _document(desk)


def _document(desk: RigDesk) -> JSON:
    health, problem, doing = desk.health()
    own = rig_path(desk.name)
    cameras = [
        _camera(plan, None if health is None else health.cameras.get(plan.name))
        for plan in desk.station.cameras
    ]
    box = None if health is None or health.box is None else dataclasses.asdict(health.box)
    document: JSON = plain(
        {
            "name": desk.name,
            "status": _status(health, doing is not None, problem),
            "doing": None if doing is None else f"/v1/{_PLURALS[doing.kind]}/{doing.id}",
            "problem": None if problem is None else problem_document(problem),
            "trigger": box,
            "cameras": cameras,
            "links": {
                "self": own,
                **{word: f"{own}/{word}" for word in ("captures", "tests", "abort", "reset")},
            },
        }
    )
    return document


def _camera(plan: CameraPlan, health: CameraHealth | None) -> JSON:
    health = health or CameraHealth(connected=False, problem="the rig is not open")
    return {
        "name": plan.name,
        "backend": plan.backend,
        "id": plan.id,
        "output": plan.output,
        **dataclasses.asdict(health),
    }


def _status(health: RigHealth | None, busy: bool, problem: RigwrightError | None) -> str:
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
