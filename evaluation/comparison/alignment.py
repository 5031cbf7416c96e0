"""Putting a cloud onto its reference: only where the poses of the two are not known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from common.errors import InputError
from evaluation.comparison.distances import Reference, signed_distances
from geometry.arrays import Floats

MOST_STEPS = 60
STILL_MM = 1e-5
"""Below this movement of the farthest point nothing more is to be gained."""

KEPT_SHARE = 0.9
"""Share of the points that speak in each step: what is not on the reference must not pull."""

_MOST_POINTS = 20_000


@dataclass(frozen=True, eq=False)
class Alignment:
    """``moved = scale * rotation @ point + translation``; ``steps`` until it stood still.

    ``how`` is ``none`` or ``best-fit``; ``converged`` False where the steps ran out.
    """

    how: str
    rotation: Floats
    translation_mm: Floats
    scale: float = 1.0
    steps: int = 0
    converged: bool = True

    def apply(self, points_mm: Floats) -> Floats:
        """The points (N, 3) where the alignment puts them."""
        return np.asarray(self.scale * points_mm @ self.rotation.T + self.translation_mm)


def unaligned() -> Alignment:
    """The cloud stays where it is: poses are known."""
    return Alignment("none", np.eye(3), np.zeros(3))


def best_fit(points_mm: Floats, reference: Reference, *, with_scale: bool = False) -> Alignment:
    """The rigid motion (and scale on request) that puts the cloud onto the reference.

    Iterated closest points, point to plane, trimmed to the nearest 90 %. It starts where the
    cloud is: a cloud in another frame or unit must be brought near first.
    """
    if len(points_mm) < 20:
        raise InputError("cloud-small", "fewer than 20 points cannot be aligned", "give a cloud")
    step = max(1, len(points_mm) // _MOST_POINTS)
    sample = points_mm[::step]
    rotation, translation, scale = np.eye(3), np.zeros(3), 1.0
    for number in range(1, MOST_STEPS + 1):
        moved = scale * sample @ rotation.T + translation
        turn, shift, grow = _one_step(moved, reference, with_scale)
        rotation, scale = turn @ rotation, scale * grow
        translation = grow * turn @ translation + shift
        change = np.abs(scale * sample @ rotation.T + translation - moved).max()
        if change < STILL_MM:
            return Alignment("best-fit", rotation, translation, scale, number, True)
    return Alignment("best-fit", rotation, translation, scale, MOST_STEPS, False)


def _one_step(
    moved: Floats, reference: Reference, with_scale: bool
) -> tuple[Floats, Floats, float]:
    distance, closest = signed_distances(moved, reference)
    away = moved - closest
    normal = away / np.where(np.abs(distance) > 1e-12, distance, 1.0)[:, None]
    near = np.abs(distance) <= np.quantile(np.abs(distance), KEPT_SHARE)
    near &= np.linalg.norm(normal, axis=1) > 0.5
    if near.sum() < 7:
        return np.eye(3), np.zeros(3), 1.0
    middle = moved[near].mean(axis=0)
    arm, n = moved[near] - middle, normal[near]
    columns = [np.cross(arm, n), n]
    if with_scale:
        columns.append(np.einsum("ij,ij->i", arm, n)[:, None])
    answer = np.linalg.lstsq(np.hstack(columns), -distance[near], rcond=None)[0]
    turn = Rotation.from_rotvec(answer[:3]).as_matrix()
    grow = 1.0 + float(answer[6]) if with_scale else 1.0
    return turn, middle + answer[3:6] - grow * turn @ middle, grow
