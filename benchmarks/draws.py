"""Many calibrations of one rig: what noise does, beside what the covariance predicts."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from synthetic_scenes import Scene, face_scene

from calibration.adjustment import Calibration, CalibrationOptions, calibrate
from calibration.adjustment.camera import INTERIOR, PER_CAMERA, CalibratedCamera
from calibration.adjustment.forward import intersected
from calibration.adjustment.rotations import vector_of
from calibration.adjustment.state import camera_arrays
from geometry.arrays import Bools, Floats

LENGTHS_MM = (0.0, 60.0, 120.0, 190.0, 260.0, 330.0)
WAYS = (
    (1.0, 0.0, 0.0),
    (0.0, 0.0, 1.0),
    (0.3, 1.0, 0.2),
    (1.0, 0.0, 1.0),
    (1.0, 0.0, -1.0),
    (1.0, 0.6, 0.7),
    (-1.0, 0.6, 0.7),
)
"""Seven lines through the volume; the third, in depth, is the hardest."""


@dataclass(frozen=True, eq=False)
class Draws:
    """What became of many calibrations.

    ``error`` (draws, p) of the free camera parameters and ``sigma`` (draws, p) as stated;
    ``predicted`` (p, p) of the first draw; ``free`` (15 n,) which parameters these are.

    ``length_um`` and ``floor_um`` (draws, 35): errors of lengths with the calibrated and with
    the true cameras in the same images.
    """

    error: Floats
    sigma: Floats
    predicted: Floats
    free: Bools
    length_um: Floats
    floor_um: Floats

    @property
    def coverage(self) -> Floats:
        """Share of draws (p,) whose stated 95 % interval holds the truth."""
        return np.mean(np.abs(self.error) < 1.959964 * self.sigma, axis=0)

    @property
    def centre_ratio(self) -> float:
        """Root mean square error of all camera centres over their Cramer-Rao bound."""
        place = np.zeros(len(self.free), bool).reshape(-1, PER_CAMERA)
        place[:, INTERIOR : INTERIOR + 3] = True
        own = place.ravel()[self.free]
        bound = float(np.trace(self.predicted[np.ix_(own, own)]))
        return float(np.sqrt(np.mean(np.sum(self.error[:, own] ** 2, axis=1)) / bound))

    def eigenvalue_ratio(self) -> Floats:
        """Sampled over predicted sigma (r,) along the principal axes of the prediction."""
        scale = np.sqrt(np.diag(self.predicted))
        sizes, axes = np.linalg.eigh(self.predicted / np.outer(scale, scale))
        good = sizes > 1e-9
        parts = (self.error / scale) @ axes[:, good]
        return np.asarray(np.sqrt(np.mean(parts**2, axis=0) / sizes[good]))


def redrawn(scene: Scene, rng: np.random.Generator) -> Scene:
    """Another truth that the same nominal values allow: plate and bars as their sigmas say."""
    true = scene.true_mm.copy()
    first = 0
    for carrier in scene.targets.carriers:
        own = slice(first, first + len(carrier.ids))
        first += len(carrier.ids)
        if np.isfinite(carrier.sigma_mm).all():
            true[own] = carrier.nominal_mm + carrier.sigma_mm * rng.normal(size=true[own].shape)
    ids = scene.targets.ids
    distances = tuple(
        replace(
            d,
            length_mm=float(
                np.linalg.norm(true[ids.index(d.first)] - true[ids.index(d.second)])
                + d.sigma_mm * rng.normal()
            ),
        )
        for d in scene.targets.distances
    )
    return replace(scene, true_mm=true, targets=replace(scene.targets, distances=distances))


def line_points() -> Floats:
    """End points of the lengths on all lines, (7, 6, 3), in the rig frame."""
    ways = np.array(WAYS)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    along = np.array(LENGTHS_MM) - LENGTHS_MM[-1] / 2.0
    return np.asarray(along[None, :, None] * ways[:, None, :])


def length_errors_um(
    used: tuple[CalibratedCamera, ...],
    true: tuple[CalibratedCamera, ...],
    noise: Floats,
    sigma_px: float,
) -> Floats:
    """Errors (35,) of lengths measured with ``used`` in images of ``true`` with ``noise``."""
    points = line_points().reshape(-1, 3)
    pixels = np.stack([c.project(points) for c in true]) + noise
    seen = np.stack(
        [
            ((p > 0.0) & (p < np.array(c.image_size_px) - 1.0)).all(axis=1)
            for p, c in zip(pixels, true, strict=True)
        ]
    )
    camera, point = np.nonzero(seen)
    image = pixels[camera, point]
    found = intersected(
        used, camera, point, image, np.full(image.shape, sigma_px), len(points)
    ).position_rig_mm.reshape(len(WAYS), len(LENGTHS_MM), 3)
    measured = np.linalg.norm(found[:, 1:] - found[:, :1], axis=2)
    return np.asarray(1e3 * (measured - np.array(LENGTHS_MM[1:])).ravel())


def drawn(count: int, sigma_px: float, processes: int) -> Draws:
    """Calibrations of the 7-camera rig, shared out to processes."""
    part = -(-count // (8 * processes))
    firsts = range(0, count, part)
    with ProcessPoolExecutor(processes) as pool:
        waiting = [pool.submit(draw, min(part, count - f), sigma_px, first=f) for f in firsts]
        parts = [w.result() for w in waiting]
    lengths, floor = ([getattr(p, name) for p in parts] for name in ("length_um", "floor_um"))
    return replace(
        parts[0],
        error=np.concatenate([p.error for p in parts]),
        sigma=np.concatenate([p.sigma for p in parts]),
        length_um=np.concatenate(lengths),
        floor_um=np.concatenate(floor),
    )


def draw(count: int, sigma_px: float, frames: int = 12, rings: int = 60, first: int = 0) -> Draws:
    """Calibrations of the 7-camera rig, each with a truth and noise of its own.

    A draw's number, from ``first`` on, makes it what it is.
    """
    scene = face_scene(frames=frames, rings=rings)
    points = len(WAYS) * len(LENGTHS_MM)
    error, sigma, lengths, floor = [], [], [], []
    predicted = free = None
    for k in range(first, first + count):
        rng = np.random.default_rng([7, k])
        truth = redrawn(scene, rng)
        options = CalibrationOptions(start=scene.cameras, cross_validate=False)
        found = calibrate(truth.observe(sigma_px, rng), options)
        covariance = found.covariance.cameras
        if predicted is None:
            free = np.diag(covariance) > 0.0
            predicted = covariance[np.ix_(free, free)]
        error.append(_difference(found, truth)[free])
        sigma.append(np.sqrt(np.diag(covariance)[free]))
        noise = sigma_px * rng.normal(size=(len(scene.cameras), points, 2))
        lengths.append(length_errors_um(found.cameras, truth.cameras, noise, sigma_px))
        floor.append(length_errors_um(truth.cameras, truth.cameras, noise, sigma_px))
    assert predicted is not None and free is not None  # noqa: S101 - count is positive
    return Draws(
        np.array(error), np.array(sigma), predicted, free, np.array(lengths), np.array(floor)
    )


def _difference(found: Calibration, truth: Scene) -> Floats:
    """Found less true camera parameters (15 n,)."""
    ours, theirs = camera_arrays(found.cameras), camera_arrays(truth.cameras)
    turn = vector_of(ours[2] @ np.swapaxes(theirs[2], 1, 2))
    return np.concatenate([ours[0] - theirs[0], ours[1] - theirs[1], turn], axis=1).ravel()
