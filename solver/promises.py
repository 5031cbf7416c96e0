"""Which views are promised: the minimum number of views as constraints on chosen rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Bools, Floats, Ints
from solver.limits import CoverageTier

_SPARE_SHARE = 0.01
"""Promised beyond a tier's share, because the region is judged on other points than it is
designed on."""

FARTHEST_DEG = 30.0
"""A view further than this from being possible is not promised: the camera has other work."""


_LOYALTY_DEG = 10.0


@dataclass(frozen=True, eq=False)
class Promises:
    """Rays that must be seen: ``camera`` and ``point`` (m,).

    ``kept`` (m,) says which of them are seen already; the others have to be won.
    """

    camera: Ints
    point: Ints
    kept: Bools


def wanted_views(tiers: tuple[CoverageTier, ...], deficit_deg: Floats) -> Ints:
    """How many views each point should have, (p,): the tiers' shares go to the easiest points.

    A point is the easier for n views the smaller the deficit of its nth-best camera.
    """
    n, p = deficit_deg.shape
    ranked = np.sort(deficit_deg, axis=0)
    wanted = np.zeros(p, dtype=np.int64)
    for tier in sorted(tiers, key=lambda t: t.views):
        views = min(tier.views, n)
        count = int(np.ceil(min(1.0, tier.share + _SPARE_SHARE) * p))
        chosen = np.argsort(ranked[views - 1], kind="stable")[:count]
        wanted[chosen] = np.maximum(wanted[chosen], views)
    return wanted


def promise(
    tiers: tuple[CoverageTier, ...],
    deficit_deg: Floats,
    fixed: Bools,
    earlier: Promises | None = None,
) -> Promises:
    """Promise each point its wanted views to the cameras that see it best, or come nearest.

    ``deficit_deg`` (n, p): by how many degrees a camera would have to swing round the point to
    see it, negative by the margin with which it does, infinite where it cannot. Views of
    ``fixed`` (n,) cameras count but need no promise. ``earlier`` promises are kept where they
    are nearly as good as others: rounds that promise now this view, now that, never settle.
    """
    kept = deficit_deg <= 0.0
    if earlier is not None:
        deficit_deg = deficit_deg.copy()
        deficit_deg[earlier.camera, earlier.point] -= _LOYALTY_DEG
    wanted = wanted_views(tiers, deficit_deg)
    # Fixed cameras come first where they see the point and not at all where they do not.
    order = np.where(fixed[:, None], np.where(kept, -1e3, np.inf), deficit_deg)
    rank = np.argsort(np.argsort(order, axis=0, kind="stable"), axis=0)
    chosen = (rank < wanted) & ~fixed[:, None] & (order < FARTHEST_DEG)
    camera, point = np.nonzero(chosen)
    return Promises(camera, point, kept[camera, point])
