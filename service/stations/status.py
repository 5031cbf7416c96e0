"""How a rig and its devices are, as it is told: nothing of this asks the devices."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from common.errors import RigwrightError
from common.files.plain import plain
from rig.acquisition.cameras.base import CameraHealth
from rig.acquisition.capture.results import RigHealth
from rig.acquisition.station.spec import CameraPlan, Station
from rig.acquisition.trigger.box import TriggerCapabilities, TriggerState
from service.kinds.base import Figure, Model

_ABLE = (TriggerState.READY, TriggerState.ARMED, TriggerState.FIRING)
State = Literal["ready", "busy", "degraded", "closed"]


class TriggerAbilities(Model):
    """What a kind of trigger box can do."""

    outputs: int
    tick_us: float
    max_delay_us: float
    max_width_us: float
    max_shots: int
    acknowledges_fire: bool
    edge_log: bool
    clock: bool
    dead_man: bool


class TriggerStatus(Model):
    """How the trigger box and its line are."""

    state: str
    identity: str
    serial_number: str
    firmware: str
    boots: int | None
    interlock_closed: bool | None
    armed_capture: str | None
    clock_residual_us: Figure
    round_trip_p50_ms: Figure
    round_trip_p99_ms: Figure
    counters: dict[str, int]
    last_problem: str
    capabilities: TriggerAbilities | None = None


class CameraStatus(Model):
    """How a camera is; `problem` is empty when all is well."""

    name: str
    backend: str
    id: str
    output: int | None
    connected: bool
    armed: bool
    problem: str
    counters: dict[str, int]
    previews: Annotated[
        bool, Field(description="Whether it can show what it sees between captures.")
    ] = False


def trigger_status(
    health: RigHealth | None, can: TriggerCapabilities | None = None
) -> TriggerStatus | None:
    """The trigger box and what it ``can``; None where the station has none or is not open."""
    if health is None or health.box is None:
        return None
    return TriggerStatus.model_validate(
        {**plain(health.box), "capabilities": None if can is None else plain(can)}
    )


def camera_statuses(station: Station, health: RigHealth | None) -> list[CameraStatus]:
    """Each camera of the station, in its order."""
    known = {} if health is None else health.cameras
    able = frozenset[str]() if health is None else health.previews
    return [_camera(plan, known.get(plan.name), plan.name in able) for plan in station.cameras]


def rig_state(health: RigHealth | None, busy: bool, problem: RigwrightError | None) -> State:
    """The rig as a whole."""
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


def device_faults(health: RigHealth) -> list[str]:
    """What keeps an open rig from taking a capture, box and each camera in a sentence."""
    wrong = []
    box = health.box
    if box is not None and box.interlock_closed is False:
        wrong.append("the interlock is open")
    if box is not None and not box_is_able(health):
        wrong.append(f"trigger box: {box.last_problem or box.state.value}")
    wrong += [
        f"camera {name}: {camera.problem or 'not connected'}"
        for name, camera in health.cameras.items()
        if not camera.connected
    ]
    return wrong


def box_is_able(health: RigHealth) -> bool | None:
    """Whether the box is there and in no fault; None where the station has none."""
    return None if health.box is None else health.box.state in _ABLE


def _camera(plan: CameraPlan, health: CameraHealth | None, previews: bool) -> CameraStatus:
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
        previews=previews,
    )
