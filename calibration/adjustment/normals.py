"""Normal equations, gathered in the blocks that their sparsity leaves.

Cameras and placed carriers form the core, dense and small. The matrix of the targets is block
diagonal with 3 x 3 blocks, so that they can be eliminated one by one (Schur complement).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.adjustment.camera import PER_CAMERA
from calibration.adjustment.model import Partials, partials, project
from calibration.adjustment.network import Network
from calibration.adjustment.rotations import vector_of
from calibration.adjustment.state import State
from geometry.arrays import Floats, Ints


@dataclass(frozen=True, eq=False)
class Normals:
    """``core`` (c, c), ``cross`` (c, m, 3), ``target`` (m, 3, 3); right-hand sides likewise."""

    core: Floats
    cross: Floats
    target: Floats
    core_right: Floats
    target_right: Floats


@dataclass(frozen=True, eq=False)
class Residuals:
    """Observed less computed values, and ``depth`` (n,) of the image points in mm.

    ``pixel`` (n, 2); ``interior`` (n, 13), ``exterior`` (n, 6), ``target`` (m, 3) of the priors;
    ``length_mm`` (d,) of the measured distances.
    """

    pixel: Floats
    depth_mm: Floats
    interior: Floats
    exterior: Floats
    target: Floats
    length_mm: Floats


def _weights(sigma: Floats) -> Floats:
    """Weights of priors: held (0) and unknown (infinity) ones have none."""
    with np.errstate(divide="ignore"):
        return np.where(sigma > 0.0, 1.0 / sigma**2, 0.0)


def _differences(state: State, network: Network) -> tuple[Floats, Floats]:
    """Vectors (d, 3) and lengths (d,) between the targets of measured distances."""
    lengths = network.lengths
    between = state.target[lengths.second] - state.target[lengths.first]
    return between, np.linalg.norm(between, axis=1)


def residuals(state: State, network: Network, pixel: Floats, depth_mm: Floats) -> Residuals:
    """All residuals, with the computed pixels and depths already at hand."""
    priors = network.priors
    rotation = state.rotation @ np.swapaxes(priors.rotation, 1, 2)
    exterior = np.concatenate([priors.centre - state.centre, -vector_of(rotation)], axis=1)
    _, computed = _differences(state, network)
    return Residuals(
        network.pixel - pixel,
        depth_mm,
        priors.interior - state.interior,
        exterior,
        priors.target - state.target,
        network.lengths.length_mm - computed,
    )


def all_residuals(state: State, network: Network) -> Residuals:
    """All residuals of a state."""
    return residuals(state, network, *project(state, network.observed))


def prior_cost(found: Residuals, network: Network) -> float:
    """Weighted square sum of the residuals of interiors, poses and coordinates."""
    priors = network.priors
    pairs = (
        (found.interior, priors.interior_sigma),
        (found.exterior, priors.exterior_sigma),
        (found.target, priors.target_sigma),
    )
    return sum(float(np.sum(r * r * _weights(s))) for r, s in pairs)


def _flat_index(rows: Ints, width: int, columns: Ints, height: int, stride: int) -> Ints:
    """Flat places of blocks (n, width, height) in a matrix with ``stride`` columns."""
    row = rows[:, None] * width + np.arange(width)
    column = columns[:, None] * height + np.arange(height)
    return (row[:, :, None] * stride + column[:, None, :]).ravel()


class Assembler:
    """Gathers the normal equations of a network; what does not change is prepared once."""

    def __init__(self, network: Network) -> None:
        self._network = network
        observed, m = network.observed, network.target_count
        self._offset = PER_CAMERA * network.camera_count
        self._moving = bool((network.pose_sigma > 0.0).any())
        self._camera_target = _flat_index(observed.camera, PER_CAMERA, observed.target, 3, 3 * m)
        self._targets = _flat_index(observed.target, 3, np.zeros_like(observed.target), 3, 3)
        self._camera_mask = network.camera_free.astype(np.float64)
        self._target_mask = network.target_free.astype(np.float64)
        self._pose_mask = (network.pose_sigma > 0.0).astype(np.float64)
        if self._moving:
            k = network.pose_count
            self._pose_target = _flat_index(observed.pose, 6, observed.target, 3, 3 * m)
            self._camera_pose = _flat_index(observed.camera, PER_CAMERA, observed.pose, 6, 6 * k)
            self._poses = _flat_index(observed.pose, 6, np.zeros_like(observed.pose), 6, 6)

    def masked(self, parts: Partials) -> Partials:
        """Partials with nothing by what is held fast."""
        observed = self._network.observed
        return Partials(
            parts.pixel,
            parts.depth_mm,
            parts.camera * self._camera_mask[observed.camera][:, None, :],
            parts.pose * self._pose_mask[observed.pose][:, None, :],
            parts.target * self._target_mask[observed.target][:, None, :],
        )

    def linearise(self, state: State) -> tuple[Partials, Residuals]:
        """Partials and residuals at ``state``."""
        parts = self.masked(partials(state, self._network.observed))
        return parts, residuals(state, self._network, parts.pixel, parts.depth_mm)

    def gather(self, parts: Partials, found: Residuals, weights: Floats) -> Normals:
        """Normal equations with ``weights`` (n,) of the robust loss times 1 / sigma^2."""
        root = np.sqrt(weights)[:, None] / self._network.sigma_px
        camera, target = parts.camera * root[:, :, None], parts.target * root[:, :, None]
        pose = parts.pose * root[:, :, None] if self._moving else parts.pose
        misfit = found.pixel * root
        normals = self._images(camera, pose, target, misfit)
        self._add_priors(normals, found)
        return normals

    def _images(self, camera: Floats, pose: Floats, target: Floats, misfit: Floats) -> Normals:
        network = self._network
        m, core_count = network.target_count, network.core_count
        core, core_right = np.zeros((core_count, core_count)), np.zeros(core_count)
        rows = network.camera_rows
        for c in range(network.camera_count):
            part = camera[rows[c] : rows[c + 1]].reshape(-1, PER_CAMERA)
            place = slice(PER_CAMERA * c, PER_CAMERA * (c + 1))
            core[place, place] = part.T @ part
            core_right[place] = part.T @ misfit[rows[c] : rows[c + 1]].ravel()
        cross = np.zeros((core_count, m, 3))
        rotated = np.swapaxes(camera, 1, 2)
        cross[: self._offset] = self._sum(
            self._camera_target, rotated @ target, (self._offset, m, 3)
        )
        if self._moving:
            self._add_carriers(core, cross, core_right, camera, pose, target, misfit)
        across = np.swapaxes(target, 1, 2)
        blocks = self._sum(self._targets, across @ target, (m, 3, 3))
        right = np.zeros((m, 3))
        for axis in range(3):
            both = np.einsum("na,na->n", target[:, :, axis], misfit)
            right[:, axis] = np.bincount(network.observed.target, both, minlength=m)
        return Normals(core, cross, blocks, core_right, right)

    def _add_carriers(
        self,
        core: Floats,
        cross: Floats,
        right: Floats,
        camera: Floats,
        pose: Floats,
        target: Floats,
        misfit: Floats,
    ) -> None:
        k, m, o = self._network.pose_count, self._network.target_count, self._offset
        rotated = np.swapaxes(pose, 1, 2)
        cross[o:] = self._sum(self._pose_target, rotated @ target, (6 * k, m, 3))
        mixed = self._sum(self._camera_pose, np.swapaxes(camera, 1, 2) @ pose, (o, 6 * k))
        core[:o, o:], core[o:, :o] = mixed, mixed.T
        blocks = self._sum(self._poses, rotated @ pose, (k, 6, 6))
        for j in range(k):
            core[o + 6 * j : o + 6 * j + 6, o + 6 * j : o + 6 * j + 6] += blocks[j]
        sides = np.einsum("nap,na->np", pose, misfit)
        for axis in range(6):
            sums = np.bincount(self._network.observed.pose, sides[:, axis], minlength=k)
            right[o + axis :: 6] += sums

    @staticmethod
    def _sum(places: Ints, values: Floats, shape: tuple[int, ...]) -> Floats:
        size = int(np.prod(shape))
        sums = np.bincount(places, values.ravel(), minlength=size)
        return np.asarray(sums, np.float64).reshape(shape)

    def _add_priors(self, normals: Normals, found: Residuals) -> None:
        network, priors = self._network, self._network.priors
        weight = np.concatenate(
            [_weights(priors.interior_sigma), _weights(priors.exterior_sigma)], 1
        )
        misfit = np.concatenate([found.interior, found.exterior], axis=1)
        count, o = network.core_count, self._offset
        diagonal = np.concatenate([weight.ravel(), _weights(network.pose_sigma).ravel()])
        # Held unknowns get a one on the diagonal and nothing else: they stay where they are.
        normals.core[np.arange(count), np.arange(count)] += diagonal + ~network.core_free
        normals.core_right[:o] += (weight * misfit).ravel()
        known = _weights(priors.target_sigma)
        axes = np.arange(3)
        normals.target[:, axes, axes] += known + ~network.target_free
        normals.target_right[:] += known * found.target
