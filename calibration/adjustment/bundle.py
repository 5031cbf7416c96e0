"""Calibration: from observations to cameras, targets and their covariance."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calibration.adjustment.build import Start, some_rows
from calibration.adjustment.camera import CalibratedCamera
from calibration.adjustment.components import image_components, prior_components
from calibration.adjustment.covariance import Covariance
from calibration.adjustment.crossvalidation import cross_validate
from calibration.adjustment.finite import finite_rows
from calibration.adjustment.initialisation.finding import find_start
from calibration.adjustment.initialisation.views import ANY_FRAME
from calibration.adjustment.inspection import inspect
from calibration.adjustment.lensfit import judged_lenses, told_of_lens
from calibration.adjustment.levenberg import Solution, Stop, adjust
from calibration.adjustment.network import Network
from calibration.adjustment.noise import NoiseModel
from calibration.adjustment.options import CalibrationOptions
from calibration.adjustment.outliers import late_points, settle
from calibration.adjustment.plausibility import (
    lengths_must_agree,
    must_be_plausible,
    shown_too_little,
)
from calibration.adjustment.quality import (
    Judged,
    camera_table,
    correlations,
    warnings,
    weak_parameters,
)
from calibration.adjustment.reduction import SingularError
from calibration.adjustment.reliability import Reliability, reliability
from calibration.adjustment.repeats import repeats_are_told
from calibration.adjustment.result import (
    Calibration,
    CalibrationQuality,
    CarrierPose,
    LateView,
    ResidualTable,
)
from calibration.adjustment.stages import NEAR_DAMPING, adjust_in_stages
from calibration.observations import Observations
from common.errors import InputError
from common.progress import CancelToken, Progress, ProgressCallback, ignore_progress, within
from geometry.arrays import Bools, Ints

ROUNDS = 8
SETTLED = 0.01
"""Sigmas are settled when no camera's changes by more than this share."""


@dataclass(frozen=True, eq=False)
class _Adjusted:
    """An adjustment with its covariance and tests, and what was left out."""

    start: Start
    network: Network
    solution: Solution
    covariance: Covariance
    reliability: Reliability
    noise: NoiseModel
    rejected: Ints
    late: tuple[LateView, ...]
    iterations: int


def calibrate(
    observations: Observations,
    options: CalibrationOptions | None = None,
    progress: ProgressCallback = ignore_progress,
    cancel: CancelToken | None = None,
) -> Calibration:
    """Cameras, targets and carriers from one bundle adjustment of all observations.

    Starts from ``options.start`` or from nothing. Raises :class:`InputError` when the
    observations cannot be calibrated, and :class:`CancelledError`.
    """
    options = options or CalibrationOptions()
    inspect(observations)
    progress(Progress("start", 0.0))
    with repeats_are_told(observations):
        try:
            done = _calibrated(observations, options, progress, cancel)
        except InputError as error:
            raise told_of_lens(error, observations, options, _calibrated, cancel) from error
        return judged_lenses(done, observations, options, _calibrated, cancel)


def _calibrated(
    observations: Observations,
    options: CalibrationOptions,
    progress: ProgressCallback,
    cancel: CancelToken | None,
) -> Calibration:
    start = find_start(observations, options)
    if len(start.rows) == 0:
        raise InputError(
            "calibration-no-targets",
            "no target is seen by two cameras or belongs to a carrier that could be placed",
            "show the same targets to several cameras at once",
        )
    lengths_must_agree(observations, start)
    progress(Progress("start", 0.1))
    try:
        done = _adjusted(observations, start, options, progress, cancel)
    except SingularError as error:
        raise InputError(
            "calibration-undetermined",
            f"the images do not determine the calibration: {error}",
            "add images with the plate nearer, farther and tilted, or fix parameters of the model",
        ) from error
    must_be_plausible(observations, done.network, done.solution, done.covariance, options)
    return _result(observations, options, done)


