"""What all designs of a study say together: Pareto front, recommendation, places that recur."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from geometry.arrays import Floats
from rig.study.resultfile import Recurring, Row, StudyFindings
from rig.study.studyfile import Study

NEAR_BEST_SHARE = 0.1
"""Rigs with a sigma this much greater at most count among the best."""

REACH_DEG = 12.0
"""A camera within this of a place, seen from the face, stands there: the jitter of starts."""


def findings(rows: Sequence[Row], study: Study) -> StudyFindings:
    """Everything that is found by comparing the rows, whose own ``on_front`` is not looked at."""
    front = pareto_front(rows)
    chosen, why = recommended(rows, study)
    best = [] if chosen is None else near_best(rows, chosen)
    consensus = [] if chosen is None else recurring(rows[chosen], [rows[k] for k in best])
    return StudyFindings(front=front, recommended=chosen, why=why, best=best, consensus=consensus)


def _p95_mm(row: Row) -> float:
    return math.inf if row.sigma_p95_mm is None else row.sigma_p95_mm


def _losses(row: Row) -> tuple[float, ...]:
    """What should be small: sigma, its median, what is unseen, size, number, price, heads lost.

    To four digits: what differs less is the same rig, solved from another start.
    """
    median = math.inf if row.sigma_median_mm is None else row.sigma_median_mm
    unseen = 1.0 - (row.seen_twice_share or 0.0)
    price = math.inf if row.price is None else row.price
    size = row.extent_mm()
    losses = (_p95_mm(row), median, unseen, size, float(row.cameras), price)
    return *(float(f"{loss:.4g}") for loss in losses), -float(row.holds_on)


def usable(rows: Sequence[Row]) -> list[int]:
    """Rows that hold every limit on the head they were designed for."""
    return [k for k, row in enumerate(rows) if not row.reason and row.cameras]


def pareto_front(rows: Sequence[Row]) -> list[int]:
    """Rows than which no other is better in one respect and as good in all.

    Of rows that are the same in all, the first is taken.
    """
    losses = {k: _losses(rows[k]) for k in usable(rows)}

    def beaten(k: int) -> bool:
        mine = losses[k]
        return any(
            all(a <= b for a, b in zip(other, mine, strict=True)) and (other != mine or j < k)
            for j, other in losses.items()
            if j != k
        )

    return [k for k in losses if not beaten(k)]


def recommended(rows: Sequence[Row], study: Study) -> tuple[int | None, str]:
    """The row to build and why, in words.

    Of the rigs that hold their limits on the most heads: the fewest cameras that reach what is
    wanted; without a wish, the fewest that one camera more would better by too little.
    """
    held = usable(rows)
    if not held:
        return None, "No design holds all its limits; the reasons stand in the table."
    most = max(rows[k].holds_on for k in held)
    leaders: dict[int, int] = {}
    for k in held:
        if rows[k].holds_on == most:
            leader = leaders.setdefault(rows[k].cameras, k)
            better = (_p95_mm(rows[k]), rows[k].extent_mm()) < (
                _p95_mm(rows[leader]),
                rows[leader].extent_mm(),
            )
            leaders[rows[k].cameras] = k if better else leader
    wanted_mm = study.recommend.sigma_p95_max_mm
    sigma = {n: _p95_mm(rows[k]) for n, k in sorted(leaders.items())}
    if wanted_mm is not None:
        return _reaching(leaders, sigma, wanted_mm)
    return _worth_it(leaders, sigma, study.recommend.camera_worth_share)


def _reaching(
    leaders: dict[int, int], sigma: dict[int, float], wanted_mm: float
) -> tuple[int, str]:
    enough = [n for n, value in sigma.items() if value <= wanted_mm]
    if enough:
        n = enough[0]
        return leaders[n], (
            f"The fewest cameras, {n}, whose 95 % sigma ({1e3 * sigma[n]:.1f} µm) is within the "
            f"{1e3 * wanted_mm:.1f} µm that are wanted."
        )
    n = min(sigma, key=lambda count: sigma[count])
    return leaders[n], (
        f"No rig reaches the {1e3 * wanted_mm:.1f} µm that are wanted; {n} cameras come nearest "
        f"with a 95 % sigma of {1e3 * sigma[n]:.1f} µm."
    )


def _worth_it(
    leaders: dict[int, int], sigma: dict[int, float], worth_share: float
) -> tuple[int, str]:
    for n, value in sigma.items():
        # The least that more cameras would have to reach: each a share less than the one before.
        worth = [m for m in sigma if m > n and sigma[m] <= value * (1.0 - worth_share) ** (m - n)]
        if not worth:
            break
    text = f"{n} cameras: the most accurate rig of that number, with a 95 % sigma of "
    text += f"{1e3 * sigma[n]:.1f} µm. "
    if n == max(sigma):
        return leaders[n], text + (
            "Each camera up to the most that the study has was worth it; a study with more may "
            "find better."
            if len(sigma) > 1
            else "The study has no other number of cameras."
        )
    return leaders[n], text + (
        f"More cameras would lower it by less than {100.0 * worth_share:.0f} % each."
    )


def near_best(rows: Sequence[Row], chosen: int) -> list[int]:
    """Rigs of as many cameras as the chosen one, nearly as accurate, the best first."""
    limit = _p95_mm(rows[chosen]) * (1.0 + NEAR_BEST_SHARE)
    near = [
        k
        for k in usable(rows)
        if rows[k].cameras == rows[chosen].cameras and _p95_mm(rows[k]) <= limit
    ]
    return sorted(near, key=lambda k: _p95_mm(rows[k]))


def directions(row: Row) -> Floats:
    """Unit vectors (n, 3) from the face to the cameras."""
    away = np.array([p.position_mm for p in row.places]) - np.array(row.centre_mm)
    return np.asarray(away / np.linalg.norm(away, axis=1, keepdims=True))


def recurring(row: Row, best: Sequence[Row]) -> list[Recurring]:
    """How often the best rigs have a camera where ``row`` has one.

    A rig and its mirror image are as good as each other, so each is taken as it fits better.
    """
    own = directions(row)
    angles = [_nearest_deg(own, directions(other)) for other in best]
    out = []
    for k, place in enumerate(row.places):
        near = [a[k] for a in angles if a[k] <= REACH_DEG]
        x, y, z = own[k]
        away = np.array(place.position_mm) - np.array(row.centre_mm)
        out.append(
            Recurring(
                name=place.name,
                azimuth_deg=float(np.degrees(np.arctan2(x, -y))),
                elevation_deg=float(np.degrees(np.arcsin(np.clip(z, -1.0, 1.0)))),
                distance_mm=float(np.linalg.norm(away)),
                recurs_in=len(near),
                spread_deg=float(np.mean(near)) if near else 0.0,
            )
        )
    return out


def _nearest_deg(own: Floats, others: Floats) -> Floats:
    """Angle from each of own (n, 3) to the nearest of others (m, 3), mirrored if better, (n,)."""
    mirrored = others * np.array([-1.0, 1.0, 1.0])
    both = [np.degrees(np.arccos(np.clip(own @ o.T, -1.0, 1.0))).min(axis=1)
            for o in (others, mirrored)]  # fmt: skip
    hits = [((a <= REACH_DEG).sum(), -a.mean()) for a in both]
    return np.asarray(both[0] if hits[0] >= hits[1] else both[1])
