"""What a check says of each camera, carrier and measured distance."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.optimize import brentq
from scipy.special import chdtrc, chndtr

from calibration.adjustment.camera import PER_CAMERA
from calibration.adjustment.reliability import DELTA0
from calibration.adjustment.residualgrid import residual_grid
from calibration.adjustment.result import Calibration
from calibration.check.changes import LOG10
from calibration.check.consensus import Consensus
from calibration.check.diagnosis import Diagnosis
from calibration.check.effects import Effects, sensitivity
from calibration.check.findings import scale_estimate
from calibration.check.hypotheses import ALPHA, NOISE_SHARE, Cause
from calibration.check.linear import Columns
from calibration.check.standing import Told, standing
from calibration.check.verdicts import CameraCheck, CarrierCheck, Finding, Kind, LengthCheck
from calibration.observations import Distance
from geometry.arrays import Bools, Floats

MAD = 1.4826


RAISED = 1.5
"""Light, distance and tilt of the targets alone make one day's pictures this much noisier than
another's. It costs accuracy, not truth: less is not worth a word."""


@dataclass(frozen=True, eq=False)
class Noise:
    """Scatter of each camera's image points against the stated one: ``factor``, ``p`` (n,)."""

    factor: Floats
    p: Floats

    def raised(self) -> Bools:
        """Which cameras scatter more than chance allows, and enough to matter, (n,)."""
        return np.asarray((self.p < ALPHA * NOISE_SHARE / len(self.p)) & (self.factor > RAISED))


def noise_of(diagnosis: Diagnosis) -> Noise:
    """What is left of the residuals when all findings are accounted for."""
    last, epoch = diagnosis.last, diagnosis.epoch
    left = 1.0 - np.clip(last.linear.leverage, 0.0, 1.0)
    count = len(epoch.camera_names)
    squares = np.bincount(epoch.camera, np.sum(last.v**2, axis=1), minlength=count)
    freedom = np.bincount(epoch.camera, left.sum(axis=1), minlength=count)
    safe = np.maximum(freedom, 1e-9)
    return Noise(
        np.where(freedom > 1.0, np.sqrt(squares / safe), 1.0),
        np.where(freedom > 1.0, chdtrc(safe, squares), 1.0),
    )


def camera_checks(
    diagnosis: Diagnosis, found: Effects, noise: Noise, hidden_limit_mm: float, told: Told
) -> tuple[CameraCheck, ...]:
    """One row for each camera of the reference, in agreement with what is told."""
    return tuple(
        _camera(diagnosis, found, noise, k, hidden_limit_mm, told)
        for k in range(len(diagnosis.epoch.camera_names))
    )


def _camera(
    diagnosis: Diagnosis, found: Effects, noise: Noise, k: int, hidden_limit_mm: float, told: Told
) -> CameraCheck:
    accepted = {h.cause for h in diagnosis.accepted if h.subject == k}
    # A camera that stands is shown without what others' changes did to it through the targets.
    blamed = diagnosis.nobody_stands or accepted & {Cause.POSE, Cause.LENS}
    shown = diagnosis.first if blamed else diagnosis.last
    epoch = shown.linear.epoch
    own = epoch.camera == k
    residual = shown.v * epoch.sigma_px
    mine = residual[own]
    pose, lens = _test(diagnosis, Cause.POSE, k), _test(diagnosis, Cause.LENS, k)
    sees = sensitivity(k, diagnosis.first.linear.spread, found, Columns.of(epoch))
    stands = standing(diagnosis, found, k, told, sees, hidden_limit_mm)
    mine = mine if len(mine) else np.full((1, 2), np.nan)
    return CameraCheck(
        epoch.camera_names[k],
        int(own.sum()),
        float(np.sqrt(np.mean(mine**2))),
        float(MAD * np.median(np.abs(mine - np.median(mine, axis=0)))),
        (float(mine[:, 0].mean()), float(mine[:, 1].mean())),
        float(noise.factor[k]),
        *pose,
        *lens,
        stands.effect_px,
        stands.effect_mm,
        sees,
        stands.verdict,
        stands.reason,
        residual_grid(epoch.pixel[own], residual[own], epoch.image_size_px[k]),
    )


def _test(diagnosis: Diagnosis, cause: Cause, subject: int) -> tuple[float, float, float]:
    """Statistic, limit and log10 p of a single hypothesis; NaN where there is none."""
    for k, h in enumerate(diagnosis.tests.hypotheses):
        if h.cause is cause and h.subject == subject:
            outcomes = diagnosis.outcomes
            return (
                float(outcomes.statistic[k]),
                diagnosis.tests.limit(k),
                float(outcomes.log_p[k] / LOG10),
            )
    return float("nan"), float("nan"), float("nan")


def carrier_checks(
    diagnosis: Diagnosis, reference: Calibration, alarms: tuple[Finding, ...]
) -> tuple[CarrierCheck, ...]:
    """One row for each carrier that was seen."""
    present = np.unique(diagnosis.epoch.place_carrier)
    return tuple(_carrier(diagnosis, reference, alarms, int(k)) for k in present)


