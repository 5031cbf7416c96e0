"""Aiming a camera by its picture: where the datum should be, and the turn that brings it there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from geometry.arrays import Floats
from geometry.camera import RigCamera
from geometry.frames import rotation_from_pan_tilt_roll

Pixel = tuple[float, float]

HIT_DEG = 0.05
"""Nobody sets a tripod head finer, so a smaller turn is not asked for."""


@dataclass(frozen=True)
class Turn:
    """How far from its place the datum is in a picture, and the turn that brings it there.

    ``right_px``, ``down_px``: from where it should be to where it is. ``pan_deg`` to the right,
    as seen from behind the camera, ``tilt_deg`` up.
    """

    right_px: float
    down_px: float
    pan_deg: float
    tilt_deg: float

    @property
    def text(self) -> str:
        """What to do, in words."""
        if max(abs(self.pan_deg), abs(self.tilt_deg)) < HIT_DEG:
            return "The datum is where it should be."
        where, turns = [], []
        if abs(self.right_px) >= 0.5:
            where.append(_way(self.right_px, "px", 0, "right", "left"))
        if abs(self.down_px) >= 0.5:
            where.append(_way(self.down_px, "px", 0, "low", "high"))
        if abs(self.pan_deg) >= HIT_DEG:
            turns.append("pan " + _way(self.pan_deg, "degrees", 2, "to the right", "to the left"))
        if abs(self.tilt_deg) >= HIT_DEG:
            turns.append("tilt " + _way(self.tilt_deg, "degrees", 2, "up", "down"))
        return f"The datum is {' and '.join(where)}: {', '.join(turns)}."


def datum_pixel(camera: RigCamera, datum_rig_mm: Floats) -> Pixel | None:
    """Where the datum (3,) is in a picture of a camera in its place; None: outside of it."""
    pixels, depths = camera.camera.project(camera.pose, np.reshape(datum_rig_mm, (1, 3)))
    x_px, y_px = (float(value) for value in pixels[0])
    width, height = camera.camera.image_size_px
    inside = -0.5 <= x_px < width - 0.5 and -0.5 <= y_px < height - 0.5
    return (x_px, y_px) if depths[0] > 0.0 and inside else None


def turn_to(camera: RigCamera, datum_rig_mm: Floats, found_px: Pixel) -> Turn:
    """The turn of a camera in its place and roll whose picture shows the datum at ``found_px``."""
    pose = camera.pose
    pixels, _ = camera.camera.project(pose, np.reshape(datum_rig_mm, (1, 3)))
    pan, tilt, roll = pose.pan_tilt_roll_deg
    towards = datum_rig_mm - pose.position_rig_mm
    towards = towards / np.linalg.norm(towards)
    seen = camera.camera.rays(np.reshape(found_px, (1, 2)))[0]

    def misses(off_deg: Floats) -> Floats:
        turned = rotation_from_pan_tilt_roll(np.array([pan + off_deg[0], tilt + off_deg[1], roll]))
        return np.asarray(turned @ towards - seen)

    # Three numbers for two unknowns: a datum that is seen at all has a turn that shows it there.
    off_deg = least_squares(misses, np.zeros(2), x_scale=1.0).x
    right, down = np.subtract(found_px, pixels[0])
    return Turn(float(right), float(down), -float(off_deg[0]), -float(off_deg[1]))


def _way(value: float, unit: str, digits: int, more: str, less: str) -> str:
    return f"{abs(value):.{digits}f} {unit} {more if value >= 0.0 else less}"
