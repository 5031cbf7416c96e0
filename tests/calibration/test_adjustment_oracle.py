"""The adjustment beside two others that share no line with it: Ceres with COLMAP's cost functions,
and SciPy's dense least squares with numeric derivatives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from synthetic_scenes import Scene, face_rig, stand

from calibration.adjustment.camera import INTERIOR, PER_CAMERA, CalibratedCamera, Interior
from calibration.adjustment.initialisation.finding import find_start
from calibration.adjustment.initialisation.resection import RigidTransform
from calibration.adjustment.levenberg import LossOptions, Solution, adjust
from calibration.adjustment.network import Network
from calibration.adjustment.options import FREE, CalibrationOptions, InteriorModel
from calibration.observations import TargetSet
from geometry.arrays import Floats

SIGMA_PX = 0.1
TARGET_SIGMA_MM = 0.05
EXACT = LossOptions(huber=1e6, tolerance=1e-12)
MODEL = InteriorModel(cx=FREE, cy=FREE, k1=FREE, k2=FREE, p1=0.0, p2=0.0, k3=0.0)


def scene() -> Scene:
    """Three cameras without tangential distortion and a stand whose coordinates are observed."""
    cameras = []
    for camera in face_rig(3):
        i = camera.interior
        terms = np.array([i.distortion[0], i.distortion[1], 0.0, 0.0, 0.0])
        cameras.append(
            replace(camera, interior=Interior(i.focal_length_px, i.principal_point_px, terms))
        )
    carrier, points = stand(16, 7, TARGET_SIGMA_MM)
    places = ((RigidTransform(np.eye(3), np.zeros(3)),),)
    return Scene(tuple(cameras), TargetSet("stand", (carrier,)), points, places)


def solved() -> tuple[Network, Solution]:
    """Ours, with the stand's frame held: its nominal coordinates are the datum."""
    given = scene()
    observations = given.observe(SIGMA_PX, 8)
    start = find_start(observations, CalibrationOptions(start=given.cameras, model=MODEL))
    network = replace(start.network, pose_sigma=np.zeros((1, 6)), datum=False)
    nominal = replace(
        start.state,
        position=np.zeros((1, 3)),
        attitude=np.eye(3)[None],
        target=network.priors.target,
    )
    return network, adjust(network, nominal, EXACT)


def parameters(solution: Solution) -> Floats:
    """f, cx, cy, k1, k2 and the centre of each camera, (n, 8)."""
    state = solution.state
    return np.concatenate([state.interior[:, :5], state.centre], axis=1)


def sigmas(solution: Solution) -> Floats:
    blocks = np.diag(solution.reduction.covariance().cameras).reshape(-1, PER_CAMERA)
    return np.sqrt(blocks[:, [0, 1, 2, 3, 4, INTERIOR, INTERIOR + 1, INTERIOR + 2]])


