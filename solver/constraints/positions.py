"""Rows about where cameras stand: stand-off, incidence, visibility cuts, base/height, spacing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats, Ints
from solver.constraints.base import Block, scatter
from solver.variables import PER_CAMERA, NetworkState


def position_columns(cameras: Ints) -> Ints:
    """Columns (m, 3) of the coordinates of each row's camera."""
    return np.asarray(PER_CAMERA * np.asarray(cameras)[:, None] + np.arange(3, 6))


def _unit(vectors: Floats) -> tuple[Floats, Floats]:
    # Two cameras may start on one spot; any direction then leads apart.
    length = np.maximum(np.linalg.norm(vectors, axis=1), 1e-9)
    return vectors / length[:, None], length


def _bending(direction: Floats, length: Floats) -> Floats:
    """Second derivative (m, 3, 3) of the length of a vector."""
    outer = direction[:, :, None] * direction[:, None, :]
    return np.asarray((np.eye(3) - outer) / length[:, None, None])


@dataclass(frozen=True, eq=False)
class PositionCones(Block):
    """``normal . (C - P) - opening |C - P|``, linear for ``opening`` 0.

    With ``opening = cos(limit)`` and P's normal it keeps the ray to C within the limit of
    incidence; with opening 0 and the normal of an occluder's tangent plane it keeps C above
    a visibility cut of P; with a zone's plane it keeps C on one side. ``camera`` (m,), ``point``,
    ``normal`` (m, 3), ``opening`` (m,).
    """

    camera: Ints
    point: Floats
    normal: Floats
    opening: Floats

    @property
    def columns(self) -> Ints:
        return position_columns(self.camera)

    def value(self, state: NetworkState) -> Floats:
        ray = state.centre[self.camera] - self.point
        _, length = _unit(ray)
        return np.asarray(np.einsum("rk,rk->r", self.normal, ray) - self.opening * length)

    def jacobian(self, state: NetworkState) -> Floats:
        direction, _ = _unit(state.centre[self.camera] - self.point)
        return np.asarray(self.normal - self.opening[:, None] * direction)

    def add_hessian(self, state: NetworkState, multipliers: Floats, out: Floats) -> None:
        direction, length = _unit(state.centre[self.camera] - self.point)
        bending = _bending(direction, length)
        scatter(out, self.columns, -(multipliers * self.opening)[:, None, None] * bending)


@dataclass(frozen=True, eq=False)
class PositionDistance(Block):
    """``|C - P|``: the stand-off. ``camera`` (m,), ``point`` (m, 3)."""

    camera: Ints
    point: Floats

    @property
    def columns(self) -> Ints:
        return position_columns(self.camera)

    def value(self, state: NetworkState) -> Floats:
        return np.asarray(np.linalg.norm(state.centre[self.camera] - self.point, axis=1))

    def jacobian(self, state: NetworkState) -> Floats:
        return _unit(state.centre[self.camera] - self.point)[0]

    def add_hessian(self, state: NetworkState, multipliers: Floats, out: Floats) -> None:
        bending = _bending(*_unit(state.centre[self.camera] - self.point))
        scatter(out, self.columns, multipliers[:, None, None] * bending)


@dataclass(frozen=True, eq=False)
class PositionCoordinate(Block):
    """``C[axis] - origin``: one coordinate of a camera. ``camera``, ``axis``, ``origin`` (m,)."""

    camera: Ints
    axis: Ints
    origin: Floats

    @property
    def columns(self) -> Ints:
        return np.asarray(PER_CAMERA * self.camera[:, None] + 3 + self.axis[:, None])

    def value(self, state: NetworkState) -> Floats:
        return np.asarray(state.centre[self.camera, self.axis] - self.origin)

    def jacobian(self, state: NetworkState) -> Floats:
        return np.ones((self.rows, 1))

    def add_hessian(self, state: NetworkState, multipliers: Floats, out: Floats) -> None:
        """Nothing: the row is linear."""


@dataclass(frozen=True, eq=False)
class BaseLength(Block):
    """Distance of two projection centres. ``first``, ``second`` (m,) cameras."""

    first: Ints
    second: Ints

    @property
    def columns(self) -> Ints:
        return np.hstack([position_columns(self.first), position_columns(self.second)])

    def value(self, state: NetworkState) -> Floats:
        return np.asarray(
            np.linalg.norm(state.centre[self.first] - state.centre[self.second], axis=1)
        )

    def jacobian(self, state: NetworkState) -> Floats:
        direction, _ = _unit(state.centre[self.first] - state.centre[self.second])
        return np.hstack([direction, -direction])

    def add_hessian(self, state: NetworkState, multipliers: Floats, out: Floats) -> None:
        bending = _bending(*_unit(state.centre[self.first] - state.centre[self.second]))
        scatter(out, self.columns, multipliers[:, None, None] * _opposed(bending))


def _opposed(bending: Floats) -> Floats:
    """(m, 6, 6) second derivative of a length by both its ends."""
    return np.block([[bending, -bending], [-bending, bending]])


@dataclass(frozen=True, eq=False)
class BaseHeightRatio(Block):
    """Eq 9: base over the mean distance of the two cameras from the object's centroid.

    ``first``, ``second`` (m,) cameras, ``centroid`` (m, 3).
    """

    first: Ints
    second: Ints
    centroid: Floats

    @property
    def columns(self) -> Ints:
        return np.hstack([position_columns(self.first), position_columns(self.second)])

    def _parts(self, state: NetworkState) -> tuple[Floats, ...]:
        base, length = _unit(state.centre[self.first] - state.centre[self.second])
        one, height_one = _unit(state.centre[self.first] - self.centroid)
        two, height_two = _unit(state.centre[self.second] - self.centroid)
        return base, length, one, height_one, two, height_two

    def value(self, state: NetworkState) -> Floats:
        _, length, _, height_one, _, height_two = self._parts(state)
        return np.asarray(2.0 * length / (height_one + height_two))

    def jacobian(self, state: NetworkState) -> Floats:
        base, length, one, height_one, two, height_two = self._parts(state)
        total = (height_one + height_two)[:, None]
        by_base, by_height = np.hstack([base, -base]), np.hstack([one, two])
        return np.asarray(2.0 * (by_base / total - length[:, None] * by_height / total**2))

    def add_hessian(self, state: NetworkState, multipliers: Floats, out: Floats) -> None:
        base, length, one, height_one, two, height_two = self._parts(state)
        total, b = (height_one + height_two)[:, None, None], length[:, None, None]
        by_base, by_height = np.hstack([base, -base]), np.hstack([one, two])
        mixed = by_base[:, :, None] * by_height[:, None, :]
        heights = np.zeros((self.rows, 6, 6))
        heights[:, :3, :3] = _bending(one, height_one)
        heights[:, 3:, 3:] = _bending(two, height_two)
        second = _opposed(_bending(base, length)) / total
        second -= (mixed + mixed.transpose(0, 2, 1)) / total**2 + b * heights / total**2
        second += 2.0 * b * by_height[:, :, None] * by_height[:, None, :] / total**3
        scatter(out, self.columns, 2.0 * multipliers[:, None, None] * second)
