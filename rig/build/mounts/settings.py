"""What a person sets on a mount, and the pose that follows from it.

A camera hangs at the end of a chain of links: a slide along a slot, a turn of a head, a fixed
step from the head's plate to the lens. Whoever knows the chain and the settings knows the pose,
so the plan, its drawings and the tests all compute poses in this one place.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Self

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats, frozen
from geometry.camera import RigCamera
from geometry.frames import Pose

SAME_POSITION_MM = 1e-6
SAME_ROTATION = 1e-9


class Motion(StrEnum):
    """How a link moves with its setting."""

    FIXED = "fixed"
    SLIDE = "slide"
    TURN = "turn"


@dataclass(frozen=True)
class Setting:
    """One figure that a builder sets: ``value`` in ``unit`` (``mm`` or ``deg``).

    Values that exist are ``origin + k * step`` within ``low`` to ``high``. ``measured_from``
    says in words where the scale begins. A ``step`` of 0: the part is made to the figure (a
    printed wedge, a drilled hole), nothing is rounded.
    """

    name: str
    unit: str
    value: float
    step: float
    low: float
    high: float
    measured_from: str
    origin: float = 0.0

    def __post_init__(self) -> None:
        if self.unit not in ("mm", "deg"):
            raise InputError(
                "value", f"setting {self.name} has the unit {self.unit!r}", "mm or deg"
            )
        if not (self.low <= self.high and self.step >= 0.0):
            raise InputError(
                "value", f"setting {self.name} has no range", "give low, high and step in order"
            )

    @property
    def exists(self) -> bool:
        """Whether the value is in range and on a step."""
        inside = self.low - 1e-9 <= self.value <= self.high + 1e-9
        return inside and abs(self.rounded().value - self.value) < 1e-9

    def rounded(self) -> Self:
        """The nearest value that exists."""
        value = self.value
        if self.step > 0.0:
            first = np.ceil((self.low - self.origin) / self.step - 1e-9)
            last = np.floor((self.high - self.origin) / self.step + 1e-9)
            steps = np.clip(np.round((value - self.origin) / self.step), first, last)
            value = float(self.origin + steps * self.step)
        return replace(self, value=float(np.clip(value, self.low, self.high)))


@dataclass(frozen=True, eq=False)
class Link:
    """One step of a chain: the fixed ``transform`` (4, 4), then the motion along ``axis`` (3,).

    ``transform`` maps the frame after it to the frame before it; axis and motion count in the
    frame after it. ``setting`` names the setting that moves the link; a slide moves by its
    value in mm, a turn by its value in degrees, right-handed. ``per_unit`` converts a setting of
    another unit: degrees of turn per mm for a carriage on a bent rail.
    """

    transform: Floats
    motion: Motion = Motion.FIXED
    axis: Floats | None = None
    setting: str = ""
    per_unit: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "transform", frozen(self.transform))
        if self.motion is not Motion.FIXED:
            if self.axis is None or not self.setting:
                raise InputError("value", "a link that moves lacks axis or setting", "give both")
            axis = np.asarray(self.axis, dtype=np.float64)
            object.__setattr__(self, "axis", frozen(axis / np.linalg.norm(axis)))

    def matrix(self, value: float) -> Floats:
        """The frame after the link in the frame before it, (4, 4), at a value of its setting."""
        moved = np.eye(4)
        if self.motion is Motion.SLIDE and self.axis is not None:
            moved[:3, 3] = value * self.per_unit * self.axis
        elif self.motion is Motion.TURN and self.axis is not None:
            moved[:3, :3] = turn(self.axis, value * self.per_unit)
        return np.asarray(self.transform @ moved)


def turn(axis: Floats, angle_deg: float) -> Floats:
    """Right-handed rotation (3, 3) about a unit vector (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = np.radians(angle_deg)
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross)


def shift(offset_mm: Floats) -> Floats:
    """A (4, 4) transform that only moves."""
    matrix = np.eye(4)
    matrix[:3, 3] = offset_mm
    return matrix


def rig_from_camera(pose: Pose) -> Floats:
    """The camera frame in the rig frame, (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3] = pose.rotation_rig_to_camera.T
    matrix[:3, 3] = pose.position_rig_mm
    return matrix


def pose_of(rig_from_camera_matrix: Floats) -> Pose:
    """The inverse of :func:`rig_from_camera`."""
    u, _, vt = np.linalg.svd(rig_from_camera_matrix[:3, :3].T)
    return Pose(rig_from_camera_matrix[:3, 3], u @ vt)


@dataclass(frozen=True)
class Tape:
    """A straight tape measure that checks a setting: between two marks a builder can touch."""

    start: str
    end: str
    length_mm: float


@dataclass(frozen=True, eq=False)
class CameraMount:
    """How one camera is held: its settings, and the chain from the rig frame to the camera.

    ``camera`` is the camera as it stands with these settings, ``wanted`` the pose of the design.
    ``carried_by`` names members and parts from the ground up. ``tapes`` are at least two.
    """

    camera: RigCamera
    wanted: Pose
    settings: tuple[Setting, ...]
    chain: tuple[Link, ...]
    carried_by: tuple[str, ...] = ()
    tapes: tuple[Tape, ...] = ()

    def __post_init__(self) -> None:
        pose, given = self.pose(), self.camera.pose
        off = float(np.abs(pose.position_rig_mm - given.position_rig_mm).max())
        twist = float(np.abs(pose.rotation_rig_to_camera - given.rotation_rig_to_camera).max())
        if off > SAME_POSITION_MM or twist > SAME_ROTATION:
            raise InputError(
                "value",
                f"the settings of {self.camera.name} do not give its pose",
                "place the camera by its settings",
            )

    @property
    def name(self) -> str:
        """Name of the camera."""
        return self.camera.name

    def values(self) -> dict[str, float]:
        """The settings by name."""
        return {setting.name: setting.value for setting in self.settings}

    def pose(self, values: Mapping[str, float] | None = None) -> Pose:
        """The pose that settings give; those not in ``values`` stay as they are."""
        return chain_pose(self.chain, {**self.values(), **(values or {})})

    def moved(self, values: Mapping[str, float]) -> Self:
        """The same mount with other settings; its tapes must be measured anew by the system."""
        settings = tuple(replace(s, value=values.get(s.name, s.value)) for s in self.settings)
        camera = replace(self.camera, pose=self.pose(values))
        return replace(self, camera=camera, settings=settings)


def chain_pose(chain: tuple[Link, ...], values: Mapping[str, float]) -> Pose:
    """The pose at the end of a chain."""
    matrix = np.eye(4)
    for link in chain:
        matrix = matrix @ link.matrix(values[link.setting] if link.setting else 0.0)
    return pose_of(matrix)
