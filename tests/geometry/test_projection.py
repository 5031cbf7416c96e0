"""Projection beside OpenCV, its partials beside differences, and its inverse up to the fold."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from common.errors import InputError
from geometry.arrays import Floats
from geometry.camera import (
    NO_DISTORTION,
    Body,
    Camera,
    distort,
    distort_partials,
    fold_radius,
    interior_vector,
    perspective,
    perspective_partials,
    project,
    project_partials,
    undistort,
)
from geometry.frames import Pose

TERMS = np.array([-0.21, 0.09, 1.2e-3, -2.1e-3, 0.03])
BARREL = np.array([-0.2, 0.0, 0.0, 0.0, 0.0])
PINCUSHION = np.array([0.3, 0.1, 0.0, 0.0, 0.05])
RATIONAL = np.array([1.2, -0.3, 8e-4, -6e-4, 0.02, 1.5, 0.1, -0.01])
FISHEYE = np.array([-0.03, 0.012, -0.006, 0.0009])
LENSES = [
    *(TERMS, BARREL, PINCUSHION, np.array([-0.3, 0.1, 2e-3, 1e-3, -0.02])),
    *(RATIONAL, FISHEYE, np.zeros(4)),
]


def opencvs(points_camera_mm: Floats, matrix: Floats, distortion: Floats) -> Floats:
    """OpenCV's pixels (n, 2) of points in the camera frame."""
    nowhere, given = np.zeros(3), np.ascontiguousarray(points_camera_mm)
    if len(distortion) == 4:
        found = cv2.fisheye.projectPoints(given[:, None], nowhere, nowhere, matrix, distortion)
    else:
        found = cv2.projectPoints(given, nowhere, nowhere, matrix, distortion)
    return np.asarray(found[0]).reshape(-1, 2)


def points(seed: int = 1, count: int = 40) -> Floats:
    """Points of the camera frame up to 31 degrees off the axis."""
    rng = np.random.default_rng(seed)
    depth = rng.uniform(500.0, 1500.0, count)
    return np.column_stack([rng.uniform(-0.6, 0.6, (count, 2)) * depth[:, None], depth])


def turned(vector: Floats) -> Floats:
    return np.asarray(cv2.Rodrigues(vector)[0])


def camera(distortion: Floats, pitch_mm: float = 0.01) -> Camera:
    body = Body(np.full(3, 50.0), np.array([0.0, 0.0, -30.0]))
    return Camera("a", (1200, 800), pitch_mm, 12.0, 8.0, 0.01, 100.0, body, distortion=distortion)


@pytest.mark.parametrize("distortion", LENSES)
def test_pixels_are_opencvs(distortion: Floats) -> None:
    kind, turn = camera(distortion), np.array([0.3, -0.2, 1.1])
    pose = Pose(np.array([30.0, -20.0, 10.0]), turned(turn))
    seen = pose.to_rig(points())
    theirs = opencvs(pose.to_camera(seen), kind.camera_matrix, distortion)
    pixels, depth = kind.project(pose, seen)
    # Pixels of a few hundred, computed by another order of the same dozen operations.
    np.testing.assert_allclose(pixels, theirs, atol=1e-9)
    np.testing.assert_allclose(depth, points()[:, 2])
    interior = interior_vector(kind.focal_length_px, kind.principal_point_px, distortion)
    np.testing.assert_allclose(project(pose.to_camera(seen), interior)[0], theirs, atol=1e-9)


@pytest.mark.parametrize("distortion", LENSES)
def test_partials_agree_with_central_differences(distortion: Floats) -> None:
    interior = interior_vector(1500.0, np.array([640.0, 480.0]), distortion, 2e-3)
    rotation, centre = turned(np.array([0.3, -0.2, 1.1])), np.array([30.0, -20.0, 10.0])
    local = points()
    rig = local @ rotation + centre

    def pixels(change: Floats) -> Floats:
        """Of changes by the point, the centre, the turn and the interior: 3 + 3 + 3 + 12."""
        moved = rig + change[:3] - centre - change[3:6]
        own = moved @ (turned(change[6:9]) @ rotation).T
        return project(own, interior + np.append(change[9:], 0.0))[0]

    parts = project_partials(local, rotation, interior)
    # The last is the number of the lens model, which is no quantity.
    assert not parts.by_interior[..., -1].any()
    closed = np.concatenate([parts.by_point, parts.by_pose, parts.by_interior[..., :-1]], axis=-1)
    for column in range(21):
        # Steps that move the image by about a pixel: the cubic term of a difference is then
        # below 1e-6 of the derivative, rounding (1e-13 px) below 1e-9 of it.
        step = 3e-4 if 6 <= column < 9 else 1e-4 if column >= 12 else 1e-1
        change = np.zeros(21)
        change[column] = step
        numeric = (pixels(change) - pixels(-change)) / (2.0 * step)
        scale = max(np.abs(numeric).max(), 1e-9)
        np.testing.assert_allclose(closed[..., column] / scale, numeric / scale, atol=2e-6)
    np.testing.assert_allclose(parts.by_point, parts.by_point_camera @ rotation)
    np.testing.assert_allclose(parts.pixels, pixels(np.zeros(21)), rtol=1e-13)


