"""Rows about bodies: zones, collisions, and neighbours that stand in a view.

A body is covered by spheres fixed to its camera; the centre of one is ``u = C + R' o`` with the
offset o in the camera frame. A sphere cover is a little larger than the body, so rows that
hold keep the real bodies apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats, Ints
from solver.constraints.base import Block, camera_columns, scatter
from solver.variables import ANGLES, POSITION, NetworkState


def carried(state: NetworkState, camera: Ints, offset: Floats) -> Floats:
    """Rig positions (m, 3) of points fixed to cameras."""
    turned = np.einsum("rkm,rk->rm", state.rotation[camera], offset)
    return np.asarray(state.centre[camera] + turned)


def _carried_1(state: NetworkState, camera: Ints, offset: Floats) -> Floats:
    """Derivatives (m, 3, 6) of :func:`carried` by the camera's pose."""
    out = np.empty((len(camera), 3, 6))
    out[:, :, ANGLES] = np.einsum("rakm,rk->rma", state.rotation_1[camera], offset)
    out[:, :, POSITION] = np.eye(3)
    return out


def _carried_2(state: NetworkState, camera: Ints, offset: Floats, pull: Floats) -> Floats:
    """``pull . second derivative`` of :func:`carried`, (m, 6, 6); only angles bend it."""
    out = np.zeros((len(camera), 6, 6))
    out[:, :3, :3] = np.einsum("rabkm,rk,rm->rab", state.rotation_2[camera], offset, pull)
    return out


@dataclass(frozen=True, eq=False)
class BodyPlanes(Block):
    """``normal . u``: a sphere against a plane of the rig frame. ``normal`` (m, 3)."""

    camera: Ints
    offset: Floats
    normal: Floats

    @property
    def columns(self) -> Ints:
        return camera_columns(self.camera, 6)

    def value(self, state: NetworkState) -> Floats:
        return np.asarray(
            np.einsum("rm,rm->r", self.normal, carried(state, self.camera, self.offset))
        )

    def jacobian(self, state: NetworkState) -> Floats:
        return np.asarray(
            np.einsum("rm,rmc->rc", self.normal, _carried_1(state, self.camera, self.offset))
        )

    def add_hessian(self, state: NetworkState, multipliers: Floats, out: Floats) -> None:
        pull = multipliers[:, None] * self.normal
        scatter(out, self.columns, _carried_2(state, self.camera, self.offset, pull))


@dataclass(frozen=True, eq=False)
class BodyDistance(Block):
    """``|u - q|``: a sphere's centre from a fixed point ``point`` (m, 3)."""

    camera: Ints
    offset: Floats
    point: Floats

    @property
    def columns(self) -> Ints:
        return camera_columns(self.camera, 6)

    def _gap(self, state: NetworkState) -> tuple[Floats, Floats]:
        gap = carried(state, self.camera, self.offset) - self.point
        length = np.maximum(np.linalg.norm(gap, axis=1), 1e-12)
        return gap / length[:, None], length

    def value(self, state: NetworkState) -> Floats:
        return self._gap(state)[1]

    def jacobian(self, state: NetworkState) -> Floats:
        direction, _ = self._gap(state)
        return np.asarray(
            np.einsum("rm,rmc->rc", direction, _carried_1(state, self.camera, self.offset))
        )

    def add_hessian(self, state: NetworkState, multipliers: Floats, out: Floats) -> None:
        direction, length = self._gap(state)
        slope = _carried_1(state, self.camera, self.offset)
        along = np.einsum("rm,rmc->rc", direction, slope)
        bend = np.einsum("rmc,rmd->rcd", slope, slope) - along[:, :, None] * along[:, None, :]
        bend *= (multipliers / length)[:, None, None]
        pull = multipliers[:, None] * direction
        scatter(out, self.columns, bend + _carried_2(state, self.camera, self.offset, pull))


