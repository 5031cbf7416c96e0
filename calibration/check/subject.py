"""What changes of cameras do together to a face, as the rig sees it.

Every part of a face is seen by some of the cameras only. A group of cameras that moved together
shifts the parts that it sees, and tears them from the others, although all cameras together would
hardly notice: so the effect is that of all changes at once, where it is largest.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from calibration.adjustment.camera import PER_CAMERA
from calibration.adjustment.model import ObservationIndex, partials
from calibration.adjustment.state import State
from calibration.check.epoch import Epoch
from geometry.arrays import Bools, Floats, Ints
from geometry.camera import project as image_of

RADIUS_MM = 90.0
"""Half the width of a head with its ears, less half its curvature at the nose."""

POINTS = 400
WIDEST_DEG = 65.0
"""A camera sees skin that is turned from it by less; more slanting it adds nothing."""

WEAKEST = 8.0
"""Points whose depth is worse than this many pixels at the subject are left to better views."""


@dataclass(frozen=True, eq=False)
class Subject:
    """How points of a face (p,) move with the cameras' parameters: ``by_camera`` (p, 3, 19 n)."""

    by_camera: Floats

    def effect_mm(self, changes: Mapping[int, Floats]) -> float:
        """Largest shift of a point when all ``changes`` (19,) by camera index happened at once."""
        change = np.zeros(self.by_camera.shape[2])
        for camera, own in changes.items():
            change[PER_CAMERA * camera : PER_CAMERA * (camera + 1)] += own
        shifts = np.linalg.norm(self.by_camera @ change, axis=1)
        return float(shifts.max()) if len(shifts) else float("nan")


def subject_of(epoch: Epoch, state: State) -> Subject:
    """A face in the middle of what the cameras saw in this epoch."""
    seen = state.points_rig_mm(epoch.view, epoch.target)
    middle = np.median(seen, axis=0)
    reach = float(np.median(np.linalg.norm(seen - middle, axis=1)))
    normals = _sphere(POINTS)
    points = middle + min(RADIUS_MM, max(reach, 1e-6)) * normals
    sees = _visible(epoch, state, points, normals)
    sees &= sees.sum(axis=1, keepdims=True) >= 2
    point, camera = np.nonzero(sees)
    return Subject(_shifts(state, points, point, camera))


def _sphere(count: int) -> Floats:
    """Directions (count, 3) spread evenly (the golden spiral)."""
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    flat = np.sqrt(1.0 - z * z)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)


def _visible(epoch: Epoch, state: State, points: Floats, normals: Floats) -> Bools:
    """Which cameras see which points, (p, n)."""
    count = len(epoch.camera_names)
    used = np.isin(np.arange(count), np.unique(epoch.camera))
    to_camera = state.centre[None] - points[:, None]
    away = np.linalg.norm(to_camera, axis=2)
    facing = np.einsum("pci,pi->pc", to_camera, normals) > np.cos(np.radians(WIDEST_DEG)) * away
    local = np.einsum("cij,pcj->pci", state.rotation, -to_camera)
    pixels, _ = image_of(local, state.interior)
    size = np.array(epoch.image_size_px)
    inside = ((pixels > 0.0) & (pixels < size)).all(axis=2) & (local[..., 2] > 0.0)
    return np.asarray(facing & inside & used)


def _shifts(state: State, points: Floats, point: Ints, camera: Ints) -> Floats:
    """How intersected points move with the parameters of the cameras that see them."""
    placed = State(
        state.interior, state.centre, state.rotation, np.zeros((1, 3)), np.eye(3)[None], points
    )
    parts = partials(placed, ObservationIndex(camera, np.zeros_like(point), point))
    rows = np.swapaxes(parts.target, 1, 2)
    normal = np.zeros((len(points), 3, 3))
    np.add.at(normal, point, rows @ parts.target)
    sizes = np.linalg.eigvalsh(normal)
    good = (sizes[:, 0] > 0.0) & (WEAKEST**2 * sizes[:, 0] > sizes[:, 2])
    inverse = np.linalg.inv(np.where(good[:, None, None], normal, np.eye(3)))
    moved = inverse[point] @ rows @ parts.camera
    count = len(state.interior)
    out = np.zeros((len(points) * count, 3, PER_CAMERA))
    np.add.at(out, point * count + camera, moved)
    by_point = np.swapaxes(out.reshape(len(points), count, 3, PER_CAMERA), 1, 2)
    return np.asarray(by_point.reshape(len(points), 3, -1)[good])