def test_one_interior_for_each_point_is_the_same_as_one_at_a_time() -> None:
    local, rng = points(count=6), np.random.default_rng(2)
    lenses = [TERMS, RATIONAL, FISHEYE, BARREL, np.zeros(4), PINCUSHION]
    interiors = np.stack([interior_vector(1500.0, np.array([640.0, 480.0]), k) for k in lenses])
    rotations = np.stack([turned(v) for v in rng.normal(size=(6, 3))])
    together = project_partials(local, rotations, interiors)
    for k in range(6):
        alone = project_partials(local[k], rotations[k], interiors[k])
        np.testing.assert_allclose(together.pixels[k], alone.pixels, rtol=1e-14)
        np.testing.assert_allclose(together.by_pose[k], alone.by_pose, rtol=1e-12)
        np.testing.assert_allclose(together.by_interior[k], alone.by_interior, rtol=1e-12)


def test_perspective_partials_are_those_of_a_camera_of_unit_focal_length() -> None:
    plain = project_partials(points(), np.eye(3), interior_vector(1.0, np.zeros(2)))
    np.testing.assert_allclose(perspective_partials(points()), plain.by_point_camera, rtol=1e-13)
    np.testing.assert_allclose(perspective(points()), plain.pixels, rtol=1e-13)
    behind = perspective(np.array([[1.0, 2.0, 0.0], [1.0, 2.0, -5.0]]))
    assert np.isnan(behind).all()


def test_opencvs_partials_agree() -> None:
    kind, turn = camera(TERMS), np.array([0.3, -0.2, 1.1])
    rotation = turned(turn)
    _, theirs = cv2.projectPoints(points() @ rotation, turn, np.zeros(3), kind.camera_matrix, TERMS)
    interior = interior_vector(kind.focal_length_px, kind.principal_point_px, TERMS)
    parts = project_partials(points(), rotation, interior)
    theirs = theirs.reshape(-1, 2, theirs.shape[1])
    # Their translation is that of the camera frame; columns 8, 9 are the principal point.
    np.testing.assert_allclose(theirs[..., 3:6], parts.by_point_camera, atol=1e-9)
    np.testing.assert_allclose(theirs[..., 6] + theirs[..., 7], parts.by_interior[..., 0])
    np.testing.assert_allclose(theirs[..., 10:15], parts.by_interior[..., 3:8], rtol=1e-9)


@pytest.mark.parametrize("distortion", LENSES)
def test_the_inverse_holds_up_to_the_fold(distortion: Floats) -> None:
    reach = min(fold_radius(distortion), 1.5)
    angle = np.linspace(0.0, 2.0 * np.pi, 37)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    # Decentring moves the fold by about 2 p / (slope's slope): 0.99 stays clear of it.
    for share in (0.0, 0.2, 0.6, 0.9, 0.99):
        straight = share * reach * ring
        there = undistort(distort(straight, distortion), distortion)
        slope = np.linalg.svd(distort_partials(straight, distortion)[0], compute_uv=False).min()
        # The misfit is at most 1e-14 in x' and y', over the smallest slope.
        np.testing.assert_allclose(there, straight, atol=4e-14 / slope + 1e-15)


def test_on_the_fold_itself_the_inverse_is_good_to_the_root_of_rounding() -> None:
    edge = np.array([[fold_radius(BARREL), 0.0]])
    assert fold_radius(BARREL) == pytest.approx((1.0 / 0.6) ** 0.5, rel=1e-12)
    # x' is quadratic there: a misfit of 1e-14 is 1e-7 in x, doubled by where Newton stops.
    np.testing.assert_allclose(undistort(distort(edge, BARREL), BARREL), edge, atol=5e-7)


def test_what_no_point_is_imaged_to_has_no_inverse() -> None:
    most = float(distort(np.array([[fold_radius(BARREL), 0.0]]), BARREL)[0, 0])
    answers = undistort(np.array([[most * 1.001, 0.0], [most * 3.0, 0.1], [0.5, 0.0]]), BARREL)
    assert np.isnan(answers[:2]).all()
    assert np.isfinite(answers[2]).all()


coordinate = st.floats(-1.0, 1.0)


@given(
    st.tuples(coordinate, coordinate),
    st.floats(-0.4, 0.4),
    st.floats(-0.2, 0.2),
    st.floats(-5e-3, 5e-3),
    st.floats(-5e-3, 5e-3),
    st.floats(-0.05, 0.05),
)
@example((1.0, 1.0), 0.25, 0.0, 0.0, 0.0, -0.015625)  # its image is beyond its own fold
@settings(max_examples=200, deadline=None)
def test_the_inverse_is_right_or_refused(
    given_at: tuple[float, float], k1: float, k2: float, p1: float, p2: float, k3: float
) -> None:
    straight, terms = np.array([given_at]), np.array([k1, k2, p1, p2, k3])
    inverse = undistort(distort(straight, terms), terms)
    if np.hypot(*given_at) < 0.9 * fold_radius(terms):
        # Decentring of 0.005 needs 0.1 of the way to the fold at the most.
        np.testing.assert_allclose(inverse, straight, atol=1e-11)
    elif np.isfinite(inverse).all():
        np.testing.assert_allclose(distort(inverse, terms), distort(straight, terms), atol=1e-9)


