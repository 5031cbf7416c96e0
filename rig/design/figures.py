"""Quality, limits and solver reports as JSON data."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from common.files.plain import number
from geometry.arrays import Floats
from solver.coverage.matchable import Matchable
from solver.result import Bound, ConstraintRow, Quality, SolverReport

UPPER_TRIANGLE = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
"""Order of a covariance in files: xx, xy, xz, yy, yz, zz."""


def _table(values: Floats) -> list[list[float | None]]:
    return [[number(v) for v in row] for row in values]


def _short(value: float) -> float | None:
    """Seven digits: single precision, for tables of thousands of rows."""
    return number(float(f"{float(value):.7g}")) if math.isfinite(value) else None


def quality_figures(quality: Quality, names: list[str]) -> dict[str, Any]:
    """The figures of a network whose cameras are called ``names``."""
    return {
        "cost_mm2": number(quality.cost_mm2),
        "sigma_median_mm": number(quality.sigma_median_mm),
        "sigma_p95_mm": number(quality.sigma_p95_mm),
        "sigma_max_mm": number(quality.sigma_max_mm),
        "coverage": [{"views": c.views, "share": float(c.share)} for c in quality.coverage],
        "in_focus_share": number(quality.in_focus_share),
        "in_frame_share": number(quality.in_frame_share),
        "base_height": _table(quality.base_height),
        "convergence_deg": _table(quality.convergence_deg),
        "cameras": [_camera_figures(quality, i, name) for i, name in enumerate(names)],
        "matchable": _matchable_figures(quality.matchable, names),
    }


def _matchable_figures(matchable: Matchable, names: list[str]) -> dict[str, Any]:
    return {
        "share": number(matchable.share(1)),
        "reachable_share": number(matchable.reachable_share),
        "shared": _table(matchable.shared),
        "connected": len(matchable.groups) == 1,
        "groups": [[names[k] for k in group] for group in matchable.groups],
    }


def _camera_figures(quality: Quality, index: int, name: str) -> dict[str, Any]:
    table = quality.cameras
    gsd, incidence = table.gsd_mm[index], table.incidence_deg[index]
    depth, focus = table.depth_mm[index], table.focus_mm[index]
    return {
        "name": name,
        "points_seen": int(table.points_seen[index]),
        "gsd_min_mm": number(gsd[0]),
        "gsd_mean_mm": number(gsd[1]),
        "gsd_max_mm": number(gsd[2]),
        "incidence_mean_deg": number(incidence[0]),
        "incidence_max_deg": number(incidence[1]),
        "depth_min_mm": number(depth[0]),
        "depth_max_mm": number(depth[1]),
        "sharp_from_mm": number(focus[0]),
        "sharp_to_mm": number(focus[1]),
        "distance_mm": number(table.distance_mm[index]),
        "nearest_body_mm": number(table.nearest_body_mm[index]),
        "roll_deg": number(table.roll_deg[index]),
    }


def constraint_figures(rows: tuple[ConstraintRow, ...]) -> list[dict[str, Any]]:
    """The limits, in the order in which they are given."""
    return [
        {
            "name": row.name,
            "value": number(row.value),
            "limit": number(row.limit),
            "sense": str(row.sense),
            "unit": row.unit,
            "slack": number(row.slack),
            "active": bool(row.active),
            "satisfied": bool(row.satisfied),
        }
        for row in rows
    ]


def point_figures(quality: Quality) -> dict[str, Any]:
    """The point table: parallel lists, covariances as their upper triangle."""
    table = quality.points
    rows, columns = zip(*UPPER_TRIANGLE, strict=True)
    covariance = table.covariance_mm2[:, rows, columns]
    return {
        "position_mm": np.round(table.points.points_mm, 4).tolist(),
        "normal": np.round(table.points.normals, 6).tolist(),
        "covariance_mm2": [[_short(v) for v in row] for row in covariance],
        "sigma_mm": [_short(v) for v in table.sigma_mm],
        "views": [int(v) for v in table.views],
        "in_focus": [int(v) for v in table.in_focus],
        "matchable_pairs": [int(v) for v in quality.matchable.pairs_of_point],
    }


def solver_figures(report: SolverReport) -> dict[str, Any]:
    """The solver's word."""
    return {
        "engine": report.engine,
        "status": str(report.status),
        "why_stopped": report.why_stopped,
        "kkt_error": number(report.kkt_error),
        "iterations": int(report.iterations),
        "rounds": int(report.rounds),
        "seed": int(report.seed),
        "seconds": round(float(report.seconds), 3),
        "starts": [
            {
                "index": int(start.index),
                "kind": start.kind,
                "feasible": bool(start.feasible),
                "cost_mm2": number(start.cost_mm2),
                "violation": number(start.violation),
                "iterations": int(start.iterations),
                "rounds": int(start.rounds),
                "why_stopped": start.why_stopped,
            }
            for start in report.starts
        ],
        "conflicts": [
            {
                "family": conflict.family,
                "unit": conflict.unit,
                "give": number(conflict.amount),
                "give_alone": None
                if conflict.amount_alone is None
                else number(conflict.amount_alone),
            }
            for conflict in report.conflicts
        ],
        "starts_note": report.starts_note,
        **_bound(report.bound),
    }


def _bound(bound: Bound | None) -> dict[str, Any]:
    if bound is None:
        return {}
    return {"bound": {**asdict(bound), "gap_share": bound.gap_share}}
