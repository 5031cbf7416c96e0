"""Which camera took which folder of pictures, when most of them are in each other's places."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from calibration.adjustment.camera import Interior
from calibration.adjustment.finite import finite_rows
from calibration.adjustment.initialisation.resection import RigidTransform, placed_candidates
from calibration.check.epoch import Epoch
from geometry.arrays import Floats, Ints

LEAST_POINTS = 6

Placed = tuple[Floats, Floats]
"""A camera against a carrier: its rotation, carrier to camera, and its centre in the carrier."""


def folders_by_resection(epoch: Epoch) -> Ints | None:
    """The reference camera (n,) that took each camera's pictures, from one carrier that all see.

    Each camera is placed against the carrier; where they stand to each other is what the reference
    knows. None when no carrier is seen by all.
    """
    placed = _placed(epoch)
    if placed is None:
        return None
    reference = epoch.reference
    best: tuple[float, Ints] | None = None
    for rotation, centre in placed[0]:
        for turn, place in zip(reference.rotation, reference.centre, strict=True):
            # The first folder is taken to be this camera's: where then are the others?
            to_rig = turn.T @ rotation
            away = np.array(
                [
                    np.min(
                        [
                            np.linalg.norm(reference.centre - place - to_rig @ (c - centre), axis=1)
                            for _, c in choices
                        ],
                        axis=0,
                    )
                    for choices in placed
                ]
            )
            rows, columns = linear_sum_assignment(away)
            cost = float(away[rows, columns].sum())
            if best is None or cost < best[0]:
                best = cost, columns.astype(np.int64)
    return None if best is None else best[1]


def _placed(epoch: Epoch) -> list[list[Placed]] | None:
    """Each camera against the carrier that the camera which sees it worst sees best."""
    count = len(epoch.camera_names)
    seen = np.zeros((len(epoch.place_carrier), count), np.int64)
    np.add.at(seen, (epoch.place, epoch.camera), finite_rows(epoch.reference.target)[epoch.target])
    place = int(np.argmax(seen.min(axis=1)))
    if seen[place].min() < LEAST_POINTS:
        return None
    out = [_against(epoch, camera, place) for camera in range(count)]
    return out if all(out) else None


def _against(epoch: Epoch, camera: int, place: int) -> list[Placed]:
    rows = np.flatnonzero((epoch.camera == camera) & (epoch.place == place))
    rows = rows[finite_rows(epoch.reference.target[epoch.target[rows]])]
    rays = Interior.of(epoch.reference.interior[camera]).normalised(epoch.pixel[rows])
    good = finite_rows(rays)
    found = placed_candidates(epoch.reference.target[epoch.target[rows[good]]], rays[good])
    return [(one.rotation, _centre(one)) for one in found]


def _centre(placed: RigidTransform) -> Floats:
    return np.asarray(-placed.rotation.T @ placed.translation_mm)
