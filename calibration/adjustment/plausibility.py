"""Adjusted networks that cannot be meant: no fit, wrong units, views that determine too little."""

from __future__ import annotations

import numpy as np

from calibration.adjustment.build import Start, camera_poses
from calibration.adjustment.camera import CalibratedCamera
from calibration.adjustment.covariance import Covariance
from calibration.adjustment.datum import reach_mm
from calibration.adjustment.initialisation.frame import centre_of
from calibration.adjustment.levenberg import Solution
from calibration.adjustment.network import Network
from calibration.adjustment.options import CalibrationOptions
from calibration.adjustment.repeats import alike_words, places_shown
from calibration.adjustment.result import CameraQuality, doubtful_lenses
from calibration.observations import Observations
from common.errors import InputError

WORST_RMS_SHARE = 0.01
"""Half the image points farther off than this share of the width is no fit of any kind."""

REACH_MM = (20.0, 100_000.0)
SIZE_RATIO = 2.0
LENGTH_SHARE = 0.1
FOCAL_SHARE = 0.1
UNITS = ((1000.0, "metres"), (10.0, "centimetres"), (25.4, "inches"))


def must_be_plausible(
    observations: Observations,
    network: Network,
    solution: Solution,
    covariance: Covariance,
    options: CalibrationOptions,
) -> None:
    """Raises a one-line :class:`InputError` when the result cannot be what was meant."""
    _fits(observations, network, solution)
    _sizes(network, solution, options, observations)
    _determined(observations, network, solution, covariance)


def shown_too_little(
    observations: Observations,
    cameras: tuple[CalibratedCamera, ...],
    table: tuple[CameraQuality, ...],
) -> tuple[str, ...]:
    """Sentences on lenses that the pictures leave open, and on captures that say nothing new."""
    out = []
    names = doubtful_lenses(cameras, table)
    if names:
        focal = {c.name: c.interior.focal_length_px for c in cameras}
        worst = max((row for row in table if row.name in names), key=lambda r: r.focal_sigma_px)
        out.append(
            f"Do not use it: the pictures leave open the focal length of {', '.join(names)} "
            f"({worst.name}: {focal[worst.name]:.0f} px with a sigma of "
            f"{worst.focal_sigma_px:.0f} px). Show the plate in ten places or more, tilted to 30 "
            "degrees, nearer and farther."
        )
    places = places_shown(observations)
    if places.few:
        out.append(
            f"{alike_words(places, observations)}: hold them elsewhere for each capture, "
            "tilted, nearer and farther."
        )
    return tuple(out)


def _fits(observations: Observations, network: Network, solution: Solution) -> None:
    residual = np.linalg.norm(solution.residuals.pixel, axis=1)
    rows = network.camera_rows
    for k, name in enumerate(observations.cameras):
        own = residual[rows[k] : rows[k + 1]]
        width = float(observations.image_size_px[k, 0])
        if len(own) and np.median(own) > WORST_RMS_SHARE * width:
            raise InputError(
                "calibration-no-fit",
                f"the images of camera {name!r} do not fit the targets: half its points are more "
                f"than {np.median(own):.0f} px off",
                "check that the target set is the one in the images, that no image is mirrored, "
                "and that all cameras fired together",
            )


def _unit(ratio: float) -> str:
    """The unit that a ratio of sizes speaks of, as part of a remedy."""
    for factor, name in UNITS:
        if 0.9 < ratio / factor < 1.1 or 0.9 < ratio * factor < 1.1:
            return f"; the ratio is that of {name} to millimetres"
    return ""


def lengths_must_agree(observations: Observations, start: Start) -> None:
    """Raises :class:`InputError` when a measured distance is far from what the start has there.

    Asked before the adjustment: that would bend everything until a wrong distance fits.
    """
    lengths, target = start.network.lengths, start.state.target
    ids = observations.targets.ids
    for a, b, length in zip(lengths.first, lengths.second, lengths.length_mm, strict=True):
        found = float(np.linalg.norm(target[b] - target[a]))
        if abs(found - length) > LENGTH_SHARE * min(found, float(length)):
            raise InputError(
                "calibration-units",
                f"the distance {ids[int(a)]}-{ids[int(b)]} is given as {length:g} mm but comes out "
                f"as {found:.4g} mm{_unit(found / float(length))}",
                "give all coordinates and distances in millimetres",
            )


def _sizes(
    network: Network, solution: Solution, options: CalibrationOptions, observations: Observations
) -> None:
    reach = reach_mm(solution.state, network)
    if not REACH_MM[0] < reach < REACH_MM[1]:
        raise InputError(
            "calibration-units",
            f"the cameras come out {reach:.3g} mm from the targets",
            "give target coordinates and distances in millimetres",
        )
    if not options.start:
        return
    given = {c.name: c for c in options.start}
    poses = camera_poses(tuple(given[n] for n in observations.cameras))
    theirs = np.stack([centre_of(poses[k]) for k in range(len(poses))])
    ours = solution.state.centre
    spread = [float(np.linalg.norm(c - c.mean(axis=0))) for c in (ours, theirs)]
    ratio = spread[0] / max(spread[1], 1e-9)
    if not 1.0 / SIZE_RATIO < ratio < SIZE_RATIO:
        raise InputError(
            "calibration-units",
            f"the rig comes out {ratio:.3g} times as large as its start{_unit(ratio)}",
            "give target coordinates in millimetres, or the start of this rig",
        )


def _determined(
    observations: Observations, network: Network, solution: Solution, covariance: Covariance
) -> None:
    for k, name in enumerate(observations.cameras):
        focal = float(solution.state.interior[k, 0])
        sigma = float(np.sqrt(max(covariance.camera(k)[0, 0], 0.0)))
        rows = slice(network.camera_rows[k], network.camera_rows[k + 1])
        if sigma > FOCAL_SHARE * focal and rows.stop > rows.start:
            raise InputError(
                "calibration-degenerate",
                f"the views do not determine the focal length of camera {name!r} "
                f"({focal:.0f} px with a sigma of {sigma:.0f} px)",
                "tilt the plate to 30 degrees and more, show it nearer and farther, or fix f",
            )
