"""Observations looked over before they are adjusted: what cannot work is said in one line."""

from __future__ import annotations

import numpy as np

from calibration.adjustment.finite import finite_rows
from calibration.adjustment.initialisation.views import Placements, View, is_planar, views_of
from calibration.observations import Observations
from common.errors import InputError
from geometry.arrays import Floats

LEAST_ROWS = 6


def inspect(observations: Observations) -> None:
    """Raises :class:`InputError` when no calibration can come of these observations."""
    if len(observations.cameras) < 2:
        raise InputError(
            "calibration-one-camera",
            f"there are images of {len(observations.cameras)} camera only",
            "give images of two cameras or more that see the same targets",
        )
    if len(observations.pixel) == 0:
        raise InputError(
            "calibration-no-targets",
            "no targets were found in any image",
            "check that the target set is the one in the images, and that they are sharp and lit",
        )
    counts = np.bincount(observations.camera, minlength=len(observations.cameras))
    for name, count in zip(observations.cameras, counts, strict=True):
        if count < LEAST_ROWS:
            raise InputError(
                "calibration-few-targets",
                f"camera {name!r} sees {count} targets in all",
                f"show it at least {LEAST_ROWS}, or leave its images out",
            )
    _inside(observations)
    _one_side(observations)


def _inside(observations: Observations) -> None:
    size = observations.image_size_px[observations.camera]
    outside = (observations.pixel < -0.5) | (observations.pixel > size - 0.5)
    bad = np.flatnonzero(outside.any(axis=1))
    if len(bad):
        x, y = observations.pixel[bad[0]]
        name = observations.cameras[int(observations.camera[bad[0]])]
        w, h = size[bad[0]]
        raise InputError(
            "calibration-pixel-outside",
            f"camera {name!r} has a target at ({x:.1f}, {y:.1f}) px, outside its {w} x {h} image",
            "give pixels of the full image, not of a crop or a smaller copy",
        )


def _one_side(observations: Observations) -> None:
    """A plate shows all cameras the same side; who sees the other has mirrored images."""
    nominal = np.concatenate([c.nominal_mm for c in observations.targets.carriers])
    votes = np.zeros((len(observations.targets.carriers), len(observations.cameras)))
    placements = Placements.of(observations)
    for view in views_of(observations, placements):
        carrier = int(placements.carrier[view.place])
        if not observations.targets.carriers[carrier].two_sided:
            votes[carrier, view.camera] += _side(view, observations, nominal)
    sides = np.sign(votes)
    for row in sides:
        seen = row != 0
        # Two cameras that differ could both be the mirrored one: the first is then named.
        minority = row == -np.sign(row.sum() or row[seen][-1] if seen.any() else 1.0)
        if seen.any() and minority.any():
            name = observations.cameras[int(np.flatnonzero(minority)[0])]
            raise InputError(
                "calibration-mirrored",
                f"camera {name!r} sees the targets mirrored against the other cameras",
                "switch mirroring off in its driver or its export, and take the images anew",
            )


def _side(view: View, observations: Observations, nominal: Floats) -> float:
    """+1 or -1: which side of a plate a view shows; 0 for what is not a plate."""
    points = nominal[observations.target[view.rows]]
    points = points[finite_rows(points)]
    if len(points) < 4 or len(points) < len(view.rows) or not is_planar(points):
        return 0.0
    centred = points - points.mean(axis=0)
    normal = np.linalg.svd(centred, full_matrices=True)[2][2]
    # A sign that all views of the plate share, whatever part of it they show.
    normal = normal * np.sign(normal[int(np.argmax(np.abs(normal)))])
    axes = np.linalg.svd(centred, full_matrices=False)[2][:2]
    axes = axes * np.array([[1.0], [np.sign(np.cross(axes[0], axes[1]) @ normal)]])
    pixels = observations.pixel[view.rows]
    affine = np.linalg.lstsq(centred @ axes.T, pixels - pixels.mean(axis=0), rcond=None)[0]
    return float(np.sign(np.linalg.det(affine)))
