"""Observations sorted into views: what one camera saw of one placed carrier."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.observations import Observations
from geometry.arrays import Floats, Ints

ANY_FRAME = -1
"""Stands for the frame of a carrier that never moves."""

PLANAR = 1e-3
"""A carrier counts as plane when its third extent is below this share of its first."""


@dataclass(frozen=True, eq=False)
class Placements:
    """Carriers in their places: ``carrier`` and ``frame`` (k,), and of each row its place (n,)."""

    carrier: Ints
    frame: Ints
    of_row: Ints

    @classmethod
    def of(cls, observations: Observations) -> Placements:
        """The places that observations speak of; fixed carriers have one for all frames."""
        fixed = np.array([c.fixed for c in observations.targets.carriers])
        carrier = observations.targets.carrier_of[observations.target]
        frame = np.where(fixed[carrier], ANY_FRAME, observations.frame)
        pairs = np.stack([carrier, frame], axis=1)
        unique, rows = np.unique(pairs.reshape(-1, 2), axis=0, return_inverse=True)
        return cls(unique[:, 0], unique[:, 1], rows.reshape(-1).astype(np.int64))


@dataclass(frozen=True, eq=False)
class View:
    """``rows`` of the observations of one placed carrier by one camera, one row per target."""

    camera: int
    place: int
    rows: Ints


def views_of(observations: Observations, placements: Placements) -> tuple[View, ...]:
    """All views. Of a target seen in many frames of a fixed carrier the first row is taken."""
    keys = np.stack([observations.camera, placements.of_row, observations.target], axis=1)
    _, first = np.unique(keys.reshape(-1, 3), axis=0, return_index=True)
    camera, place = observations.camera[first], placements.of_row[first]
    order = np.lexsort((observations.target[first], place, camera))
    pair = camera[order] * (int(placements.of_row.max(initial=0)) + 1) + place[order]
    cuts = np.flatnonzero(np.diff(pair)) + 1
    groups = np.split(first[order], cuts) if len(order) else []
    return tuple(
        View(int(observations.camera[g[0]]), int(placements.of_row[g[0]]), g) for g in groups
    )


def nominal_points(observations: Observations) -> Floats:
    """Nominal coordinates (m, 3) of all targets, NaN where there are none."""
    return np.concatenate([c.nominal_mm for c in observations.targets.carriers])


def is_planar(points: Floats) -> bool:
    """Whether points (n, 3) lie in a plane, as a plate's do."""
    extents = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(extents[-1] < PLANAR * extents[0])


def spread_rank(points: Floats) -> int:
    """1 for points on a line, 2 in a plane, 3 in space; 0 for fewer than two points."""
    if len(points) < 2:
        return 0
    extents = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return int((extents > PLANAR * extents[0]).sum())