def test_a_point_beyond_the_fold_is_not_imaged_back_inside() -> None:
    aside = np.array([[2.1, 0.0, 1.0]]) * 900.0
    folded = project(aside, interior_vector(1200.0, np.zeros(2), BARREL))[0]
    assert abs(folded[0, 0]) < 600.0, "the polynomial does bring it back inside"
    pixels, _ = camera(BARREL).project(Pose(np.zeros(3), np.eye(3)), aside)
    assert np.isnan(pixels).all()


def test_distortion_that_folds_within_the_image_is_refused() -> None:
    with pytest.raises(InputError, match="turns back on itself within the image"):
        camera(np.array([-1.0, 0.0, 0.0, 0.0, 0.0]), pitch_mm=0.02).frame_limits()


@pytest.mark.parametrize("degrees", [10.0, 60.0, 80.0, 89.0])
def test_a_fisheye_sees_and_looks_back_to_the_edge_of_half_space(degrees: float) -> None:
    angle = np.radians(degrees)
    there = np.array([[np.cos(0.7), np.sin(0.7)]]) * np.tan(angle)
    bent = distort(there, FISHEYE)
    k = FISHEYE
    along = angle * (1.0 + sum(k[j] * angle ** (2 * j + 2) for j in range(4)))
    # Kannala and Brandt's own sum, in another order.
    assert np.hypot(*bent[0]) == pytest.approx(along, rel=1e-13)
    back = undistort(bent, FISHEYE)
    # Slope of the radius by the tangent at 89 degrees is cos^2: 3e-4, so 1e-9 there is 3e-6 here.
    np.testing.assert_allclose(np.degrees(np.arctan(np.hypot(*back[0]))), degrees, atol=1e-6)


def test_a_fisheye_folds_where_its_angles_do() -> None:
    terms = np.array([-0.25, 0.0, 0.0, 0.0])
    # 1 - 0.75 a^2 = 0.
    assert fold_radius(terms) == pytest.approx(np.tan((1.0 / 0.75) ** 0.5), rel=1e-12)
    assert fold_radius(np.zeros(4)) == np.inf


def test_a_rational_lens_ends_where_its_divisor_vanishes() -> None:
    terms = np.array([0.0, 0.0, 0.0, 0.0, 0.0, -0.25, 0.0, 0.0])
    # r / (1 - r^2 / 4) grows up to r = 2.
    assert fold_radius(terms) == pytest.approx(2.0, rel=1e-12)
    # r / (1 + r^2) turns at 1.
    assert fold_radius(np.array([0.0] * 5 + [1.0, 0.0, 0.0])) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("distortion", [*LENSES, NO_DISTORTION])
def test_the_field_of_view_is_that_of_the_lens_as_it_bends(distortion: Floats) -> None:
    kind = camera(distortion)
    across, down = np.radians(kind.field_of_view_deg)
    half = np.tan([[across / 2.0, 0.0], [0.0, down / 2.0]])
    # Decentring of 2.1e-3 moves both ends to one side, by 3 * 2.1e-3 * 0.55^2 * 1200 = 2.3 px.
    np.testing.assert_allclose(
        kind.pixels(half) - kind.principal_point_px, [[600.0, 0.0], [0.0, 400.0]], atol=2.5
    )


@pytest.mark.parametrize(
    ("pitch_mm", "distortion", "across_deg"),
    [
        # Equidistant: 1200 px of 0.012 mm over a focal length of 12 mm are 1.2 rad.
        (0.012, np.zeros(4), np.degrees(1.2)),
        (0.04, np.zeros(4), 180.0),  # a picture wider than half of space
        (0.02, BARREL, np.degrees(2.0 * np.arctan(np.sqrt(5.0 / 3.0)))),  # and than the fold
    ],
)
def test_a_wide_view_ends_with_the_lens(
    pitch_mm: float, distortion: Floats, across_deg: float
) -> None:
    assert camera(distortion, pitch_mm).field_of_view_deg[0] == pytest.approx(across_deg)


def test_a_frame_aside_of_the_axis_has_the_view_between_its_ends() -> None:
    aside = replace(camera(NO_DISTORTION), principal_point_px=np.array([-600.5, 399.5]))
    across = np.degrees(np.arctan(1.5) - np.arctan(0.5))
    assert aside.field_of_view_deg[0] == pytest.approx(across)


@pytest.mark.parametrize("count", [0, 3, 6, 7, 9])
def test_terms_of_no_model_are_refused(count: int) -> None:
    with pytest.raises(InputError, match="distortion terms"):
        camera(np.zeros(count))
