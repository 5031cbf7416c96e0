"""Numbers as drawings state them: lengths to 0.1 mm, angles to 0.01 degree."""

from __future__ import annotations

import numpy as np

from geometry.arrays import Floats
from geometry.camera import RigCamera
from rig.build.mounts.settings import Setting

LENGTH_STEP_MM = 0.1
ANGLE_STEP_DEG = 0.01
STATED = "lengths to 0.1 mm, angles to 0.01°"
MOST_DECIMALS = 3
POSE_COLUMNS = ("Camera", "X mm", "Y mm", "Z mm", "Pan °", "Tilt °", "Roll °", "Focus mm")


def fixed(value: float, decimals: int) -> str:
    """A number with so many decimals, never a negative zero."""
    text = f"{value:.{decimals}f}"
    return text.lstrip("-") if float(text) == 0.0 else text


def mm(value: float) -> str:
    """A length."""
    return fixed(value, 1)


def deg(value: float) -> str:
    """An angle."""
    return fixed(value, 2)


def setting_text(setting: Setting) -> str:
    """The value of a setting: as finely as it can be set, or as lengths and angles are stated."""
    if setting.step <= 0.0:
        return mm(setting.value) if setting.unit == "mm" else deg(setting.value)
    grid = (setting.step, setting.origin)
    for decimals in range(MOST_DECIMALS):
        if all(abs(round(v, decimals) - v) < 1e-9 for v in grid):
            return fixed(setting.value, decimals)
    return fixed(setting.value, MOST_DECIMALS)


def pose_figures(camera: RigCamera, datum_rig_mm: Floats) -> tuple[str, ...]:
    """A row of :data:`POSE_COLUMNS`: optical centre from the datum, and how the camera looks."""
    place = camera.pose.position_rig_mm - datum_rig_mm
    angles = np.asarray(camera.pose.pan_tilt_roll_deg)
    return (
        camera.name,
        *(mm(float(v)) for v in place),
        *(deg(float(v)) for v in angles),
        mm(camera.focus_distance_mm),
    )
