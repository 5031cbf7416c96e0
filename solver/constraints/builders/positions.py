"""Candidate rows about places: stand-off, base/height, spacing, symmetry."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from scipy.spatial import Delaunay, QhullError

from geometry.arrays import Floats, Ints
from solver.constraints.base import Block, WeightedSum, bound
from solver.constraints.candidates import CandidateConstraints
from solver.constraints.positions import (
    BaseHeightRatio,
    BaseLength,
    PositionCoordinate,
    PositionDistance,
)
from solver.problem import Problem
from solver.variables import PER_CAMERA, NetworkState

_INF = np.inf


def _or(value: float | None, otherwise: float) -> float:
    return otherwise if value is None else value


def camera_pairs(count: int) -> tuple[Ints, Ints]:
    """Both ends (m,) of all pairs of cameras."""
    first, second = np.triu_indices(count, 1)
    return first, second


def nearest_neighbours(centres: Floats) -> tuple[Ints, Ints]:
    """Each camera (n,) and its nearest neighbour (n,)."""
    away = np.linalg.norm(centres[:, None] - centres[None], axis=2)
    np.fill_diagonal(away, np.inf)
    return np.arange(len(centres)), np.argmin(away, axis=1)


def delaunay_edges(centres: Floats) -> tuple[Ints, Ints]:
    """Edges of the Delaunay triangulation of the cameras (Eq 13).

    In space where they span one; else in the plane that fits them best, because a
    triangulation in space of nearly coplanar points consists of slivers whose long edges mean
    nothing. Fewer than four cameras, or cameras on a line, are joined all with all.
    """
    middle = centres - centres.mean(axis=0)
    _, spread, axes = np.linalg.svd(middle, full_matrices=False)
    flat = len(centres) > 3 and len(spread) == 3 and spread[2] < 0.1 * spread[0]
    try:
        cells = Delaunay(middle @ axes[:2].T if flat else middle).simplices
    except (QhullError, ValueError):
        return camera_pairs(len(centres))
    edges = {tuple(sorted(map(int, e))) for cell in cells for e in combinations(cell, 2)}
    table = np.array(sorted(edges), dtype=np.int64)
    return table[:, 0], table[:, 1]


def _base_height(problem: Problem, state: NetworkState) -> list[CandidateConstraints]:
    limit = problem.limits.base_height
    first, second = camera_pairs(problem.count)
    out = []

    def ratios(family: str, one: Ints, two: Ints, low: float, high: float) -> BaseHeightRatio:
        centroid = np.zeros((len(one), 3))
        return BaseHeightRatio(
            family, "", 1.0, bound(low, one), bound(high, one), one, two, centroid
        )

    if len(first) == 0:
        return []
    if limit.min is not None:
        out.append(
            CandidateConstraints.all_of(ratios("base_height_min", first, second, limit.min, _INF))
        )
    if limit.max is not None:
        out.append(
            CandidateConstraints.all_of(ratios("base_height_max", first, second, -_INF, limit.max))
        )
    if limit.neighbour_max is not None:
        one, two = nearest_neighbours(state.centre)
        block = ratios("base_height_neighbour", one, two, -_INF, limit.neighbour_max)
        out.append(CandidateConstraints.all_of(block))
    for family, low, high in (
        ("base_height_mean_min", limit.mean_min, None),
        ("base_height_mean_max", None, limit.mean_max),
    ):
        if low is not None or high is not None:
            inner = ratios(family, first, second, -_INF, _INF)
            weights = np.full((1, len(first)), 1.0 / len(first))
            row = _sum(problem, family, "", 1.0, _or(low, -_INF), _or(high, _INF), inner, weights)
            out.append(CandidateConstraints.all_of(row))
    return out


def _sum(
    problem: Problem,
    family: str,
    unit: str,
    natural: float,
    low: float,
    high: float,
    inner: Block,
    weights: Floats,
) -> WeightedSum:
    return WeightedSum(
        family,
        unit,
        natural,
        np.array([low]),
        np.array([high]),
        inner,
        weights,
        PER_CAMERA * problem.count,
    )


def _stand_off(problem: Problem) -> list[CandidateConstraints]:
    limit, scale = problem.limits.stand_off, problem.length_mm
    every = np.arange(problem.count)
    origin = np.zeros((problem.count, 3))
    out = []
    for family, low, high in (
        ("stand_off_min", limit.min_mm, None),
        ("stand_off_max", None, limit.max_mm),
    ):
        if low is None and high is None:
            continue
        lower, upper = _or(low, -_INF) / scale, _or(high, _INF) / scale
        block = PositionDistance(
            family, "mm", scale, bound(lower, every), bound(upper, every), every, origin
        )
        out.append(CandidateConstraints.all_of(block))
    return out


def _spacing(problem: Problem, state: NetworkState) -> list[CandidateConstraints]:
    limit, scale = problem.limits.spacing, problem.length_mm
    if limit is None or problem.count < 2:
        return []
    first, second = delaunay_edges(state.centre)
    inner = BaseLength(
        "spacing", "mm", scale, bound(-_INF, first), bound(_INF, first), first, second
    )
    low, high = (
        (limit.edge_mm - limit.tolerance_mm) / scale,
        (limit.edge_mm + limit.tolerance_mm) / scale,
    )
    weights = np.full((1, len(first)), 1.0 / len(first))
    return [
        CandidateConstraints.all_of(
            _sum(problem, "spacing", "mm", scale, low, high, inner, weights)
        )
    ]


def median_weights(values: Floats) -> Floats:
    """Weights (n,) with which the coordinates enter their median."""
    order = np.argsort(values, kind="stable")
    out = np.zeros(len(values))
    middle = order[(len(values) - 1) // 2 : len(values) // 2 + 1]
    out[middle] = 1.0 / len(middle)
    return out


def _symmetry(problem: Problem, state: NetworkState) -> list[CandidateConstraints]:
    limit, scale, n = problem.limits.symmetry, problem.length_mm, problem.count
    if limit is None:
        return []
    out = []
    every = np.arange(n)
    for axis in limit.axis_indices:
        name = "xyz"[axis]
        mean = np.full(n, 1.0 / n)
        for family, tolerance, weights in (
            (
                f"symmetry_median_{name}",
                limit.median_tolerance_mm,
                mean - median_weights(state.centre[:, axis]),
            ),
            (f"symmetry_balance_{name}", limit.balance_tolerance_mm, mean),
        ):
            if tolerance is None:
                continue
            inner = PositionCoordinate(
                family,
                "mm",
                scale,
                bound(-_INF, every),
                bound(_INF, every),
                every,
                np.full(n, axis),
                np.zeros(n),
            )
            band = tolerance / scale
            row = _sum(problem, family, "mm", scale, -band, band, inner, weights[None])
            out.append(CandidateConstraints.all_of(row))
    return out


def position_constraints(problem: Problem, state: NetworkState) -> list[CandidateConstraints]:
    """All candidate rows about places."""
    return (
        _stand_off(problem)
        + _base_height(problem, state)
        + _spacing(problem, state)
        + _symmetry(problem, state)
    )