@dataclass(frozen=True, eq=False)
class BodyPairs(Block):
    """``|u - v|``: distance of the centres of two spheres of different cameras."""

    first: Ints
    second: Ints
    first_offset: Floats
    second_offset: Floats

    @property
    def columns(self) -> Ints:
        return np.hstack([camera_columns(self.first, 6), camera_columns(self.second, 6)])

    def _gap(self, state: NetworkState) -> tuple[Floats, Floats]:
        gap = carried(state, self.first, self.first_offset) - carried(
            state, self.second, self.second_offset
        )
        length = np.maximum(np.linalg.norm(gap, axis=1), 1e-12)
        return gap / length[:, None], length

    def value(self, state: NetworkState) -> Floats:
        return self._gap(state)[1]

    def _slope(self, state: NetworkState) -> Floats:
        one = _carried_1(state, self.first, self.first_offset)
        return np.concatenate([one, -_carried_1(state, self.second, self.second_offset)], axis=2)

    def jacobian(self, state: NetworkState) -> Floats:
        direction, _ = self._gap(state)
        return np.asarray(np.einsum("rm,rmc->rc", direction, self._slope(state)))

    def add_hessian(self, state: NetworkState, multipliers: Floats, out: Floats) -> None:
        direction, length = self._gap(state)
        slope = self._slope(state)
        along = np.einsum("rm,rmc->rc", direction, slope)
        bend = np.einsum("rmc,rmd->rcd", slope, slope) - along[:, :, None] * along[:, None, :]
        bend *= (multipliers / length)[:, None, None]
        pull = multipliers[:, None] * direction
        bend[:, :6, :6] += _carried_2(state, self.first, self.first_offset, pull)
        bend[:, 6:, 6:] -= _carried_2(state, self.second, self.second_offset, pull)
        scatter(out, self.columns, bend)


@dataclass(frozen=True, eq=False)
class ViewPlanes(Block):
    """``normal . R (u - C)``: a neighbour's sphere against a side of a camera's view.

    ``camera`` (m,) looks, ``other`` (m,) carries the sphere at ``offset`` (m, 3); ``normal``
    (m, 3) points out of the view, in the frame of the camera that looks.
    """

    camera: Ints
    other: Ints
    offset: Floats
    normal: Floats

    @property
    def columns(self) -> Ints:
        return np.hstack([camera_columns(self.camera, 6), camera_columns(self.other, 6)])

    def _arm(self, state: NetworkState) -> Floats:
        return carried(state, self.other, self.offset) - state.centre[self.camera]

    def _turned(self, state: NetworkState) -> tuple[Floats, Floats]:
        """The normal in the rig frame (m, 3) and its derivatives (m, 3 angles, 3)."""
        world = np.einsum("rk,rkm->rm", self.normal, state.rotation[self.camera])
        return world, np.einsum("rk,rakm->ram", self.normal, state.rotation_1[self.camera])

    def value(self, state: NetworkState) -> Floats:
        return np.asarray(np.einsum("rm,rm->r", self._turned(state)[0], self._arm(state)))

    def jacobian(self, state: NetworkState) -> Floats:
        world, turned = self._turned(state)
        out = np.empty((self.rows, 12))
        out[:, 0:3] = np.einsum("ram,rm->ra", turned, self._arm(state))
        out[:, 3:6] = -world
        out[:, 6:] = np.einsum("rm,rmc->rc", world, _carried_1(state, self.other, self.offset))
        return out

    def add_hessian(self, state: NetworkState, multipliers: Floats, out: Floats) -> None:
        world, turned = self._turned(state)
        slope = _carried_1(state, self.other, self.offset)
        bend = np.zeros((self.rows, 12, 12))
        bend[:, :3, :3] = np.einsum(
            "rabkm,rk,rm->rab", state.rotation_2[self.camera], self.normal, self._arm(state)
        )
        bend[:, :3, 3:6] = -turned
        bend[:, :3, 6:] = np.einsum("ram,rmc->rac", turned, slope)
        bend[:, 3:, :3] = bend[:, :3, 3:].transpose(0, 2, 1)
        bend[:, 6:, 6:] = _carried_2(state, self.other, self.offset, world)
        scatter(out, self.columns, multipliers[:, None, None] * bend)
