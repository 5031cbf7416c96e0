"""Points in space from their images in calibrated cameras, with what they inherit from both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.adjustment.camera import PER_CAMERA, CalibratedCamera
from calibration.adjustment.finite import finite_rows
from calibration.adjustment.initialisation.rays import nearest_points
from calibration.adjustment.model import ObservationIndex, partials
from calibration.adjustment.state import State, camera_arrays
from geometry.arrays import Bools, Floats, Ints

ITERATIONS = 10
STILL_MM = 1e-9


@dataclass(frozen=True, eq=False)
class Points:
    """``position_rig_mm`` (p, 3), NaN where fewer than two cameras saw a point.

    ``covariance_mm2`` (p, 3, 3) from image noise; ``by_cameras`` (p, 3, 19 n): how points move
    when the cameras that were used are not the true ones; ``rays`` (p,).
    """

    position_rig_mm: Floats
    covariance_mm2: Floats
    by_cameras: Floats
    rays: Ints


def intersected(
    cameras: tuple[CalibratedCamera, ...],
    camera: Ints,
    point: Ints,
    pixel: Floats,
    sigma_px: Floats,
    count: int,
) -> Points:
    """Least-squares points (Gauss-Newton from the nearest points of the rays).

    ``camera``, ``point`` (n,) with ``count`` points in all, ``pixel`` and ``sigma_px`` (n, 2).
    """
    used = np.bincount(point, minlength=count)[point] >= 2
    camera, point, pixel, sigma_px = camera[used], point[used], pixel[used], sigma_px[used]
    start = _start(cameras, camera, point, pixel, count)
    good = finite_rows(start)
    keep = good[point]
    camera, point, pixel, sigma_px = camera[keep], point[keep], pixel[keep], sigma_px[keep]
    observed = ObservationIndex(camera, np.zeros_like(camera), point)
    state = State(
        *camera_arrays(cameras),
        np.zeros((1, 3)),
        np.eye(3)[None],
        np.where(good[:, None], start, 0.0),
    )
    normal = np.zeros((count, 3, 3))
    for _ in range(ITERATIONS):
        parts = partials(state, observed)
        rows = parts.target / sigma_px[:, :, None]
        normal, right = np.zeros((count, 3, 3)), np.zeros((count, 3))
        across = np.swapaxes(rows, 1, 2)
        np.add.at(normal, point, across @ rows)
        np.add.at(right, point, np.einsum("nap,na->np", rows, (pixel - parts.pixel) / sigma_px))
        normal[~good] = np.eye(3)
        step: Floats = np.asarray(np.linalg.solve(normal, right[:, :, None])[:, :, 0], np.float64)
        state = state.moved(np.zeros(PER_CAMERA * len(cameras) + 6), step)
        if np.abs(step).max(initial=0.0) < STILL_MM:
            break
    return _finished(state, observed, sigma_px, normal, good)


def _start(
    cameras: tuple[CalibratedCamera, ...], camera: Ints, point: Ints, pixel: Floats, count: int
) -> Floats:
    origins, directions = np.empty((len(camera), 3)), np.empty((len(camera), 3))
    for k, one in enumerate(cameras):
        own = camera == k
        origins[own], directions[own] = one.pose.position_rig_mm, one.rays(pixel[own])
    return nearest_points(origins, directions, point, count)


def _finished(
    state: State, observed: ObservationIndex, sigma_px: Floats, normal: Floats, good: Bools
) -> Points:
    parts = partials(state, observed)
    covariance = np.linalg.inv(normal)
    rows = parts.target / sigma_px[:, :, None]
    pull = covariance[observed.target] @ np.swapaxes(rows, 1, 2)
    effect = -pull @ (parts.camera / sigma_px[:, :, None])
    count = len(good)
    cameras = len(state.interior)
    by_pair = np.zeros((count * cameras, 3, PER_CAMERA))
    np.add.at(by_pair, observed.target * cameras + observed.camera, effect)
    by_cameras = np.swapaxes(by_pair.reshape(count, cameras, 3, PER_CAMERA), 1, 2)
    return Points(
        np.where(good[:, None], state.target, np.nan),
        np.where(good[:, None, None], covariance, np.nan),
        by_cameras.reshape(count, 3, -1),
        np.bincount(observed.target, minlength=count),
    )
