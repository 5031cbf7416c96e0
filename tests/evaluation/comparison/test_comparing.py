"""Distances to surfaces whose answer is known, and the figures that follow from them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from common.errors import InputError
from evaluation.comparison.alignment import best_fit
from evaluation.comparison.comparing import Within, compare
from evaluation.comparison.distances import Reference, signed_distances

pytest.importorskip("igl")


def box(size_mm: float = 40.0) -> Reference:
    mesh = trimesh.creation.box((size_mm, size_mm, size_mm))
    return Reference(np.asarray(mesh.vertices), np.asarray(mesh.faces))


def bumpy() -> Reference:
    """A face of a kind: no symmetry, so that only one pose fits."""
    mesh = trimesh.creation.icosphere(3, 30.0)
    v = np.asarray(mesh.vertices)
    v = v * (1.0 + 0.1 * np.sin(0.15 * v[:, :1]) + 0.07 * np.cos(0.18 * v[:, 1:2] + 1.0))
    return Reference(v + 0.002 * v[:, [2, 0, 1]] ** 2, np.asarray(mesh.faces))


def box_distance(points: np.ndarray, half: float = 20.0) -> np.ndarray:
    """The signed distance to an axis-aligned cube, in closed form."""
    q = np.abs(points) - half
    return np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0.0)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_distances_to_a_cube_are_those_in_closed_form(seed: int) -> None:
    # Outside corners and edges too, where the sign needs the angle-weighted normal.
    points = np.random.default_rng(seed).uniform(-40, 40, (200, 3))
    found, closest = signed_distances(points, box())
    assert found == pytest.approx(box_distance(points), abs=1e-9)
    assert np.linalg.norm(points - closest, axis=1) == pytest.approx(np.abs(found), abs=1e-9)


def test_a_shell_that_is_too_large_is_told_as_bias_and_not_as_scatter() -> None:
    sphere = trimesh.creation.icosphere(5, 60.0)
    reference = Reference(np.asarray(sphere.vertices), np.asarray(sphere.faces))
    rng = np.random.default_rng(1)
    directions = rng.normal(size=(40_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    cloud = directions * (60.05 + rng.normal(0.0, 0.02, (40_000, 1)))
    done = compare(cloud, reference).figures
    # The facets lie inside their ball: (e^2 / 3 - e^2 / 12) / (2 R) = e^2 / (8 R) on average over
    # an equilateral triangle of edge e.
    inside = np.mean(sphere.edges_unique_length**2) / (8.0 * 60.0)
    # Standard error of the mean of 40,000: 1e-4; triangles are not quite equilateral: 5 %.
    assert done.bias_mm == pytest.approx(0.05 + inside, abs=1e-3)
    assert done.rms_mm == pytest.approx(np.hypot(0.05 + inside, 0.02), abs=1e-3)
    assert done.mad_mm == pytest.approx(0.6745 * 0.02, rel=0.05)
    assert done.left_out == 0


def test_half_a_cloud_reaches_half_the_reference() -> None:
    reference = bumpy()
    cloud = reference.samples(0.3, seed=5)
    whole = dict(compare(cloud, reference).figures.reached_percent)
    half = dict(compare(cloud[cloud[:, 0] > 0], reference).figures.reached_percent)
    share = 100 * np.mean(reference.samples(0.5)[:, 0] > 0)
    assert whole[1.0] > 99.9
    # The rim reaches half a millimetre across: perimeter (about 200 mm) x 0.5 of 11,000 mm2.
    assert half[0.5] == pytest.approx(share, abs=1.0)


def test_points_of_something_else_are_counted_apart() -> None:
    cloud = np.vstack([box().samples(1.0), [[500.0, 0.0, 0.0]] * 7])
    done = compare(cloud, box()).figures
    assert (done.left_out, done.rms_mm) == (7, pytest.approx(0.0, abs=1e-9))


def test_only_the_region_is_compared() -> None:
    cloud = box().samples(1.0)
    cloud[cloud[:, 0] < 0] *= 1.02
    done = compare(cloud, box(), within=Within((20.0, 0.0, 0.0), 15.0)).figures
    assert done.rms_mm == pytest.approx(0.0, abs=1e-9)
    assert dict(done.reached_percent)[1.0] > 90.0


@pytest.mark.parametrize("seed", range(3))
def test_best_fit_finds_the_motion_that_was_planted(seed: int) -> None:
    rng, reference = np.random.default_rng(seed), bumpy()
    turn = Rotation.from_rotvec(rng.uniform(-0.05, 0.05, 3))
    shift = rng.uniform(-2, 2, 3)
    cloud = turn.inv().apply(reference.samples(1.0, seed=seed) - shift)
    found = best_fit(cloud, reference)
    assert found.converged
    # Sampled exactly on the facets, so the fit is exact but for where it stops (1e-5 mm).
    assert found.rotation == pytest.approx(turn.as_matrix(), abs=1e-5)
    assert found.translation_mm == pytest.approx(shift, abs=1e-3)


def test_scale_is_fitted_on_request_only() -> None:
    reference = bumpy()
    cloud = reference.samples(1.0) * 1.01
    kept = compare(cloud, reference, align="best-fit").figures
    fitted = compare(cloud, reference, align="best-fit-scale")
    # A hundredth of a radius of 27 to 33 mm.
    assert kept.bias_mm == pytest.approx(0.3, abs=0.03)
    assert fitted.alignment.scale == pytest.approx(1 / 1.01, abs=1e-5)
    assert fitted.figures.rms_mm < 1e-3


def test_a_cloud_in_metres_is_told_in_one_line() -> None:
    with pytest.raises(InputError, match=r"within 5 mm of the reference.*millimetres") as told:
        compare(box().samples(1.0) + 900.0, box())
    assert told.value.code == "input/compare-apart"


@pytest.mark.parametrize(
    ("vertices", "faces", "code"),
    [
        (np.zeros((0, 3)), np.zeros((0, 3), int), "input/reference-empty"),
        (np.full((3, 3), np.nan), np.array([[0, 1, 2]]), "input/reference-empty"),
        (np.zeros((3, 3)), np.array([[0, 1, 3]]), "input/reference"),
        (np.zeros((3, 2)), np.array([[0, 1, 2]]), "input/reference"),
    ],
    ids=["empty", "nan", "lacking", "flat"],
)
def test_a_reference_that_is_none_is_refused(
    vertices: np.ndarray, faces: np.ndarray, code: str
) -> None:
    with pytest.raises(InputError) as told:
        Reference(vertices, faces)
    assert told.value.code == code