def _carrier(
    diagnosis: Diagnosis, reference: Calibration, alarms: tuple[Finding, ...], k: int
) -> CarrierCheck:
    epoch, last = diagnosis.epoch, diagnosis.last
    own = epoch.place_carrier[epoch.place] == k
    residual = (last.v * epoch.sigma_px)[own]
    name = epoch.carrier_names[k]
    shape = _test(diagnosis, Cause.SHAPE, k)
    dof = next(
        (
            int(d)
            for h, d in zip(diagnosis.tests.hypotheses, diagnosis.tests.dof, strict=True)
            if h.cause is Cause.SHAPE and h.subject == k
        ),
        0,
    )
    scale, sigma = scale_estimate(diagnosis, Cause.SCALE, k)
    worst, statistic = _worst_target(diagnosis, k)
    about = [
        f.kind
        for f in alarms
        if name in f.subjects
        or any(
            epoch.target_carrier[epoch.target_names.index(s)] == k
            for s in f.subjects
            if s in epoch.target_names
        )
    ]
    kinds = (Kind.PRINT_SCALE, Kind.CARRIER_BENT, Kind.TARGET_MOVED, Kind.IDS_SWAPPED)
    return CarrierCheck(
        name,
        int(own.sum()),
        float(np.sqrt(np.mean(residual**2))) if own.any() else float("nan"),
        _shift_mm(diagnosis, reference, k),
        shape[0],
        dof,
        shape[2],
        1e6 * scale,
        1e6 * sigma,
        worst,
        statistic,
        next((kind for kind in about if kind in kinds), Kind.FINE),
    )


def _worst_target(diagnosis: Diagnosis, carrier: int) -> tuple[str, float]:
    epoch, best = diagnosis.epoch, ("", float("nan"))
    for k, h in enumerate(diagnosis.tests.hypotheses):
        if h.cause is Cause.TARGET and epoch.target_carrier[h.subject] == carrier:
            statistic = float(diagnosis.outcomes.statistic[k])
            if not statistic <= best[1]:
                best = epoch.target_names[h.subject], statistic
    return best


def _shift_mm(diagnosis: Diagnosis, reference: Calibration, carrier: int) -> float:
    """How far the middle of a standing carrier is from its place in the reference."""
    epoch, state = diagnosis.epoch, diagnosis.last.state
    place = np.flatnonzero((epoch.place_carrier == carrier) & ~epoch.moving)
    name = epoch.carrier_names[carrier]
    before = [p for p in reference.places if p.carrier == name and p.frame is None]
    if len(place) == 0 or not before:
        return float("nan")
    view = int(np.flatnonzero(epoch.view_place == place[0])[0])
    middle = epoch.reference.target[epoch.target_carrier == carrier].mean(axis=0)
    now = state.attitude[view] @ middle + state.position[view]
    then = before[0].rotation_carrier_to_rig @ middle + before[0].position_rig_mm
    return float(np.linalg.norm(now - then))


def length_checks(
    diagnosis: Diagnosis, found: Consensus, distances: tuple[Distance, ...], scale_sigma: float
) -> tuple[LengthCheck, ...]:
    """Measured distances against the intersected targets, each the mean over all its places."""
    epoch = diagnosis.epoch
    index = {name: k for k, name in enumerate(epoch.target_names)}
    spread = _point_spread(diagnosis)
    out = []
    for d in distances:
        if d.first not in index or d.second not in index:
            continue
        a, b = index[d.first], index[d.second]
        direction = found.found_mm[:, b] - found.found_mm[:, a]
        length = np.linalg.norm(direction, axis=1)
        seen = np.isfinite(length)
        if not seen.any():
            continue
        unit = direction[seen] / length[seen, None]
        both = spread[seen][:, a] + spread[seen][:, b]
        variance = np.einsum("pi,pij,pj->p", unit, both, unit).sum() / seen.sum() ** 2
        total = variance + d.sigma_mm**2 + (scale_sigma * d.length_mm) ** 2
        error = float(length[seen].mean() - d.length_mm)
        out.append(
            LengthCheck(d.first, d.second, d.length_mm, 1e3 * error, 1e3 * float(np.sqrt(total)))
        )
    return tuple(out)


def _point_spread(diagnosis: Diagnosis) -> Floats:
    """Covariance (places, targets, 3, 3) of intersected targets from image noise alone, mm^2."""
    linear = diagnosis.first.linear
    # Not the diagnosis's own: rows that are blunders were still in it at that time.
    epoch = linear.epoch
    places, targets = len(epoch.place_carrier), len(epoch.target_names)
    width = linear.design.indptr[1]
    by_shift = linear.design.data.reshape(-1, 2, width)[:, :, PER_CAMERA + 3 : PER_CAMERA + 6]
    normal = np.zeros((places * targets, 3, 3))
    np.add.at(normal, epoch.points, np.swapaxes(by_shift, 1, 2) @ by_shift)
    sizes = np.linalg.eigvalsh(normal)
    good = sizes[:, 0] > 1e-12 * np.maximum(sizes[:, 2], 1e-300)
    out = np.full_like(normal, np.nan)
    out[good] = np.linalg.inv(normal[good])
    return out.reshape(places, targets, 3, 3)


def power95_factor(diagnosis: Diagnosis) -> float:
    """How many sensitivities a movement needs to be reported in 95 % of checks."""
    poses = [k for k, h in enumerate(diagnosis.tests.hypotheses) if h.cause is Cause.POSE]
    return _factor_at(max(diagnosis.tests.limit(k) for k in poses))


@cache
def _factor_at(limit: float) -> float:
    """The factor for a limit of the pose test: checks of one rig share it."""
    noncentrality = brentq(lambda nc: 0.05 - chndtr(limit, 6, nc), 1.0, 1000.0)
    return float(np.sqrt(noncentrality) / DELTA0)
