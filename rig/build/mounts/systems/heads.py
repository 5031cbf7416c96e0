"""Tripod heads: which way up they go, how they are set, what room they take."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats
from geometry.camera import RigCamera
from geometry.frames import Pose
from rig.build.mounts.kinematics import ANGLES, frames_along, head_angles, head_links, turned_over
from rig.build.mounts.settings import CameraMount, Link, Setting, shift
from rig.build.mounts.solids import round_part
from rig.build.mounts.structure import Solid
from rig.build.mounts.systems.threads import adapter_for, camera_thread
from rig.catalogue import Catalogue
from rig.catalogue.catalogue import pick
from rig.catalogue.items import Fastener, Head

PLATE_MM = 8.0
"""Thickness of the disk under the camera, and how far it may be turned past a round figure."""

STEM_SHARE = 0.5
"""Width of the stem between ball and camera plate, as a share of the head's."""

_NEEDED = (
    "pivot_mm",
    "height_mm",
    "width_mm",
    "step_deg",
    "pan_deg",
    "tilt_deg",
    "roll_deg",
)
"""Figures of a head that a mount needs."""

_WORDS = {
    "pan": "straight ahead from the foot of the head, right positive seen from behind",
    "tilt": "level with the foot of the head, up positive",
    "roll": "upright on the foot of the head, clockwise positive seen from behind",
}


@dataclass(frozen=True, eq=False)
class HeadKind:
    """A head of the catalogue with every figure that a mount needs."""

    part: Head
    pivot_mm: float
    seat_mm: float
    width_mm: float
    step_deg: float
    ranges_deg: tuple[tuple[float, float], ...]
    others: tuple[HeadKind, ...] = ()
    """The other heads of the catalogue, for advice where this one cannot hold a camera."""

    catalogue: Catalogue | None = None
    """Where adapters for cameras of another thread are found."""

    @classmethod
    def named(cls, wanted: str, catalogue: Catalogue) -> HeadKind:
        """From the catalogue; raises for one whose figures do not suffice."""
        chosen = cls._of(wanted, catalogue)
        others = [
            cls._of(part.id, catalogue)
            for part in catalogue.heads.values()
            if part.id != chosen.part.id and all(getattr(part, key) is not None for key in _NEEDED)
        ]
        return replace(chosen, others=tuple(others), catalogue=catalogue)

    @classmethod
    def _of(cls, wanted: str, catalogue: Catalogue) -> HeadKind:
        part = pick(wanted, catalogue.heads, "head")
        missing = [key for key in _NEEDED if getattr(part, key) is None]
        if missing:
            complete = [
                p.id
                for p in catalogue.heads.values()
                if all(getattr(p, key) is not None for key in _NEEDED)
            ]
            raise InputError(
                "head-incomplete",
                f"the catalogue does not say {missing[0]} of head {part.id}",
                f"add it in a file of your own, or choose {' or '.join(complete[:2])}",
            )
        ranges = tuple(_pair(getattr(part, f"{angle}_deg")) for angle in ANGLES)
        return cls(
            part,
            float(part.pivot_mm or 0.0),
            float(part.height_mm or 0.0),
            float(part.width_mm or 0.0),
            float(part.step_deg or 0.0),
            ranges,
        )

    def margin_deg(self, angles_deg: Floats) -> float:
        """How far inside its ranges a head stands at these angles; negative outside."""
        inside = [
            np.inf if high - low >= 360.0 else min(float(a) - low, high - float(a))
            for a, (low, high) in zip(angles_deg, self.ranges_deg, strict=True)
        ]
        return float(min(inside))

    @property
    def room_deg(self) -> float:
        """The margin that a head must keep: a step, less what angles lose on their way."""
        return self.step_deg - 1e-9

    def camera_adapter(self, camera: RigCamera) -> Fastener | None:
        """What goes between its stud and the camera's thread."""
        if self.catalogue is None:
            return None
        thread = camera_thread(camera, self.catalogue)
        stud = self.part.camera_thread
        return adapter_for(stud, thread, f"camera {camera.name}", self.catalogue)

    def must_carry(self, camera: RigCamera, mass_kg: float) -> None:
        """Raises :class:`InputError` for a camera that is too heavy for it."""
        most = self.part.load_kg
        if most is None or mass_kg <= most:
            return
        able = [h.part.id for h in self.others if (h.part.load_kg or 0.0) >= mass_kg]
        raise InputError(
            "head-load",
            f"head {self.part.id} carries {most:g} kg, but {camera.name} with its lens has "
            f"{mass_kg:g} kg",
            f"choose head {' or '.join(able[:3])}"
            if able
            else "choose another mount, for no head of the catalogue carries it",
        )

    def links(self, base: Floats, camera: RigCamera) -> tuple[Link, ...]:
        """The chain from the frame before its base to the camera."""
        thread = camera.camera.body.mount_thread_camera_mm
        return head_links(base, self.pivot_mm, self.seat_mm, thread)

    def settings(self, angles_deg: Floats) -> tuple[Setting, ...]:
        """Pan, tilt and roll as settings."""
        return tuple(
            Setting(name, "deg", float(angle), self.step_deg, low, high, _WORDS[name])
            for name, angle, (low, high) in zip(ANGLES, angles_deg, self.ranges_deg, strict=True)
        )

    def solids(self, mount: CameraMount) -> tuple[Solid, ...]:
        """The foot up to the pivot, the stem, and the plate under the camera."""
        frames = frames_along(mount.chain, mount.values())
        owner = head_id(mount.name)
        foot = frames[-5] @ shift(np.array([0.0, 0.0, -self.pivot_mm]))
        # After roll: the last link's own frame, less the step to the camera, is the plate's.
        plate = frames[-1] @ np.linalg.inv(mount.chain[-1].transform)
        seat = self.seat_mm - self.pivot_mm
        stem = max(seat - PLATE_MM, 1.0)
        return (
            round_part(owner, "head", foot, self.width_mm, 0.0, self.pivot_mm),
            round_part(owner, "head", plate, STEM_SHARE * self.width_mm, 0.0, stem),
            round_part(owner, "head", plate, self.width_mm, stem, seat),
        )