def test_ceres_finds_the_same_with_the_same_sigmas() -> None:
    pyceres = pytest.importorskip("pyceres")
    pycolmap = pytest.importorskip("pycolmap")
    import pycolmap.cost_functions as costs

    network, solution = solved()

    class UnitQuaternion(pyceres.CostFunction):
        """Keeps a raw quaternion at length 1; the wheel has no product of manifolds."""

        def __init__(self) -> None:
            pyceres.CostFunction.__init__(self)
            self.set_num_residuals(1)
            self.set_parameter_block_sizes([7])

        def Evaluate(self, blocks, residuals, jacobians) -> bool:  # noqa: ANN001, N802
            q = blocks[0][:4]
            residuals[0] = 1e8 * (q @ q - 1.0)
            if jacobians is not None and jacobians[0] is not None:
                jacobians[0][:] = np.concatenate([2e8 * q, np.zeros(3)])
            return True

    problem = pyceres.Problem()
    given = scene().cameras
    poses, interiors = [], []
    for camera in given:
        turn = camera.pose.rotation_rig_to_camera
        shift = -turn @ camera.pose.position_rig_mm
        poses.append(np.concatenate([Rotation.from_matrix(turn).as_quat(), shift]))
        i = camera.interior
        half = i.principal_point_px + 0.5  # COLMAP's pixels begin at the corner
        interiors.append(np.array([i.focal_length_px, *half, *i.distortion[:2]]))
    points = [p.copy() for p in network.priors.target]
    model, noise = pycolmap.CameraModelId.RADIAL, SIGMA_PX**2 * np.eye(2)
    for c, t, pixel in zip(
        network.observed.camera, network.observed.target, network.pixel, strict=True
    ):
        cost = costs.ReprojErrorCost(model, noise, pixel + 0.5)
        problem.add_residual_block(cost, None, [points[t], poses[c], interiors[c]])
    for k, point in enumerate(points):
        prior = pyceres.factors.NormalPrior(
            network.priors.target[k], TARGET_SIGMA_MM**2 * np.eye(3)
        )
        problem.add_residual_block(prior, None, [point])
    keepers = [UnitQuaternion() for _ in poses]
    for keeper, pose in zip(keepers, poses, strict=True):
        problem.add_residual_block(keeper, None, [pose])
    options, summary = pyceres.SolverOptions(), pyceres.SolverSummary()
    options.max_num_iterations = 200
    options.function_tolerance = 1e-15
    options.gradient_tolerance = 1e-12
    options.parameter_tolerance = 1e-14
    options.linear_solver_type = pyceres.LinearSolverType.DENSE_SCHUR
    pyceres.solve(options, problem, summary)
    theirs = []
    for pose, interior in zip(poses, interiors, strict=True):
        turn = Rotation.from_quat(pose[:4]).as_matrix()
        theirs.append([interior[0], *(interior[1:3] - 0.5), *interior[3:], *(-turn.T @ pose[4:])])
    # Both stop where chi-square is flat to 1e-9 or so, far below a thousandth of a sigma; theirs
    # gains a little from what slack the quaternions' lengths have.
    off = np.abs(parameters(solution) - np.array(theirs)) / sigmas(solution)
    assert off.max() < 1e-3
    assert 2.0 * summary.final_cost == pytest.approx(solution.cost, rel=1e-6)
    found = pyceres.Covariance(pyceres.CovarianceOptions())
    assert found.compute([(i, i) for i in interiors], problem)
    for k, interior in enumerate(interiors):
        block = found.get_covariance_block(interior, interior)
        np.testing.assert_allclose(np.sqrt(np.diag(block)), sigmas(solution)[k, :5], rtol=1e-4)


def project(camera: CalibratedCamera, values: Floats, points: Floats) -> Floats:
    """Pixels by SciPy's rotation and a plain formula: values f, cx, cy, k1, k2, C, turn."""
    turn = Rotation.from_rotvec(values[8:11]).as_matrix() @ camera.pose.rotation_rig_to_camera
    local = (points - values[5:8]) @ turn.T
    x = local[:, :2] / local[:, 2:]
    r2 = np.sum(x * x, axis=1, keepdims=True)
    return values[0] * x * (1.0 + values[3] * r2 + values[4] * r2 * r2) + values[1:3]


def test_dense_numeric_least_squares_finds_the_same() -> None:
    network, solution = solved()
    given = scene().cameras
    count, targets = len(given), network.target_count

    def residuals(x: Floats) -> Floats:
        cameras, points = x[: 11 * count].reshape(count, 11), x[11 * count :].reshape(targets, 3)
        parts = []
        for k, camera in enumerate(given):
            rows = slice(network.camera_rows[k], network.camera_rows[k + 1])
            image = project(camera, cameras[k], points[network.observed.target[rows]])
            parts.append(((network.pixel[rows] - image) / SIGMA_PX).ravel())
        parts.append(((points - network.priors.target) / TARGET_SIGMA_MM).ravel())
        return np.concatenate(parts)

    start = [
        np.concatenate([c.interior.vector[:5], c.pose.position_rig_mm, np.zeros(3)]) for c in given
    ]
    x0 = np.concatenate([*start, network.priors.target.ravel()])
    found = least_squares(
        residuals,
        x0,
        method="trf",
        x_scale="jac",
        jac="3-point",
        xtol=1e-14,
        ftol=1e-14,
        gtol=1e-10,
    )
    theirs = found.x[: 11 * count].reshape(count, 11)[:, :8]
    off = np.abs(parameters(solution) - theirs) / sigmas(solution)
    # Central differences leave 1e-9 of the derivatives, and so of the step, unknown.
    assert off.max() < 1e-3
    assert 2.0 * found.cost == pytest.approx(solution.cost, rel=1e-8)
    inverse = np.linalg.inv(found.jac.T @ found.jac)
    theirs_sigma = np.sqrt(np.diag(inverse)[: 11 * count]).reshape(count, 11)[:, :8]
    np.testing.assert_allclose(theirs_sigma, sigmas(solution), rtol=1e-4)
