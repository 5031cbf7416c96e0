"""The way from the datum to a camera's optical centre, step by step, as rows of a table.

Whoever goes along the rows with the settings of the sheet arrives at the camera's pose: nothing
else has to be known, not how a pivot is set nor where on the arm a head stands.
"""

from __future__ import annotations

import numpy as np

from geometry.arrays import Floats
from rig.build.drawings.figures import fixed
from rig.build.mounts.settings import CameraMount, Link, Motion

CHAIN_COLUMNS = ("Step", "x mm", "y mm", "z mm", "Turn z °", "x °", "y °", "Then")
CHAIN_WORDS = (
    "In each step: go x, y, z; turn about z, the new x, the new y; then slide or turn as set."
)
_AXES = {(1, 0, 0): "+x", (0, 1, 0): "+y", (0, 0, 1): "+z"} | {
    (-1, 0, 0): "-x", (0, -1, 0): "-y", (0, 0, -1): "-z"
}  # fmt: skip


def chain_rows(mount: CameraMount, datum_rig_mm: Floats) -> tuple[tuple[str, ...], ...]:
    """A row of :data:`CHAIN_COLUMNS` for each link, in the frame that the row before leads to.

    Lengths to 0.01 mm, angles to 0.001 degree: of ten rows the sum stays below what the other
    tables are rounded to.
    """
    rows = []
    for number, link in enumerate(mount.chain, 1):
        start = datum_rig_mm if number == 1 else np.zeros(3)
        rows.append((f"#{number}", *_fixed_part(link, start), _motion(link)))
    return tuple(rows)


def _fixed_part(link: Link, start_mm: Floats) -> tuple[str, ...]:
    away = link.transform[:3, 3] - start_mm
    turns = _turns_deg(link.transform[:3, :3])
    return (*(fixed(float(v), 2) for v in away), *(fixed(float(v), 3) for v in turns))


def _turns_deg(rotation: Floats) -> Floats:
    """Turns (3,) about z, the new x and the new y that make up a rotation (3, 3)."""
    about_x = np.arcsin(np.clip(rotation[2, 1], -1.0, 1.0))
    if abs(rotation[2, 1]) > 1.0 - 1e-12:
        # Upended, the turns about z and y are one: all of it is told of z.
        about_z, about_y = np.arctan2(rotation[1, 0], rotation[0, 0]), 0.0
    else:
        about_z = np.arctan2(-rotation[0, 1], rotation[1, 1])
        about_y = np.arctan2(-rotation[2, 0], rotation[2, 2])
    return np.degrees([about_z, about_x, about_y])


def _motion(link: Link) -> str:
    """What is set there: about which axis or along which, of the frame so far."""
    if link.motion is Motion.FIXED or link.axis is None:
        return "–"
    axis = np.asarray(link.axis)
    whole = np.rint(axis)
    named = (
        _AXES.get((int(whole[0]), int(whole[1]), int(whole[2])))
        if np.abs(axis - whole).max() < 1e-9
        else None
    )
    words = named or "(" + " ".join(f"{v:.5f}" for v in axis) + ")"
    by = "" if link.per_unit == 1.0 else f" x {link.per_unit:.6f}"
    return f"{link.motion} {words} by {link.setting}{by}"