def head_id(camera: str) -> str:
    """Id of the head that carries a camera."""
    return f"{camera} head"


def _pair(value: tuple[float, float]) -> tuple[float, float]:
    return float(value[0]), float(value[1])


FootT = TypeVar("FootT")


@dataclass(frozen=True, eq=False)
class Stance(Generic[FootT]):
    """A way to put a head: what it stands on, the pose, and its angles (3,)."""

    foot: FootT
    pose: Pose
    angles_deg: Floats


def stances(
    head: HeadKind, camera: RigCamera, bases: Iterable[tuple[FootT, Floats]]
) -> list[Stance[FootT]]:
    """The ways in which a head holds a camera, in the order of ``bases`` (foot, rig_from_base).

    A camera may be turned over; the way with more room to turn comes first on each base.
    Raises :class:`InputError` with the nearest angles the head has when there is none.
    """
    bases = list(bases)
    found: list[Stance[FootT]] = []
    nearest: tuple[float, Stance[FootT]] | None = None
    for foot, base in bases:
        options = []
        for pose in (camera.pose, turned_over(camera.pose)):
            angles = head_angles(pose.rotation_rig_to_camera, base)
            stance, margin = Stance(foot, pose, angles), head.margin_deg(angles)
            options.append((margin, stance))
            if nearest is None or margin > nearest[0]:
                nearest = (margin, stance)
        options.sort(key=lambda option: -option[0])
        found += [stance for margin, stance in options if margin >= head.room_deg]
    if found or nearest is None:
        return found
    raise _out_of_reach(head, camera, nearest[1], _that_hold(head.others, camera, bases))


def _that_hold(
    heads: Iterable[HeadKind], camera: RigCamera, bases: Iterable[tuple[FootT, Floats]]
) -> list[str]:
    """Ids of the heads that can hold a camera on one of the bases."""
    asked = [
        head_angles(pose.rotation_rig_to_camera, base)
        for _, base in bases
        for pose in (camera.pose, turned_over(camera.pose))
    ]
    return [h.part.id for h in heads if any(h.margin_deg(a) >= h.room_deg for a in asked)]


def _out_of_reach(
    head: HeadKind, camera: RigCamera, stance: Stance[FootT], others: list[str]
) -> InputError:
    # Rounded before 0 is added: a message must not say -0.0.
    pan, tilt, roll = np.round(stance.angles_deg, 1) + 0.0
    reach = [
        # An angle that cannot be set has no room for a step at either end.
        float(np.clip(a, min(low + head.step_deg, high), max(high - head.step_deg, low))) + 0.0
        for a, (low, high) in zip((pan, tilt, roll), head.ranges_deg, strict=True)
    ]
    return InputError(
        "head-range",
        f"head {head.part.id} cannot hold {camera.name}: it needs pan {pan:.1f}, tilt {tilt:.1f} "
        f"and roll {roll:.1f} degrees at best",
        f"the nearest it can do is pan {reach[0]:.1f}, tilt {reach[1]:.1f}, roll {reach[2]:.1f}: "
        + (
            f"choose head {' or '.join(others[:3])}, which can hold it"
            if others
            else "choose another mount, for no head of the catalogue can hold it"
        ),
    )
