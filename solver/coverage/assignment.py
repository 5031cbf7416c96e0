"""Which views are assigned: the minimum number of views as constraints on chosen rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Bools, Floats, Ints
from solver.limits import CoverageTier

FARTHEST_DEG = 30.0
"""A view further than this from being possible is not assigned: the camera has other work."""


_LOYALTY_DEG = 10.0
_MOST_SHARE = 0.2
_ANGLE_STEP_DEG = 1.0
_MOST_ANGLE_DEG = 8.0


@dataclass(frozen=True, eq=False)
class AssignedViews:
    """Rays that must be seen: ``camera`` and ``point`` (m,).

    ``kept`` (m,) says which of them are seen already; the others have to be won.
    """

    camera: Ints
    point: Ints
    kept: Bools


@dataclass(frozen=True)
class Margins:
    """What is assigned beyond what is asked, because other points are judged than are assigned.

    ``share`` of points beyond each tier's, and ``angle_deg`` by which assigned rays stay within
    the limit of incidence. Both grow while the judged coverage falls short.
    """

    share: float = 0.01
    angle_deg: float = 0.0

    def wider(self, shortfall: float) -> Margins:
        """Margins for the next outer iteration, after coverage fell short by a share."""
        share = min(self.share + 1.5 * shortfall + 0.002, _MOST_SHARE)
        return Margins(share, min(self.angle_deg + _ANGLE_STEP_DEG, _MOST_ANGLE_DEG))


def required_views(tiers: tuple[CoverageTier, ...], deficit_deg: Floats, spare: float) -> Ints:
    """How many views each point should have, (p,): the tiers' shares go to the easiest points.

    A point is the easier for n views the smaller the deficit of its nth-best camera. ``spare``
    is assigned beyond each share, because the region is judged on other points than it is
    designed on.
    """
    n, p = deficit_deg.shape
    ranked = np.sort(deficit_deg, axis=0)
    required = np.zeros(p, dtype=np.int64)
    for tier in sorted(tiers, key=lambda t: t.views):
        views = min(tier.views, n)
        count = int(np.ceil(min(1.0, tier.share + spare) * p))
        chosen = np.argsort(ranked[views - 1], kind="stable")[:count]
        required[chosen] = np.maximum(required[chosen], views)
    return required


def assign_views(
    tiers: tuple[CoverageTier, ...],
    deficit_deg: Floats,
    fixed: Bools,
    spare: float = 0.0,
    earlier: AssignedViews | None = None,
    farthest_deg: float = FARTHEST_DEG,
) -> AssignedViews:
    """Promise each point its wanted views to the cameras that see it best, or come nearest.

    ``deficit_deg`` (n, p): by how many degrees a camera would have to swing round the point to
    see it, negative by the margin with which it does, infinite where it cannot. Views of
    ``fixed`` (n,) cameras count but need no assignment. ``earlier`` assignments that were kept are
    kept on where they are nearly as good as others: an outer loop that assigns now this view, now
    that, never settles. Those that were broken go to another camera if one comes nearly as near.
    """
    kept = deficit_deg <= 0.0
    if earlier is not None:
        deficit_deg = deficit_deg.copy()
        held = deficit_deg[earlier.camera, earlier.point]
        deficit_deg[earlier.camera, earlier.point] += np.where(
            held <= 0.0, -_LOYALTY_DEG, _LOYALTY_DEG
        )
    required = required_views(tiers, deficit_deg, spare)
    # Fixed cameras come first where they see the point and not at all where they do not.
    order = np.where(fixed[:, None], np.where(kept, -1e3, np.inf), deficit_deg)
    rank = np.argsort(np.argsort(order, axis=0, kind="stable"), axis=0)
    chosen = (rank < required) & ~fixed[:, None] & (order < farthest_deg)
    camera, point = np.nonzero(chosen)
    return AssignedViews(camera, point, kept[camera, point])
