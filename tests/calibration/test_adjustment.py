"""The bundle adjustment: its solution, its datum, its covariance, its tests of itself."""

from __future__ import annotations

from dataclasses import replace

import calibrations
import numpy as np
import pytest
from scipy.stats import chi2

from calibration.adjustment import (
    Calibration,
    CalibrationOptions,
    InteriorModel,
    ReferencePoses,
    calibrate,
)
from calibration.adjustment.build import Start
from calibration.adjustment.camera import INTERIOR, PER_CAMERA
from calibration.adjustment.datum import inner_constraints
from calibration.adjustment.initialisation.finding import find_start
from calibration.adjustment.levenberg import Solution, Stop, adjust
from calibration.adjustment.network import Network
from calibration.adjustment.reliability import DELTA0, reliability
from calibration.adjustment.state import State
from calibration.observations import Observations
from common.errors import CancelledError
from common.progress import Progress
from geometry.arrays import Floats

SCENE = calibrations.small_scene()


def started(observations: Observations, **options: object) -> Start:
    return find_start(observations, CalibrationOptions(start=SCENE.cameras, **options))


@pytest.fixture(scope="module")
def solved() -> tuple[Network, Solution]:
    start = started(SCENE.observe(0.1, 3))
    return start.network, adjust(start.network, start.state)


def dense_rows(network: Network, state: State) -> Floats:
    """All weighted partials as one dense matrix by central differences, nothing shared with the
    sparse ones: pixels, coordinates, distances, interiors."""
    from calibration.adjustment.normals import all_residuals

    core, targets = network.core_count, network.target_count

    def values(x: Floats) -> Floats:
        found = all_residuals(state.moved(x[:core], x[core:].reshape(targets, 3)), network)
        priors = network.priors
        finite = np.isfinite(priors.target_sigma) & (priors.target_sigma > 0)
        known = np.isfinite(priors.interior_sigma) & (priors.interior_sigma > 0)
        return np.concatenate(
            [
                (found.pixel / network.sigma_px).ravel(),
                (found.target[finite] / priors.target_sigma[finite]),
                (found.interior[known] / priors.interior_sigma[known]),
                found.length_mm / network.lengths.sigma_mm,
            ]
        )

    free = np.concatenate([network.core_free, network.target_free.ravel()])
    rows = np.zeros((len(values(np.zeros(len(free)))), len(free)))
    for column in np.flatnonzero(free):
        step = np.zeros(len(free))
        step[column] = 1e-5
        rows[:, column] = -(values(step) - values(-step)) / 2e-5
    return rows


def test_covariance_is_the_inverse_of_dense_normals_in_the_same_datum() -> None:
    cameras = SCENE.cameras[:3]
    few = replace(SCENE, cameras=cameras, places=(SCENE.places[0], SCENE.places[1][:2]))
    observations = few.observe(0.1, 3)
    keep = (observations.target % 4 == 0) | (observations.target < 8)
    start = find_start(observations.subset(np.flatnonzero(keep)), CalibrationOptions(start=cameras))
    solution = adjust(start.network, start.state)
    network, state = start.network, solution.state
    found = solution.reduction.covariance().joint()
    rows = dense_rows(network, state)
    constraint = np.zeros((rows.shape[1], 6))
    constraint[: network.core_count] = inner_constraints(state, network)
    scale = np.linalg.norm(rows, axis=0)
    scale[scale == 0.0] = 1.0
    bordered = np.zeros((rows.shape[1] + 6,) * 2)
    scaled = rows / scale
    bordered[:-6, :-6] = scaled.T @ scaled + np.diag((np.linalg.norm(rows, axis=0) == 0.0) * 1.0)
    bordered[:-6, -6:] = constraint / scale[:, None]
    size = np.abs(bordered[:-6, -6:]).max()
    bordered[:-6, -6:] /= size
    bordered[-6:, :-6] = bordered[:-6, -6:].T
    inverse = np.linalg.inv(bordered)[:-6, :-6] / np.outer(scale, scale)
    cameras_size = PER_CAMERA * 3
    pick = np.concatenate([np.arange(cameras_size), np.arange(network.core_count, rows.shape[1])])
    expected = inverse[np.ix_(pick, pick)]
    free = np.concatenate([network.core_free[:cameras_size], network.target_free.ravel()])
    expected = expected * free[:, None] * free
    sigma = np.sqrt(np.diag(expected)) + 1e-30
    # Central differences are good to 1e-8; the inverse multiplies that by its condition, 1e4.
    np.testing.assert_allclose(
        found / np.outer(sigma, sigma), expected / np.outer(sigma, sigma), atol=2e-3
    )