def _adjusted(
    observations: Observations,
    start: Start,
    options: CalibrationOptions,
    progress: ProgressCallback,
    cancel: CancelToken | None,
) -> _Adjusted:
    """Adjusted, tested, and adjusted again until sigmas and blunders are settled."""
    network, state = start.network, start.state
    stated, rejected = network.sigma_px, np.empty(0, np.int64)
    noise, own = NoiseModel.stated(network.camera_count), False
    moving = start.placements.frame != ANY_FRAME
    solution = adjust_in_stages(
        network, state, options.loss, bool(options.start), within(progress, 0.1, 0.9), cancel
    )
    late: list[LateView] = []
    iterations, near = solution.iterations, replace(options.loss, damping=NEAR_DAMPING)
    for round_ in range(ROUNDS + 1):
        covariance = solution.reduction.covariance()
        found = reliability(solution, covariance, network)
        bad, change = settle(solution, network, found, options, not own, moving)
        stable = not (bad.any() or np.abs(change - 1.0).max() > SETTLED)
        if stable or round_ == ROUNDS or solution.stop is Stop.STUCK:
            break
        late += _views(observations, start, network, late_points(solution, network, moving) & bad)
        rejected = np.concatenate([rejected, start.rows[bad]])
        own = own or bool(np.ptp(change) > 0.0)
        noise = noise.changed(change, stated, network.observed.camera)
        network = replace(network, sigma_px=noise.sigmas_px(stated, network.observed.camera))
        network, stated = some_rows(network, ~bad), stated[~bad]
        start = replace(start, rows=start.rows[~bad])
        solution = adjust(network, solution.state, near, cancel=cancel)
        iterations += solution.iterations
    return _Adjusted(
        start, network, solution, covariance, found, noise, rejected, tuple(late), iterations
    )


def _views(
    observations: Observations, start: Start, network: Network, late: Bools
) -> list[LateView]:
    """Which views these points (n,) are of."""
    observed = network.observed
    pairs = np.unique(np.stack([observed.camera[late], observed.pose[late]], axis=1), axis=0)
    frames = start.placements.frame
    return [
        LateView(observations.cameras[int(c)], observations.frames[int(frames[p])])
        for c, p in pairs
    ]


def _result(
    observations: Observations, options: CalibrationOptions, done: _Adjusted
) -> Calibration:
    network, solution = done.network, done.solution
    sizes = tuple((int(w), int(h)) for w, h in observations.image_size_px)
    cameras = solution.state.cameras(observations.cameras, sizes)
    seen = np.bincount(network.observed.target, minlength=network.target_count) > 0
    seen |= finite_rows(network.priors.target_sigma) & (network.priors.target_sigma > 0.0).any(
        axis=1
    )
    return Calibration(
        cameras,
        observations.targets,
        np.where(seen[:, None], solution.state.target, np.nan),
        _places(observations, done),
        done.covariance,
        done.noise,
        "inner constraints on all cameras" if network.datum else "reference poses",
        _quality(observations, options, done, cameras),
        ResidualTable(done.start.rows, solution.residuals.pixel, done.reliability, done.rejected),
        observations.camera_blur_px(),
    )


def _places(observations: Observations, done: _Adjusted) -> tuple[CarrierPose, ...]:
    placements, state = done.start.placements, done.solution.state
    names = [c.name for c in observations.targets.carriers]
    return tuple(
        CarrierPose(
            names[int(placements.carrier[k])],
            None if placements.frame[k] < 0 else observations.frames[int(placements.frame[k])],
            state.position[k],
            state.attitude[k],
        )
        for k in np.unique(done.network.observed.pose)
    )


def _quality(
    observations: Observations,
    options: CalibrationOptions,
    done: _Adjusted,
    cameras: tuple[CalibratedCamera, ...],
) -> CalibrationQuality:
    network, solution = done.network, done.solution
    components = image_components(solution, network, done.reliability)
    components += prior_components(solution, network, done.covariance)
    lost = np.bincount(observations.camera[done.rejected], minlength=len(cameras))
    judged = Judged(
        cameras,
        observations.targets.ids,
        network,
        solution,
        done.covariance,
        done.reliability,
        components,
        tuple(int(v) for v in lost),
    )
    table = camera_table(judged)
    cross = None
    if options.cross_validate:
        frame = observations.frame[done.start.rows]
        cross = cross_validate(network, frame, solution.state, options.loss)
    pixels = solution.residuals.pixel
    return CalibrationQuality(
        solution.stop is Stop.CONVERGED,
        solution.stop,
        done.iterations,
        solution.cost,
        network.observation_count - network.unknown_count,
        float(np.sqrt(np.mean(pixels * pixels))),
        len(done.rejected),
        done.late,
        len(observations.pixel) - len(done.start.rows) - len(done.rejected),
        table,
        components,
        weak_parameters(judged),
        correlations(judged),
        cross,
        done.start.scale,
        shown_too_little(observations, cameras, table) + warnings(judged, table, cross, done.late),
    )
