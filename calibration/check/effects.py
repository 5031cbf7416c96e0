"""What a change of a camera does to its images and to points at the subject."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.adjustment.camera import INTERIOR, PER_CAMERA
from calibration.adjustment.model import partials
from calibration.adjustment.reliability import DELTA0
from calibration.adjustment.state import State
from calibration.check.epoch import Epoch
from calibration.check.linear import Columns, sight_of
from calibration.check.verdicts import Sensitivity
from geometry.arrays import Floats

URAD = 1e6
MICROMETRE = 1e3

PARALLEL = 1e-6
"""Least over largest weight of a point; rays a milliradian apart meet in a point of that."""


@dataclass(frozen=True, eq=False)
class Effects:
    """Mean squares at what each camera sees: ``change^T form change`` of its 19 parameters.

    ``px`` (n, 19, 19) of its image points; ``mm`` (n, 19, 19) of the points in space that are
    intersected with the old calibration although this camera has changed. ``gsd_mm``: how much
    of the subject one pixel is, over all cameras. ``rotation`` (n, 3, 3) rig to camera.
    """

    px: Floats
    mm: Floats
    gsd_mm: float
    rotation: Floats

    def of(self, camera: int, change: Floats, first: int) -> tuple[float, float]:
        """Root mean square effect in px and mm of a change (d,) of parameters from ``first``."""
        own = slice(first, first + len(change))
        square_px = float(change @ self.px[camera, own, own] @ change)
        square_mm = float(change @ self.mm[camera, own, own] @ change)
        return float(np.sqrt(max(square_px, 0.0))), float(np.sqrt(max(square_mm, 0.0)))


def effects(epoch: Epoch, state: State) -> Effects:
    """The forms of all cameras at what they see in this epoch."""
    parts = partials(state, sight_of(epoch))
    count = len(epoch.camera_names)
    by_point = parts.pose[:, :, :3]
    moved = _point_shifts(epoch, by_point, parts.camera)
    px, mm = np.zeros((count, PER_CAMERA, PER_CAMERA)), np.zeros((count, PER_CAMERA, PER_CAMERA))
    for k in range(count):
        own = epoch.camera == k
        if own.any():
            px[k] = np.einsum("nap,naq->pq", parts.camera[own], parts.camera[own]) / own.sum()
            mm[k] = np.einsum("nap,naq->pq", moved[own], moved[own]) / own.sum()
    focal = state.interior[epoch.camera, 0]
    return Effects(px, mm, float(np.median(parts.depth_mm / focal)), state.rotation)


def _point_shifts(epoch: Epoch, by_point: Floats, by_camera: Floats) -> Floats:
    """How intersected points move with their camera's parameters, (n, 3, 19); mm per unit."""
    _, point = np.unique(epoch.points, return_inverse=True)
    point = point.reshape(-1)
    blocks = np.swapaxes(by_point, 1, 2) @ by_point
    normal = np.zeros((int(point.max(initial=-1)) + 1, 3, 3))
    np.add.at(normal, point, blocks)
    # Rays of one camera to a target that stands meet nowhere, however many frames show it.
    sizes = np.linalg.eigvalsh(normal)
    good = sizes[:, 0] > PARALLEL * sizes[:, 2]
    inverse = np.zeros_like(normal)
    inverse[good] = np.linalg.inv(normal[good])
    return np.asarray(inverse[point] @ np.swapaxes(by_point, 1, 2) @ by_camera)


def sensitivity(
    camera: int, spread: Floats, found: Effects, columns: Columns
) -> Sensitivity | None:
    """What the pose test of a camera could have seen; None when it could see nothing.

    A movement along a unit direction u is found from ``delta0 / sqrt(u^T M u)`` on, M being the
    covariance of the camera's score.
    """
    place = columns.camera(camera, INTERIOR, PER_CAMERA)
    own = spread[np.ix_(place, place)]
    if not (np.diag(own) > 0.0).all():
        return None
    # Shifts are unknowns along the rig's axes, but are told along the camera's.
    rotated = np.eye(6)
    rotated[:3, :3] = found.rotation[camera].T
    single = DELTA0 / np.sqrt(np.diag(rotated.T @ own @ rotated))
    part = slice(INTERIOR, PER_CAMERA)
    translation, turn = single[:3] * MICROMETRE, single[3:] * URAD
    hidden_px = DELTA0 * _largest(found.px[camera, part, part], own)
    hidden_mm = DELTA0 * _largest(found.mm[camera, part, part], own)
    return Sensitivity(
        (float(turn[0]), float(turn[1]), float(turn[2])),
        (float(translation[0]), float(translation[1]), float(translation[2])),
        hidden_mm,
        hidden_px,
    )


def _largest(form: Floats, own: Floats) -> float:
    """Root of the largest ``u^T form u`` with ``u^T own u = 1``; infinite when own is singular."""
    scale = np.sqrt(np.diag(own))
    sizes, axes = np.linalg.eigh(own / np.outer(scale, scale))
    if sizes[0] <= 1e-12 * sizes[-1]:
        return float("inf")
    root = axes / np.sqrt(sizes) / scale[:, None]
    return float(np.sqrt(max(np.linalg.eigvalsh(root.T @ form @ root)[-1], 0.0)))