def test_the_free_datum_neither_moves_nor_turns_the_cameras(
    solved: tuple[Network, Solution],
) -> None:
    network, solution = solved
    constraint = inner_constraints(solution.state, network)
    core = solution.reduction.covariance().core[: network.core_count, : network.core_count]
    spread = np.sqrt(np.abs(np.diag(constraint.T @ core @ constraint)))
    largest = float(np.sqrt(np.diag(core)[INTERIOR : INTERIOR + 3].max()))
    # Zero but for rounding, beside the sigmas of single cameras.
    assert spread.max() < 1e-6 * largest


def test_redundancy_numbers_add_up_to_the_degrees_of_freedom(
    solved: tuple[Network, Solution],
) -> None:
    network, solution = solved
    covariance = solution.reduction.covariance()
    found = reliability(solution, covariance, network)
    priors = network.priors
    total = found.redundancy.sum()
    known = np.isfinite(priors.target_sigma) & (priors.target_sigma > 0)
    spread = np.einsum("maa->ma", covariance.targets())[known]
    total += np.sum(1.0 - spread / priors.target_sigma[known] ** 2)
    known = np.isfinite(priors.interior_sigma) & (priors.interior_sigma > 0)
    variances = np.diag(covariance.cameras).reshape(-1, PER_CAMERA)[:, :INTERIOR]
    total += np.sum(1.0 - variances[known] / priors.interior_sigma[known] ** 2)
    from calibration.adjustment.components import length_partials

    rows = length_partials(solution.state.target, network.lengths.first, network.lengths.second)
    nothing = np.zeros((len(rows), len(covariance.cameras)))
    lengths = np.diag(covariance.of_functions(nothing, rows))
    total += np.sum(1.0 - lengths / network.lengths.sigma_mm**2)
    # Points that the loss holds back count less, and not in whole numbers.
    loss = 2.0 * np.sum(1.0 - solution.weights)
    expected = network.observation_count - network.unknown_count
    assert total == pytest.approx(expected, abs=loss + 1e-3)


def test_chi_square_is_what_it_should_be(solved: tuple[Network, Solution]) -> None:
    network, solution = solved
    freedom = network.observation_count - network.unknown_count
    # Between the 0.01 % and the 99.99 % points of chi-square, less 1 % for Huber's lines.
    assert 0.99 * chi2.ppf(1e-4, freedom) < solution.cost < chi2.ppf(1 - 1e-4, freedom)
    assert solution.stop is Stop.CONVERGED


def test_a_blunder_is_found_named_and_left_out() -> None:
    observations = SCENE.observe(0.1, 4)
    pixel = observations.pixel.copy()
    bad = [100, 700]
    pixel[bad] += [[3.0, 0.0], [0.0, -40.0]]
    spoilt = replace(observations, pixel=pixel)
    found = calibrate(spoilt, CalibrationOptions(start=SCENE.cameras, cross_validate=False))
    assert found.residuals is not None
    assert sorted(found.residuals.rejected.tolist()) == bad
    clean = calibrate(
        observations.subset(np.setdiff1d(np.arange(len(pixel)), bad)),
        CalibrationOptions(start=SCENE.cameras, cross_validate=False),
    )
    for a, b in zip(found.cameras, clean.cameras, strict=True):
        np.testing.assert_allclose(a.interior.vector[:3], b.interior.vector[:3], atol=0.01)


def test_a_view_taken_at_another_moment_is_left_out_whole_and_named() -> None:
    place = SCENE.places[1][2]
    late = {
        (3, 2): replace(place, translation_mm=place.translation_mm + np.array([0.4, 0.2, -0.3]))
    }
    observations = replace(SCENE, seen_otherwise=late).observe(0.1, 12)
    found = calibrate(observations, CalibrationOptions(start=SCENE.cameras, cross_validate=False))
    assert [(v.camera, v.frame) for v in found.quality.late_views] == [("cam4", "frame3")]
    plate = observations.targets.carrier_of[observations.target] == 1
    own = plate & (observations.camera == 3) & (observations.frame == 2)
    assert found.quality.rejected == own.sum()
    assert "check the synchronisation" in found.quality.warnings[0]


