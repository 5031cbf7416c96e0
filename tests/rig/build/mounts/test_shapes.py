"""Gaps between convex solids: quick bounds never lie, exact ones agree with brute force."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog, minimize

from rig.build.mounts.shapes import ConvexShape, Crowd, gap_mm
from rig.solids.convex import box_corners


def rock(seed: int, away: float = 0.0, size: float = 30.0) -> ConvexShape:
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=3)
    direction *= away / np.linalg.norm(direction)
    return ConvexShape(size * rng.normal(size=(12, 3)) + direction)


def brute_gap(one: ConvexShape, other: ConvexShape) -> tuple[float, float]:
    """Bounds of the shortest distance of two hulls by a general solver over both sets of weights.

    Two points of the hulls bound it from above, the slab square to their line from below.
    """
    a, b = one.corners_mm, other.corners_mm

    def apart(weights: np.ndarray) -> float:
        u, v = weights[: len(a)], weights[len(a) :]
        return float((((u @ a) - (v @ b)) ** 2).sum())

    start = np.concatenate([np.full(len(a), 1.0 / len(a)), np.full(len(b), 1.0 / len(b))])
    sums = [
        {"type": "eq", "fun": lambda w: w[: len(a)].sum() - 1.0},
        {"type": "eq", "fun": lambda w: w[len(a) :].sum() - 1.0},
    ]
    found = minimize(
        apart, start, bounds=[(0.0, 1.0)] * len(start), constraints=sums, method="SLSQP",
        options={"maxiter": 400, "ftol": 1e-12},
    )  # fmt: skip
    # The solver keeps sums and signs to its own tolerance: points outside the hulls bound nothing.
    u, v = (np.clip(w, 0.0, None) for w in (found.x[: len(a)], found.x[len(a) :]))
    between = v / v.sum() @ b - u / u.sum() @ a
    far = float(np.linalg.norm(between))
    along = between / far
    return float((b @ along).min() - (a @ along).max()), far


def meets(one: ConvexShape, other: ConvexShape) -> bool:
    """Whether two hulls have a point in common, by a linear programme."""
    a, b = one.corners_mm, other.corners_mm
    equal = np.vstack(
        [
            np.hstack([a.T, -b.T]),
            np.hstack([np.ones(len(a)), np.zeros(len(b))]),
            np.hstack([np.zeros(len(a)), np.ones(len(b))]),
        ]
    )
    wanted = np.array([0.0, 0.0, 0.0, 1.0, 1.0])
    return bool(linprog(np.zeros(equal.shape[1]), A_eq=equal, b_eq=wanted).success)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000), st.floats(60.0, 300.0))
def test_gaps_are_those_of_a_general_solver(seed: int, away: float) -> None:
    one, other = rock(seed), rock(seed + 1, away)
    gap = gap_mm(one, other, np.inf)
    assert (gap > 0.0) == (not meets(one, other))
    if gap > 0.1:
        low, high = brute_gap(one, other)
        assert low - 1e-6 <= gap <= high + 1e-6
    assert gap == pytest.approx(gap_mm(other, one, np.inf), abs=1e-6)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000), st.floats(0.0, 300.0), st.floats(-20.0, 80.0))
def test_a_quick_bound_is_never_too_large(seed: int, away: float, enough: float) -> None:
    one, other = rock(seed), rock(seed + 1, away)
    exact, quick = gap_mm(one, other, np.inf), gap_mm(one, other, enough)
    assert quick <= exact + 1e-6
    # What is not told exactly is enough.
    assert quick == pytest.approx(exact, abs=1e-6) or quick >= enough


def test_an_overlap_is_the_shortest_way_apart() -> None:
    one = ConvexShape(box_corners(np.array([20.0, 20.0, 20.0]), np.zeros(3)))
    other = ConvexShape(box_corners(np.array([10.0, 10.0, 10.0]), np.array([13.0, 2.0, 1.0])))
    # Faces at +10 and 13 - 5 = 8: 2 mm along x, more along any other axis.
    assert gap_mm(one, other, 0.0) == pytest.approx(-2.0, abs=1e-6)
    moved = ConvexShape(other.corners_mm + 2.1 * np.eye(3)[0])
    assert gap_mm(one, moved, np.inf) == pytest.approx(0.1, abs=1e-6)


def test_flat_things_have_no_faces_but_a_gap() -> None:
    flat = ConvexShape(np.array([[0.0, 0, 0], [10.0, 0, 0], [10.0, 10, 0], [0.0, 10, 0]]))
    block = ConvexShape(box_corners(np.array([4.0, 4.0, 4.0]), np.array([5.0, 5.0, 7.0])))
    assert flat.face_gap_mm(block) == -np.inf and len(flat.faces) == 0
    assert gap_mm(flat, block, np.inf) == pytest.approx(5.0, abs=1e-6)
    point = ConvexShape(np.array([[5.0, 5.0, 30.0]]))
    assert gap_mm(block, point, np.inf) == pytest.approx(21.0, abs=1e-6)


def test_faces_look_outwards() -> None:
    shape = rock(3)
    inside = shape.corners_mm.mean(axis=0)
    assert (shape.faces[:, :3] @ inside + shape.faces[:, 3] < 0.0).all()
    assert (shape.corners_mm @ shape.faces[:, :3].T + shape.faces[:, 3]).max() < 1e-6
    assert np.linalg.norm(shape.faces[:, :3], axis=1) == pytest.approx(np.ones(len(shape.faces)))


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000), st.floats(0.0, 60.0))
def test_a_crowd_leaves_out_only_what_is_far(seed: int, within: float) -> None:
    rng = np.random.default_rng(seed)
    shapes = [rock(seed + k, float(rng.uniform(0.0, 400.0))) for k in range(2, 9)]
    crowd, asked = Crowd(shapes[:3]), rock(seed)
    crowd.add(shapes[3:])
    crowd.add([])
    near = crowd.near(asked, within)
    assert near == sorted(set(near)) and crowd.shapes == shapes
    for k, shape in enumerate(shapes):
        boxes = np.maximum(shape.low_mm - asked.high_mm, asked.low_mm - shape.high_mm).max()
        assert (k in near) == (boxes < within)
        if k not in near:
            assert gap_mm(asked, shape, np.inf) >= within - 1e-6
    assert Crowd().near(asked, within) == []
