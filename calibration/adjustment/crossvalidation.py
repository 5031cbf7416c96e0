"""Two calibrations from two halves of the observations, and whether they differ as predicted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calibration.adjustment.build import some_rows
from calibration.adjustment.camera import INTERIOR
from calibration.adjustment.levenberg import LossOptions, adjust
from calibration.adjustment.network import Network
from calibration.adjustment.reduction import SingularError
from calibration.adjustment.result import CrossValidation
from calibration.adjustment.stages import NEAR_DAMPING
from calibration.adjustment.state import State
from geometry.arrays import Bools, Floats, Ints

LEAST_PER_CAMERA = 12
LEAST_FRAMES = 4
SMALL = 1e-10


def _halves(network: Network, frame: Ints) -> tuple[Bools, Bools, str]:
    """The rows of two halves, and how they were chosen."""
    frames = np.unique(frame)
    if len(frames) >= LEAST_FRAMES:
        odd = np.isin(frame, frames[::2])
        return odd, ~odd, "every other frame"
    # Targets with measured distances are in both: they may be all that tells the size.
    both = np.isin(network.observed.target, network.kept)
    even = network.observed.target % 2 == 0
    return even | both, ~even | both, "every other target"


def cross_validate(
    network: Network, frame: Ints, state: State, loss: LossOptions
) -> CrossValidation | None:
    """The ratio of found to predicted difference, or None when a half does not stand alone.

    ``frame`` (n,) of each image point. Both halves share the nominal coordinates and the datum.
    Camera parameters are compared in the directions in which both halves determine them:
    ``d^T (Q1 + Q2)^-1 d`` over its degrees of freedom, and the root of that.
    """
    *halves, words = _halves(network, frame)
    parts = []
    for half in halves:
        counts = np.bincount(network.observed.camera[half], minlength=network.camera_count)
        if counts.min() < LEAST_PER_CAMERA:
            return None
        found = _solved(_alone(some_rows(network, half)), state, loss)
        if found is None:
            return None
        parts.append(found)
    (one, one_q), (two, two_q) = parts
    return CrossValidation(_ratio(one - two, one_q + two_q), words)


def _alone(network: Network) -> Network:
    """A half in which what it does not determine is held, and seen by nobody."""
    sigma = network.priors.target_sigma
    unknown = np.isinf(sigma).any(axis=1)
    rays = np.bincount(network.observed.target, minlength=network.target_count)
    network = some_rows(network, ~(unknown & (rays < 2))[network.observed.target])
    unseen = unknown & (np.bincount(network.observed.target, minlength=len(rays)) == 0)
    poses = np.bincount(network.observed.pose, minlength=network.pose_count) == 0
    pose_sigma = network.pose_sigma.copy()
    pose_sigma[poses] = 0.0
    priors = replace(network.priors, target_sigma=np.where(unseen[:, None], 0.0, sigma))
    return replace(network, pose_sigma=pose_sigma, priors=priors)


def _solved(network: Network, state: State, loss: LossOptions) -> tuple[Floats, Floats] | None:
    """Camera parameters (19 n,) and their covariance."""
    try:
        solution = adjust(network, state, replace(loss, damping=NEAR_DAMPING))
        covariance = solution.reduction.covariance().cameras
    except SingularError:
        return None
    moved = np.zeros((network.camera_count, covariance.shape[0] // network.camera_count))
    moved[:, :INTERIOR] = solution.state.interior - state.interior
    moved[:, INTERIOR : INTERIOR + 3] = solution.state.centre - state.centre
    rotation = solution.state.rotation @ np.swapaxes(state.rotation, 1, 2)
    moved[:, INTERIOR + 3 :] = 0.5 * np.stack(
        [
            rotation[:, 2, 1] - rotation[:, 1, 2],
            rotation[:, 0, 2] - rotation[:, 2, 0],
            rotation[:, 1, 0] - rotation[:, 0, 1],
        ],
        axis=1,
    )
    return moved.ravel(), covariance


def _ratio(difference: Floats, covariance: Floats) -> float:
    scale = np.sqrt(np.diag(covariance))
    used = scale > 0.0
    scaled = covariance[np.ix_(used, used)] / np.outer(scale[used], scale[used])
    sizes, axes = np.linalg.eigh(scaled)
    good = sizes > SMALL * sizes.max()
    parts = axes[:, good].T @ (difference[used] / scale[used])
    return float(np.sqrt(np.mean(parts**2 / sizes[good])))