def test_what_stands_still_is_never_taken_for_another_moment() -> None:
    observations = SCENE.observe(0.1, 12)
    own = (observations.targets.carrier_of[observations.target] == 0) & (observations.camera == 3)
    pixel = observations.pixel.copy()
    # Three sigmas and more off, one way or the other: as much as a late view's, point by point.
    pixel[own] += np.where(np.arange(own.sum())[:, None] % 2, 0.4, -0.4)
    spoilt = replace(observations, pixel=pixel)
    found = calibrate(spoilt, CalibrationOptions(start=SCENE.cameras, cross_validate=False))
    assert found.quality.late_views == ()
    assert not any("another moment" in words for words in found.quality.warnings)
    # The points are worse than stated, and that is what the camera's sigma says.
    sigma = sigmas_in_use(found, 0.1)
    assert sigma[3] > 1.5 * np.median(sigma)


def test_smallest_blunders_follow_baarda(solved: tuple[Network, Solution]) -> None:
    network, solution = solved
    found = reliability(solution, solution.reduction.covariance(), network)
    smallest = found.smallest_blunder_px(network.sigma_px)
    # At redundancy 1 a blunder of 4.13 sigma is found with 80 %; less redundancy needs more.
    assert smallest.min() >= DELTA0 * 0.1
    row = int(np.argmin(found.redundancy[:, 0]))
    expected = DELTA0 * 0.1 / np.sqrt(found.redundancy[row, 0])
    assert smallest[row, 0] == pytest.approx(expected)


def sigmas_in_use(found: Calibration, stated_px: float) -> np.ndarray:
    """Of an image point of each camera."""
    count = len(found.cameras)
    return found.noise.sigmas_px(np.full((count, 2), stated_px), np.arange(count))[:, 0]


def test_what_nobody_stated_is_added_to_all_points_alike() -> None:
    """Half the points are stated ten times as good; all are spoilt by as much."""
    observations = SCENE.observe(0.1, 8)
    stated = np.full_like(observations.sigma_px, 0.05)
    stated[::2] = 0.005
    found = calibrate(
        replace(observations, sigma_px=stated),
        CalibrationOptions(start=SCENE.cameras, cross_validate=False),
    )
    sharp, blunt = sigmas_in_use(found, 0.005), sigmas_in_use(found, 0.05)
    np.testing.assert_allclose(sharp, 0.1, rtol=0.2)
    assert (blunt / sharp < 1.3).all()
    right = calibrate(observations, CalibrationOptions(start=SCENE.cameras, cross_validate=False))
    sigmas = [np.sqrt(np.diag(c.covariance.cameras)[INTERIOR::PER_CAMERA]) for c in (found, right)]
    np.testing.assert_allclose(sigmas[0] / sigmas[1], 1.0, atol=0.15)


def test_a_wrong_stated_sigma_is_corrected() -> None:
    observations = SCENE.observe(0.1, 5)
    wrong = replace(observations, sigma_px=np.full_like(observations.sigma_px, 0.05))
    found = calibrate(wrong, CalibrationOptions(start=SCENE.cameras, cross_validate=False))
    # 2500 image points tell a sigma to 1.4 %; three of those, and Huber's share.
    np.testing.assert_allclose(sigmas_in_use(found, 0.05), 0.1, rtol=0.05)
    right = calibrate(observations, CalibrationOptions(start=SCENE.cameras, cross_validate=False))
    ratio = (
        np.diag(found.covariance.cameras)[INTERIOR::PER_CAMERA]
        / np.diag(right.covariance.cameras)[INTERIOR::PER_CAMERA]
    )
    np.testing.assert_allclose(ratio, 1.0, atol=0.15)


