"""Whether the model of the lenses fits them: where it seems not to, the others are tried."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from calibration.adjustment.options import NARROW, CalibrationOptions
from calibration.adjustment.result import Calibration, CameraQuality
from calibration.observations import Observations
from common.errors import InputError
from common.progress import CancelToken, ProgressCallback, ignore_progress
from geometry.arrays import Bools, Floats
from geometry.camera import LensModel

Calibrate = Callable[
    [Observations, CalibrationOptions, ProgressCallback, CancelToken | None], Calibration
]

RINGS = 8
SIGNIFICANT = 31.8
"""Chi-square of eight rings beyond which residuals lean outwards or inwards: chance 1e-4."""

LEAST_LEAN = 0.1
"""Nor is a lean looked into below this share of the scatter."""

LOST_SHARE = 0.03
CROSS_RATIO = 2.0

BETTER = 0.8
"""Another model fits where this share of the rms is left. A term that only takes up noise leaves
all but one in the number of points."""

ALIKE = 0.95

GOOD_RMS_PX = 1.0
OF_LENSES = {"calibration-interior", "calibration-no-fit", "calibration-not-joined"}
"""Errors by which pictures of a wide lens end under a model that cannot describe it."""


def judged_lenses(
    done: Calibration,
    observations: Observations,
    options: CalibrationOptions,
    calibrate: Calibrate,
    cancel: CancelToken | None,
) -> Calibration:
    """The calibration, with a warning where another lens model describes cameras better."""
    own = done.cameras[0].interior.lens_model
    if not _seems_unfit(done, observations):
        return done
    found: list[tuple[float, LensModel, tuple[str, ...]]] = []
    plainest = LensModel.FISHEYE
    for lens in LensModel:
        other = None if lens is own else _tried(observations, options, lens, calibrate, cancel)
        if other is None:
            continue
        names = tuple(
            a.name
            for a, b in zip(done.quality.cameras, other.quality.cameras, strict=True)
            if _better(a, b)
        )
        if names and other.quality.converged:
            found.append((other.quality.rms_px, lens, names))
    if not found:
        return done
    # Of two that fit alike the one with fewer terms.
    rms, lens, names = min(found, key=lambda f: f[0] * (ALIKE if f[1] is plainest else 1.0))
    told = (
        f"Do not use it: the {_word(own)} lens model does not fit {', '.join(names)} "
        f"({done.quality.rms_px:.2f} px and {done.quality.rejected} points left out, "
        f"{rms:.2f} px with the {_word(lens)} model). Calibrate with --model {_word(lens)}."
    )
    quality = replace(done.quality, warnings=(told, *done.quality.warnings), unfit_lenses=names)
    return replace(done, quality=quality)


def told_of_lens(
    error: InputError,
    observations: Observations,
    options: CalibrationOptions,
    calibrate: Calibrate,
    cancel: CancelToken | None,
) -> InputError:
    """The error, or where a fisheye fits the pictures another that says so."""
    if error.detail not in OF_LENSES or options.lens is LensModel.FISHEYE:
        return error
    other = _tried(observations, options, LensModel.FISHEYE, calibrate, cancel)
    if other is None or other.doubtful_lenses or other.quality.rms_px > GOOD_RMS_PX:
        return error
    if not other.quality.converged or any(map(_lost, other.quality.cameras)):
        return error
    return InputError(
        "calibration-lens-model",
        f"the {_word(options.lens or LensModel.BROWN)} lens model does not describe these lenses",
        f"calibrate with --model fisheye, which fits to {other.quality.rms_px:.2f} px",
    )


def _word(lens: LensModel) -> str:
    return lens.name.lower()


def _tried(
    observations: Observations,
    options: CalibrationOptions,
    lens: LensModel,
    calibrate: Calibrate,
    cancel: CancelToken | None,
) -> Calibration | None:
    wanted = replace(options, lens=lens, cross_validate=False)
    try:
        return calibrate(observations, wanted, ignore_progress, cancel)
    except InputError:
        return None  # the pictures do not determine such a lens


def _lost(row: CameraQuality) -> bool:
    return row.rejected > LOST_SHARE * (row.points + row.rejected)


def _better(own: CameraQuality, other: CameraQuality) -> bool:
    """Whether another model describes a camera better than its own."""
    if other.rms_px < BETTER * own.rms_px and other.rejected <= own.rejected:
        return True
    fewer = own.rejected - other.rejected > LOST_SHARE * (own.points + own.rejected)
    return fewer and other.rms_px < own.rms_px / BETTER


def _seems_unfit(done: Calibration, observations: Observations) -> bool:
    """Whether anything speaks against the model; wide lenses only, for others all models agree."""
    wide = [
        c.interior.focal_length_px * NARROW < np.hypot(*c.image_size_px) / 2.0 for c in done.cameras
    ]
    if not any(wide):
        return False
    cross = done.quality.cross_validation
    if cross is not None and cross.ratio > CROSS_RATIO:
        return True
    if any(w and _lost(row) for w, row in zip(wide, done.quality.cameras, strict=True)):
        return True
    return any(w and _leans(done, observations, k) for k, w in enumerate(wide))


def _leans(done: Calibration, observations: Observations, camera: int) -> bool:
    """Whether residuals of a camera point outwards or inwards by rings about its middle."""
    table = done.residuals
    if table is None:
        return False
    own: Bools = observations.camera[table.rows] == camera
    if own.sum() < 4 * RINGS:
        return False
    from_middle = (
        observations.pixel[table.rows[own]] - done.cameras[camera].interior.principal_point_px
    )
    radius = np.linalg.norm(from_middle, axis=1)
    outwards = from_middle / np.maximum(radius, 1e-9)[:, None]
    radial: Floats = np.einsum("ni,ni->n", table.residual_px[own], outwards)
    ring = np.argsort(np.argsort(radius)) * RINGS // len(radius)
    counts = np.bincount(ring, minlength=RINGS)
    means = np.bincount(ring, radial, minlength=RINGS) / counts
    scatter = 1.4826 * float(np.median(np.abs(radial - np.median(radial))))
    lean = float(np.sqrt(np.mean(means**2)))
    chi2 = float(np.sum(counts * means**2)) / max(scatter, 1e-12) ** 2
    return chi2 > SIGNIFICANT and lean > LEAST_LEAN * scatter
