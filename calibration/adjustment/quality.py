"""What a calibration says of itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.adjustment.camera import INTERIOR, POSE_NAMES, CalibratedCamera
from calibration.adjustment.components import Component
from calibration.adjustment.covariance import Covariance
from calibration.adjustment.datum import reach_mm
from calibration.adjustment.levenberg import Solution
from calibration.adjustment.network import Network
from calibration.adjustment.reliability import Reliability
from calibration.adjustment.residualgrid import residual_grid
from calibration.adjustment.result import (
    CameraQuality,
    Correlation,
    CrossValidation,
    LateView,
    WeakParameter,
)
from calibration.fieldcells import GRID, cells_of
from geometry.arrays import Floats
from geometry.camera import INTERIOR_NAMES

WEAK_PRIOR_SHARE = 0.5
STRONG_CORRELATION = 0.98
CROSS_VALIDATION_LIMIT = 2.0
COORDINATES_LIMIT = 1.5
COVERAGE_LIMIT = 0.3
OUTLIERS_LIMIT = 0.03
USUAL_REACH_MM = (150.0, 10_000.0)


@dataclass(frozen=True, eq=False)
class Judged:
    """What the judgement rests on."""

    cameras: tuple[CalibratedCamera, ...]
    target_ids: tuple[str, ...]
    network: Network
    solution: Solution
    covariance: Covariance
    reliability: Reliability
    components: tuple[Component, ...]
    rejected_by_camera: tuple[int, ...]


def camera_table(judged: Judged) -> tuple[CameraQuality, ...]:
    """One row for each camera."""
    return tuple(_camera_row(judged, k) for k in range(len(judged.cameras)))


def _camera_row(judged: Judged, k: int) -> CameraQuality:
    network, camera = judged.network, judged.cameras[k]
    rows = slice(network.camera_rows[k], network.camera_rows[k + 1])
    v = judged.solution.residuals.pixel[rows]
    factors = {c.name: c.factor for c in judged.components}
    sigma = np.sqrt(np.maximum(np.diag(judged.covariance.camera(k)), 0.0))
    bias = v.mean(axis=0)
    return CameraQuality(
        camera.name,
        len(v),
        judged.rejected_by_camera[k],
        float(np.sqrt(np.mean(v * v))),
        (float(bias[0]), float(bias[1])),
        factors[f"images/{camera.name}"],
        float(judged.reliability.redundancy[rows].mean()),
        _coverage(network.pixel[rows], camera.image_size_px),
        float(sigma[0]),
        float(np.sqrt(np.mean(sigma[1:3] ** 2))),
        float(np.sqrt(np.mean(sigma[INTERIOR : INTERIOR + 3] ** 2))),
        float(np.degrees(np.sqrt(np.mean(sigma[INTERIOR + 3 :] ** 2)))),
        residual_grid(network.pixel[rows], v, camera.image_size_px),
    )


def _coverage(pixels: Floats, size_px: tuple[int, int]) -> float:
    return len(cells_of(pixels, size_px)) / GRID**2


def weak_parameters(judged: Judged) -> tuple[WeakParameter, ...]:
    """Interior parameters that rest on their priors rather than on images."""
    sigma = judged.network.priors.interior_sigma
    out = []
    for k, camera in enumerate(judged.cameras):
        own = np.sqrt(np.maximum(np.diag(judged.covariance.camera(k)), 0.0))
        for j, name in enumerate(INTERIOR_NAMES):
            if 0.0 < sigma[k, j] < np.inf:
                share = float((own[j] / sigma[k, j]) ** 2)
                if share > WEAK_PRIOR_SHARE:
                    out.append(WeakParameter(camera.name, name, float(own[j]), min(share, 1.0)))
    return tuple(out)


def correlations(judged: Judged) -> tuple[Correlation, ...]:
    """Pairs of parameters of one camera that can hardly be told apart."""
    names, out = INTERIOR_NAMES + POSE_NAMES, []
    for k, camera in enumerate(judged.cameras):
        block = judged.covariance.camera(k)
        scale = np.sqrt(np.maximum(np.diag(block), 0.0))
        safe = np.where(scale > 0.0, scale, np.inf)
        value = block / np.outer(safe, safe)
        strong = np.argwhere(np.triu(np.abs(value) > STRONG_CORRELATION, 1))
        out += [Correlation(camera.name, names[a], names[b], float(value[a, b])) for a, b in strong]
    return tuple(out)


def warnings(
    judged: Judged,
    table: tuple[CameraQuality, ...],
    cross: CrossValidation | None,
    late: tuple[LateView, ...],
) -> tuple[str, ...]:
    """One sentence for each thing a user should know, the most important first."""
    out = []
    reach = reach_mm(judged.solution.state, judged.network)
    if not USUAL_REACH_MM[0] <= reach <= USUAL_REACH_MM[1]:
        out.append(
            f"The cameras come out {reach:.3g} mm from the targets: where that is not so, the "
            "sizes in the target set are not in millimetres."
        )
    if cross is not None and cross.ratio > CROSS_VALIDATION_LIMIT:
        out.append(
            f"Two halves of the images differ {cross.ratio:.1f} times as much as predicted: "
            "the camera model does not fit these lenses, or the targets moved."
        )
    if late:
        told = ", ".join(f"{v.camera} in {v.frame}" for v in late[:3])
        out.append(
            f"{len(late)} views were left out because their cameras exposed at another moment than "
            f"the others ({told}{', ...' if len(late) > 3 else ''}): check the synchronisation."
        )
    factors = {c.name: c for c in judged.components}
    nominal = factors["coordinates"]
    if nominal.significant and nominal.factor > COORDINATES_LIMIT:
        out.append(
            f"Targets differ from their nominal coordinates {nominal.factor:.1f} times as much "
            "as stated: the plate is bent, or printed at another scale."
        )
    lengths = factors["distances"]
    if lengths.redundancy > 0.5 and lengths.factor > 3.0:
        out.append(
            f"Measured distances disagree with the images {lengths.factor:.1f} times as much as "
            f"stated, {_worst_length(judged)}: check their lengths."
        )
    for row in table:
        out += _camera_warnings(row)
    weak = {w.camera: w.parameter for w in weak_parameters(judged) if w.parameter in ("cx", "cy")}
    if weak:
        out.append(
            f"The principal point of {', '.join(weak)} rests on its prior: long lenses leave it "
            "open, which does little harm as long as camera and lens stay together."
        )
    return tuple(out)


def _worst_length(judged: Judged) -> str:
    """The measured distance that fits worst, in words."""
    lengths, residual = judged.network.lengths, judged.solution.residuals.length_mm
    worst = int(np.argmax(np.abs(residual) / lengths.sigma_mm))
    ends = [judged.target_ids[int(k[worst])] for k in (lengths.first, lengths.second)]
    return f"most of all {ends[0]}-{ends[1]} by {residual[worst]:+.3f} mm"


def _camera_warnings(row: CameraQuality) -> list[str]:
    out = []
    if row.rejected > OUTLIERS_LIMIT * (row.points + row.rejected):
        share = row.rejected / (row.points + row.rejected)
        out.append(f"{share:.0%} of the image points of {row.name} were rejected as blunders.")
    if row.coverage < COVERAGE_LIMIT:
        out.append(
            f"Targets cover {row.coverage:.0%} of the image of {row.name}: its distortion is a "
            "guess beyond them."
        )
    return out