def test_one_noisy_camera_gets_a_sigma_of_its_own() -> None:
    observations = SCENE.observe(0.1, 6)
    rng = np.random.default_rng(7)
    noisy = observations.camera == 2
    pixel = observations.pixel.copy()
    pixel[noisy] += 0.3 * rng.normal(size=(int(noisy.sum()), 2))
    found = calibrate(
        replace(observations, pixel=pixel),
        CalibrationOptions(start=SCENE.cameras, cross_validate=False),
    )
    # Estimated once, while all cameras still have equal weights: a little low, never high.
    now = sigmas_in_use(found, 0.1)
    assert now[2] == pytest.approx(np.sqrt(0.1**2 + 0.3**2), rel=0.15)
    assert np.abs(np.delete(now, 2) / 0.1 - 1.0).max() < 0.1


def test_reference_poses_can_be_the_datum() -> None:
    observations = SCENE.observe(0.1, 8)
    options = CalibrationOptions(
        start=SCENE.cameras, reference_poses=ReferencePoses(0.5, 0.02), cross_validate=False
    )
    found = calibrate(observations, options)
    assert found.datum == "reference poses"
    for a, b in zip(found.cameras, SCENE.cameras, strict=True):
        away = np.linalg.norm(a.pose.position_rig_mm - b.pose.position_rig_mm)
        assert away < 3.0 * 0.5
    # Five cameras known to 0.5 mm each tell the frame to 0.5 / sqrt(5) = 0.22 mm at best.
    sigma = np.sqrt(np.trace(found.centre_covariance_mm2(0)) / 3.0)
    assert 0.1 < sigma < 0.5


def test_cross_validation_is_near_one_and_sees_a_model_that_does_not_fit() -> None:
    assert calibrations.small_reference().quality.cross_validation is not None
    ratio = calibrations.small_reference().quality.cross_validation.ratio
    # About 60 directions are compared: one in sqrt(120), doubled for what both halves share.
    assert 0.6 < ratio < 1.4
    observations = SCENE.observe(0.1, 9)
    # A frame whose pictures were taken while the rig sagged: the halves cannot agree.
    pixel = observations.pixel.copy()
    sag = (observations.frame % 2 == 1) & (observations.camera == 1)
    pixel[sag] += [1.0, 0.0]
    spoilt = replace(observations, pixel=pixel)
    found = calibrate(spoilt, CalibrationOptions(start=SCENE.cameras, rescale=False, reject=False))
    assert found.quality.cross_validation is not None
    assert found.quality.cross_validation.ratio > 2.0
    assert any("differ" in w for w in found.quality.warnings)


def test_parameters_held_by_the_model_stay_and_priors_that_bind_are_told() -> None:
    observations = SCENE.observe(0.1, 10)
    model = InteriorModel(cx=0.2, cy=0.2, k1=0.0, k2=0.0, p1=0.0, p2=0.0)
    found = calibrate(
        observations, CalibrationOptions(start=SCENE.cameras, model=model, cross_validate=False)
    )
    for a, b in zip(found.cameras, SCENE.cameras, strict=True):
        np.testing.assert_array_equal(a.interior.distortion, b.interior.distortion)
    weak = {(w.camera, w.parameter) for w in found.quality.weak}
    assert weak == {(c.name, p) for c in SCENE.cameras for p in ("cx", "cy")}
    assert any("principal point" in w for w in found.quality.warnings)


def test_progress_rises_and_cancel_stops() -> None:
    observations = SCENE.observe(0.1, 11)
    seen: list[Progress] = []
    calibrate(observations, CalibrationOptions(start=SCENE.cameras), seen.append)
    fractions = [p.fraction for p in seen]
    assert fractions == sorted(fractions)
    assert {"start", "adjustment"} <= {p.stage for p in seen}

    class Cancelled:
        def is_set(self) -> bool:
            return True

    with pytest.raises(CancelledError):
        calibrate(observations, CalibrationOptions(start=SCENE.cameras), cancel=Cancelled())


def test_lengths_and_their_sigmas() -> None:
    reference, truth = calibrations.small_reference(), SCENE.true_mm
    ids = reference.targets.ids
    length, sigma = reference.length_mm(ids[0], ids[5])
    expected = float(np.linalg.norm(truth[0] - truth[5]))
    assert abs(length - expected) < 4.0 * sigma
    assert 0.0 < sigma < 0.05
