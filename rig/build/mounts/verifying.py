"""Three ways to see whether a camera stands and looks as its sheet says, in figures.

An inclinometer tells tilt and roll. A picture tells all: three marks at the datum must appear where
the figures say. A tape tells all but finely: a steel rule lies flat on the front of the lens, and
the tape goes to its ends, which a turn of the camera moves and the middle of the lens does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from geometry.arrays import Floats, frozen
from geometry.camera import RigCamera
from rig.build.mounts.plan import MountPlan
from rig.build.mounts.solids import lens_front
from rig.build.mounts.surroundings import SEAT_HEIGHT_MM

RULE_MM = 300.0
"""A common steel rule; a turn of 0.3 degrees moves its ends by 0.8 mm."""

MARKS_MM = (150.0, 125.0, 100.0, 75.0, 50.0, 25.0)
"""How far the two further marks may lie from the datum, the best first."""

ASIDE_MM = 1500.0
FLOOR_MARKS = (
    ("the subject's left", np.array([1.0, 0.0, 0.0])),
    ("the subject's right", np.array([-1.0, 0.0, 0.0])),
    ("before the subject", np.array([0.0, -1.0, 0.0])),
    ("behind the subject", np.array([0.0, 1.0, 0.0])),
)
"""Marks on the floor, :data:`ASIDE_MM` from the plumb point of the datum."""

ENDS = ("right", "left", "top", "bottom")
"""Ends of the rule, along the width and the height of the picture."""


@dataclass(frozen=True, eq=False)
class Check:
    """What is to be read on one camera that stands right.

    ``leans_deg`` (3,) over the level: optical axis, rule along the picture's width with its right
    end up, rule along its height with its top end up. ``marks_px`` (3, 2): the datum, the mark over
    it, the mark to the subject's left; NaN where it is outside of the picture. ``datum_mm`` and
    ``floor_mm`` (4,): from the datum and from the first of ``floor_marks`` to :data:`ENDS`;
    ``middle_mm``: from the second to the middle of the lens.
    """

    camera: str
    leans_deg: Floats
    marks_px: Floats
    datum_mm: Floats
    floor_marks: tuple[str, str]
    floor_mm: Floats
    middle_mm: float

    def __post_init__(self) -> None:
        for name in ("leans_deg", "marks_px", "datum_mm", "floor_mm"):
            object.__setattr__(self, name, frozen(getattr(self, name)))


@dataclass(frozen=True, eq=False)
class Verification:
    """The checks of all cameras. ``mark_mm``: how far the two further marks lie from the datum."""

    mark_mm: float
    checks: tuple[Check, ...]


def verification(plan: MountPlan) -> Verification:
    """What each camera of a plan is checked by."""
    cameras = [mount.camera for mount in plan.mounts]
    far = next((d for d in MARKS_MM if all(_inside(c, _marks(plan, d)).all() for c in cameras)),
               MARKS_MM[-1])  # fmt: skip
    corners = [s.corners_mm[:, 2].min() for s in plan.structure.solids]
    floor = min(corners, default=float(plan.datum_rig_mm[2]) - SEAT_HEIGHT_MM)
    checks = (check(c, plan.datum_rig_mm, float(floor), far) for c in cameras)
    return Verification(far, tuple(checks))


def check(camera: RigCamera, datum_mm: Floats, floor_z_mm: float, mark_mm: float) -> Check:
    """What one camera is checked by where it stands."""
    first, second = _floor_marks(camera, datum_mm, floor_z_mm)
    axes = camera.pose.rotation_rig_to_camera
    right, up, forward = axes[0], -axes[1], axes[2]
    leans = np.degrees(np.arcsin(np.clip([forward[2], right[2], up[2]], -1.0, 1.0)))
    half = RULE_MM / 2.0
    front = lens_front(camera)
    ends = front + half * np.stack([right, -right, up, -up])
    marks = _about(datum_mm, mark_mm)
    pixels = camera.camera.project(camera.pose, marks)[0]
    pixels = np.where(_inside(camera, marks)[:, None], pixels, np.nan)
    return Check(
        camera.name, leans, pixels, np.linalg.norm(ends - datum_mm, axis=1), (first[0], second[0]),
        np.linalg.norm(ends - first[1], axis=1), float(np.linalg.norm(front - second[1])),
    )  # fmt: skip


def _about(datum_mm: Floats, far_mm: float) -> Floats:
    """The datum, the mark over it and the one to the subject's left, (3, 3)."""
    return np.asarray(datum_mm + far_mm * np.array([[0.0, 0, 0], [0, 0, 1], [1, 0, 0]]))


def _marks(plan: MountPlan, far_mm: float) -> Floats:
    return _about(plan.datum_rig_mm, far_mm)


def _inside(camera: RigCamera, points_mm: Floats) -> Floats:
    """Which points (N, 3) are in the picture."""
    pixels, depths = camera.camera.project(camera.pose, points_mm)
    size = np.array(camera.camera.image_size_px)
    within = (pixels >= -0.5) & (pixels <= size - 0.5)
    return np.asarray(within.all(axis=1) & (depths > 0.0))


def _floor_marks(
    camera: RigCamera, datum_mm: Floats, floor_z_mm: float
) -> tuple[tuple[str, Floats], tuple[str, Floats]]:
    """The two marks on the floor that with the datum see a move of the camera any way best.

    A tape sees what is along it: the least singular value of the three directions is to be large.
    """
    front = lens_front(camera)
    plumb = np.array([datum_mm[0], datum_mm[1], floor_z_mm])
    places = [(words, plumb + ASIDE_MM * way) for words, way in FLOOR_MARKS]

    def seen(pair: tuple[tuple[str, Floats], tuple[str, Floats]]) -> float:
        ways = np.stack([datum_mm, pair[0][1], pair[1][1]]) - front
        ways = ways / np.linalg.norm(ways, axis=1, keepdims=True)
        return float(np.linalg.svd(ways, compute_uv=False)[-1])

    return max(combinations(places, 2), key=seen)
