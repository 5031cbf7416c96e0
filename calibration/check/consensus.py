"""Where the carriers stand, as most of the cameras see it: a start that gross faults survive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.adjustment.camera import Interior
from calibration.adjustment.finite import finite_rows
from calibration.adjustment.initialisation.rays import nearest_points
from calibration.adjustment.initialisation.resection import placed_candidates
from calibration.adjustment.model import project
from calibration.adjustment.rotations import similarity
from calibration.adjustment.state import State
from calibration.check.epoch import Epoch
from calibration.check.linear import sight_of
from geometry.arrays import Bools, Floats, Ints

ROUNDS = 6
LEAST_FOR_RESECTION = 4
FLOOR_PX = 0.5
"""Rays nearer than this are not told apart in quality."""


@dataclass(frozen=True, eq=False)
class Consensus:
    """What most of the cameras agree on.

    ``state`` has the carriers placed; ``found_mm`` (places, m, 3) are targets in the rig frame,
    NaN unseen; ``scale`` (places,) of each carrier against the reference, NaN where unknown.
    """

    state: State
    found_mm: Floats
    scale: Floats


def consensus(epoch: Epoch, assigned: Ints | None = None, among: Ints | None = None) -> Consensus:
    """Carriers placed by intersected targets, with little weight on rays that miss.

    ``assigned`` (n,): which reference camera took each camera's images, when not its own.
    ``among``: the cameras that are listened to, when not all.
    """
    reference, camera = epoch.reference, epoch.camera
    used = camera if assigned is None else assigned[camera]
    origins, directions = _rays(epoch, used)
    focal = reference.interior[used, 0]
    places, targets = len(epoch.place_carrier), len(epoch.target_names)
    heard = np.ones(len(used)) if among is None else np.isin(camera, among).astype(np.float64)
    weights = heard
    for _ in range(ROUNDS):
        points = nearest_points(origins, directions, epoch.points, places * targets, weights)
        residual = _miss_px(points[epoch.points] - origins, directions, focal)
        # Weights that fall with the distance make it the least sum of distances, not of squares.
        weights = heard / np.maximum(np.nan_to_num(residual, nan=1e6), FLOOR_PX)
    found = points.reshape(places, targets, 3)
    placed = [
        _placed(epoch, found, k)
        or _resected(epoch, used, heard, k)
        or (np.nan, np.eye(3), np.zeros(3))
        for k in range(places)
    ]
    position = np.stack([p[2] for p in placed])[epoch.view_place]
    attitude = np.stack([p[1] for p in placed])[epoch.view_place]
    state = reference.state(position, attitude)
    return Consensus(_taken_by(state, assigned), found, np.array([p[0] for p in placed]))


def _taken_by(state: State, assigned: Ints | None) -> State:
    if assigned is None:
        return state
    return State(
        state.interior[assigned],
        state.centre[assigned],
        state.rotation[assigned],
        state.position,
        state.attitude,
        state.target,
    )


def _rays(epoch: Epoch, used: Ints) -> tuple[Floats, Floats]:
    reference = epoch.reference
    directions = np.ones((len(used), 3))
    for k in np.unique(used):
        own = used == k
        directions[own, :2] = Interior.of(reference.interior[k]).normalised(epoch.pixel[own])
        directions[own] = directions[own] @ reference.rotation[k]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return reference.centre[used], directions


def _miss_px(offsets: Floats, directions: Floats, focal_px: Floats) -> Floats:
    along = np.einsum("ni,ni->n", offsets, directions)
    aside = np.linalg.norm(offsets - along[:, None] * directions, axis=1)
    return np.where(along > 0.0, aside / np.where(along > 0.0, along, 1.0) * focal_px, 1e6)


_Placed = tuple[float, Floats, Floats]


def _resected(epoch: Epoch, used: Ints, heard: Floats, place: int) -> _Placed | None:
    """Attitude and position of a carrier that one camera alone saw, by resection."""
    rows = np.flatnonzero(epoch.place == place)
    if not len(rows):
        return None
    rows = rows[heard[rows] > 0.0] if (heard[rows] > 0.0).any() else rows
    camera = int(np.bincount(used[rows]).argmax())
    own = rows[used[rows] == camera]
    reference = epoch.reference
    points = reference.target[epoch.target[own]]
    if len(own) < LEAST_FOR_RESECTION:
        return None
    image = Interior.of(reference.interior[camera]).normalised(epoch.pixel[own])
    found = placed_candidates(points, image)
    if not found:
        return None
    best = min(
        found, key=lambda p: float(np.nan_to_num(np.abs(p.image(points) - image), nan=9).sum())
    )
    turn = reference.rotation[camera].T
    return np.nan, turn @ best.rotation, turn @ best.translation_mm + reference.centre[camera]


def _placed(epoch: Epoch, found: Floats, place: int) -> _Placed | None:
    """Scale, attitude and position of one carrier, least moved by targets that do not fit."""
    own = epoch.target_carrier == epoch.place_carrier[place]
    own &= finite_rows(found[place])
    source, target = epoch.reference.target[own], found[place][own]
    if len(source) < 2:
        return None
    weights = np.ones(len(source))
    for _ in range(ROUNDS):
        scale, rotation, translation = similarity(source, target, scaled=True, weights=weights)
        residual = np.linalg.norm(scale * source @ rotation.T + translation - target, axis=1)
        weights = 1.0 / np.maximum(residual, 0.1 * max(float(np.median(residual)), 1e-6))
    if abs(scale - 1.0) < 0.5:
        # The place is that of the carrier in its known size; the scale is told beside it.
        _, rotation, translation = similarity(source, target, weights=weights)
    return scale, rotation, translation


def misfit_px(epoch: Epoch, state: State) -> Floats:
    """Distance (n,) of each image point from where the state puts it; huge behind a camera."""
    pixel, depth = project(state, sight_of(epoch))
    return np.where(depth > 0.0, np.linalg.norm(epoch.pixel - pixel, axis=1), 1e6)


def by_camera(epoch: Epoch, residual: Floats, reported: Bools | None = None) -> Floats:
    """Median misfit (n,) of each camera; 0 for those that saw nothing.

    ``told`` (rows,): the image points that count, when not all.
    """
    counted = np.ones(len(residual), bool) if reported is None else reported
    out = np.zeros(len(epoch.camera_names))
    for k in np.unique(epoch.camera[counted]):
        out[k] = np.median(residual[counted & (epoch.camera == k)])
    return out
