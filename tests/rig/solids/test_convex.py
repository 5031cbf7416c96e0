"""Distances between convex bodies, against shapes whose distance is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from rig.solids.convex import ROUND_SIDES, box_corners, cylinder_corners, signed_distance

CUBE = box_corners(np.array([2.0, 2.0, 2.0]), np.zeros(3))


@pytest.mark.parametrize(
    ("shift", "expected"),
    [
        ([5.0, 0.0, 0.0], 3.0),  # face to face
        ([5.0, 5.0, 0.0], 3.0 * np.sqrt(2.0)),  # edge to edge
        ([5.0, 5.0, 5.0], 3.0 * np.sqrt(3.0)),  # corner to corner
        ([2.0, 0.0, 0.0], 0.0),  # touching
        ([1.5, 0.3, 0.2], -0.5),  # overlapping: the shortest way out is along x
        ([0.0, 0.0, 0.0], -2.0),  # in the same place
    ],
)
def test_cubes(shift: list[float], expected: float) -> None:
    # The least squares problem has condition about 1e3; 1e-9 leaves room for it.
    assert signed_distance(CUBE, CUBE + shift) == pytest.approx(expected, abs=1e-9)


def test_a_lens_is_never_farther_than_it_is() -> None:
    lens = cylinder_corners(30.0, 0.0, 25.0)
    short = 15.0 * (1.0 / np.cos(np.pi / ROUND_SIDES) - 1.0)
    for turn in np.linspace(0.0, np.pi / ROUND_SIDES, 5):
        way = np.array([np.cos(turn), np.sin(turn), 0.0])
        point = (40.0 * way + [0.0, 0.0, 10.0])[None]
        assert 25.0 - short - 1e-9 <= signed_distance(lens, point) <= 25.0 + 1e-9


def test_flat_things_that_cross_touch() -> None:
    one = np.array([[-1.0, 0, 0], [1, 0, 0]])
    other = np.array([[0, -1.0, 0], [0, 1, 0]])
    assert signed_distance(one, other) == 0.0
    assert signed_distance(one, one) == 0.0


small = st.floats(-3.0, 3.0)


@settings(max_examples=80, deadline=None)
@given(
    st.tuples(small, small, small),
    st.tuples(small, small, small),
    st.tuples(small, small, small),
    st.integers(0, 2**31),
)
def test_distance_is_that_of_a_separating_plane(
    turn: tuple[float, ...], shift: tuple[float, ...], move: tuple[float, ...], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    one = rng.uniform(-1.0, 1.0, (12, 3))
    other = rng.uniform(-1.0, 1.0, (9, 3)) @ Rotation.from_rotvec(turn).as_matrix().T + shift
    distance = signed_distance(one, other)
    # Independent reading: the facets of the Minkowski difference. Outside, no facet's plane is
    # farther from the origin than the hull; inside, the nearest facet is the way out.
    facets = ConvexHull((one[:, None] - other[None]).reshape(-1, 3)).equations[:, 3]
    if distance < 0.0:
        assert distance == pytest.approx(facets.max(), abs=1e-9)
    else:
        assert distance >= facets.max() - 1e-9
        middle = one.mean(axis=0) - other.mean(axis=0)
        assert distance <= np.linalg.norm(middle) + 1e-9
    rigid = Rotation.from_rotvec(move).as_matrix().T
    moved = signed_distance(one @ rigid + move, other @ rigid + move)
    assert moved == pytest.approx(distance, abs=1e-8)
    assert signed_distance(other, one) == pytest.approx(distance, abs=1e-8)
