"""Rows about rays: framing, ground sample distance, depth of field, centring, axis incidence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats, Ints
from solver.constraints.base import Block, camera_columns, scatter
from solver.variables import ANGLES, FOCUS, PER_CAMERA, POSITION, NetworkState


def _by_camera(cameras: Ints) -> list[tuple[int, Ints]]:
    """Camera indices with the rows that belong to each."""
    return [(int(k), np.flatnonzero(cameras == k)) for k in np.unique(cameras)]


def _add_linear(out: Floats, state: NetworkState, camera: int, pull: Floats, arms: Floats) -> None:
    """Curvature of ``sum c . R (P - C)``: ``pull`` (3,) sum of c, ``arms`` (3, 3) sum of c d'."""
    at = PER_CAMERA * camera
    angles, place = slice(at, at + 3), slice(at + 3, at + 6)
    out[angles, angles] += np.einsum("abkm,km->ab", state.rotation_2[camera], arms)
    mixed = -np.einsum("akm,k->am", state.rotation_1[camera], pull)
    out[angles, place] += mixed
    out[place, angles] += mixed.T


@dataclass(frozen=True, eq=False)
class RayPlanes(Block):
    """``normal . R (P - C)``: the signed distance of a point from a plane through the camera.

    ``camera`` (m,), ``point`` (m, 3), ``normal`` (m, 3) in the camera frame. The four sides of
    the frame (Eq 11), the ground sample distance and the near limit are all of this kind.
    """

    camera: Ints
    point: Floats
    normal: Floats

    @property
    def columns(self) -> Ints:
        return camera_columns(self.camera, 6)

    def value(self, state: NetworkState) -> Floats:
        offset = self.point - state.centre[self.camera]
        world = np.einsum("rk,rkm->rm", self.normal, state.rotation[self.camera])
        return np.asarray(np.einsum("rm,rm->r", world, offset))

    def jacobian(self, state: NetworkState) -> Floats:
        offset = self.point - state.centre[self.camera]
        out = np.empty((self.rows, 6))
        turned = np.einsum("rk,rakm->ram", self.normal, state.rotation_1[self.camera])
        out[:, ANGLES] = np.einsum("ram,rm->ra", turned, offset)
        out[:, POSITION] = -np.einsum("rk,rkm->rm", self.normal, state.rotation[self.camera])
        return out

    def add_hessian(self, state: NetworkState, multipliers: Floats, out: Floats) -> None:
        for camera, rows in _by_camera(self.camera):
            pull = multipliers[rows, None] * self.normal[rows]
            arms = pull.T @ (self.point[rows] - state.centre[camera])
            _add_linear(out, state, camera, pull.sum(axis=0), arms)


@dataclass(frozen=True, eq=False)
class FocusRays(Block):
    """Depth of field: ``side (z - s) - k(s) z <= 0`` with ``k(s) = blur (s - f)``.

    ``side`` (m,) is +1 for the far limit and -1 for the near one; ``blur`` (m,) is
    ``c N L / f**2`` with the length scale L; ``focal`` (m,) is f / L. See
    :mod:`geometry.optics`.
    """

    camera: Ints
    point: Floats
    side: Floats
    blur: Floats
    focal: Floats

    @property
    def columns(self) -> Ints:
        return camera_columns(self.camera, 7)

    def _depth(self, state: NetworkState) -> Floats:
        offset = self.point - state.centre[self.camera]
        return np.asarray(np.einsum("rm,rm->r", state.axis[self.camera], offset))

    def value(self, state: NetworkState) -> Floats:
        z, s = self._depth(state), state.focus[self.camera]
        return np.asarray(self.side * (z - s) - self.blur * (s - self.focal) * z)

    def jacobian(self, state: NetworkState) -> Floats:
        z, s = self._depth(state), state.focus[self.camera]
        by_depth = (self.side - self.blur * (s - self.focal))[:, None]
        offset = self.point - state.centre[self.camera]
        out = np.empty((self.rows, 7))
        slope = state.rotation_1[self.camera][:, :, 2, :]
        out[:, ANGLES] = by_depth * np.einsum("ram,rm->ra", slope, offset)
        out[:, POSITION] = -by_depth * state.axis[self.camera]
        out[:, FOCUS] = -self.side - self.blur * z
        return out

    def add_hessian(self, state: NetworkState, multipliers: Floats, out: Floats) -> None:
        for camera, rows in _by_camera(self.camera):
            offset = self.point[rows] - state.centre[camera]
            by_depth = self.side[rows] - self.blur[rows] * (state.focus[camera] - self.focal[rows])
            pull = np.zeros((len(rows), 3))
            pull[:, 2] = multipliers[rows] * by_depth
            _add_linear(out, state, camera, pull.sum(axis=0), pull.T @ offset)
            cross = -multipliers[rows] * self.blur[rows]
            at, focus = PER_CAMERA * camera, PER_CAMERA * camera + FOCUS
            mixed = np.empty(6)
            mixed[ANGLES] = state.rotation_1[camera][:, 2, :] @ (cross @ offset)
            mixed[POSITION] = -cross.sum() * state.axis[camera]
            out[at : at + 6, focus] += mixed
            out[focus, at : at + 6] += mixed


@dataclass(frozen=True, eq=False)
class MeanImageCoordinate(Block):
    """Eq 12: the mean of x/z or y/z (``component`` (m,) 0 or 1) over the points of the object.

    ``points`` (1,) holds one (p, 3) array for all rows.
    """

    camera: Ints
    component: Ints
    points: tuple[Floats, ...]

    @property
    def columns(self) -> Ints:
        return camera_columns(self.camera, 6)

    def _local(self, state: NetworkState, row: int) -> tuple[Floats, Floats, Floats]:
        """Weights (p,), arms (p, 3) and camera coordinates (p, 3) for one row."""
        offset = self.points[0] - state.centre[self.camera[row]]
        weight = np.full(len(offset), 1.0 / len(offset))
        return weight, offset, offset @ state.rotation[self.camera[row]].T

    def value(self, state: NetworkState) -> Floats:
        out = np.empty(self.rows)
        for row in range(self.rows):
            weight, _, p = self._local(state, row)
            out[row] = weight @ (p[:, self.component[row]] / p[:, 2])
        return out

    def _slope(self, row: int, weight: Floats, p: Floats) -> Floats:
        """Weighted derivative (q, 3) of the image coordinate by the camera coordinates."""
        c = self.component[row]
        slope = np.zeros_like(p)
        slope[:, c] = weight / p[:, 2]
        slope[:, 2] = -weight * p[:, c] / p[:, 2] ** 2
        return slope

    def jacobian(self, state: NetworkState) -> Floats:
        out = np.empty((self.rows, 6))
        for row in range(self.rows):
            k = self.camera[row]
            weight, offset, p = self._local(state, row)
            slope = self._slope(row, weight, p)
            out[row, ANGLES] = np.einsum("akm,km->a", state.rotation_1[k], slope.T @ offset)
            out[row, POSITION] = -slope.sum(axis=0) @ state.rotation[k]
        return out

    def add_hessian(self, state: NetworkState, multipliers: Floats, out: Floats) -> None:
        for k, rows in _by_camera(self.camera):
            rows = rows[multipliers[rows] != 0.0]
            if len(rows) == 0:
                continue
            # The rows of a camera are functions of the same points, so their weighted sum is one
            # function of them, here u x/z + v y/z.
            weight, offset, p = self._local(state, rows[0])
            slope = sum(multipliers[row] * self._slope(row, weight, p) for row in rows)
            pull = np.zeros(2)
            np.add.at(pull, self.component[rows], multipliers[rows])
            _add_linear(out, state, k, slope.sum(axis=0), slope.T @ offset)
            by_pose = np.empty((3, len(offset), 6))
            for axis in range(3):
                by_pose[axis, :, ANGLES] = offset @ state.rotation_1[k][:, axis].T
                by_pose[axis, :, POSITION] = -state.rotation[k][axis]
            depth, z = by_pose[2], p[:, 2]
            lead = pull[0] * by_pose[0] + pull[1] * by_pose[1]
            cross = (lead * (-weight / z**2)[:, None]).T @ depth
            own = (depth * (2.0 * weight * (p[:, :2] @ pull) / z**3)[:, None]).T @ depth
            at = slice(PER_CAMERA * k, PER_CAMERA * k + 6)
            out[at, at] += cross + cross.T + own


@dataclass(frozen=True, eq=False)
class LevelAxis(Block):
    """``R[axis, 2]``: how steeply an axis of the image rises, as a sine. ``camera``, ``axis`` (m,).

    Zero for the x axis (0) of a level camera and for the y axis (1) of one on its side.
    """

    camera: Ints
    axis: Ints

    @property
    def columns(self) -> Ints:
        return camera_columns(self.camera, 3)

    def value(self, state: NetworkState) -> Floats:
        return np.asarray(state.rotation[self.camera, self.axis, 2])

    def jacobian(self, state: NetworkState) -> Floats:
        return np.asarray(state.rotation_1[self.camera, :, self.axis, 2])

    def add_hessian(self, state: NetworkState, multipliers: Floats, out: Floats) -> None:
        bend = state.rotation_2[self.camera, :, :, self.axis, 2]
        scatter(out, self.columns, multipliers[:, None, None] * bend)


@dataclass(frozen=True, eq=False)
class MeanAxisIncidence(Block):
    """Eq 10 as the paper's Table 2 has it: the mean angle between the optical axis and the normals.

    One row per camera, in radians; ``normals`` (1,) holds one (p, 3) array for all rows.
    """

    camera: Ints
    normals: tuple[Floats, ...]

    @property
    def columns(self) -> Ints:
        return camera_columns(self.camera, 3)

    def _cosines(self, axis: Floats) -> Floats:
        # At exactly 0 degrees the angle has a kink; a hair's breadth beside it, a slope.
        limit = 1.0 - 1e-12
        return np.asarray(np.clip(-(self.normals[0] @ axis), -limit, limit))

    def value(self, state: NetworkState) -> Floats:
        return np.array([np.arccos(self._cosines(state.axis[k])).mean() for k in self.camera])

    def jacobian(self, state: NetworkState) -> Floats:
        out = np.empty((self.rows, 3))
        for row, k in enumerate(self.camera):
            cosine = self._cosines(state.axis[k])
            pull = (self.normals[0] / np.sqrt(1.0 - cosine**2)[:, None]).mean(axis=0)
            out[row] = state.rotation_1[k][:, 2, :] @ pull
        return out

    def add_hessian(self, state: NetworkState, multipliers: Floats, out: Floats) -> None:
        for row, k in enumerate(self.camera):
            cosine = self._cosines(state.axis[k])
            sine = np.sqrt(1.0 - cosine**2)
            slope = state.rotation_1[k][:, 2, :]
            share = multipliers[row] / len(cosine)
            pull = share * (self.normals[0] / sine[:, None]).sum(axis=0)
            turned = self.normals[0] @ slope.T
            bend = (turned * (-share * cosine / sine**3)[:, None]).T @ turned
            block = bend + np.einsum("abm,m->ab", state.rotation_2[k][:, :, 2, :], pull)
            scatter(out, camera_columns(np.array([k]), 3), block[None])
