"""The size of a scene whose points were found without one."""

from __future__ import annotations

import numpy as np

from calibration.adjustment.finite import finite_rows
from calibration.observations import Observations, TargetSet
from geometry.arrays import Floats, Ints


def size_of(points: Floats, place: Ints, target: Ints, targets: TargetSet) -> float:
    """Millimetres per unit of ``points`` (p, 3), by measured distances or nominal coordinates.

    ``place`` and ``target`` (p,) say what each point is. 1 when nothing tells the size: then the
    start's cameras must.
    """
    index = {name: k for k, name in enumerate(targets.ids)}
    pairs = [(index[d.first], index[d.second], d.length_mm) for d in targets.distances]
    pairs = pairs or _nominal_pairs(targets)
    where = {(int(p), int(t)): k for k, (p, t) in enumerate(zip(place, target, strict=True))}
    ratios = []
    for each in np.unique(place):
        for a, b, length in pairs:
            first, second = where.get((int(each), a)), where.get((int(each), b))
            if first is not None and second is not None:
                ratios.append(length / float(np.linalg.norm(points[second] - points[first])))
    good = [r for r in ratios if np.isfinite(r)]
    return float(np.median(good)) if good else 1.0


def _nominal_pairs(targets: TargetSet) -> list[tuple[int, int, float]]:
    """Neighbours along each carrier with known coordinates, and their distances."""
    pairs, first = [], 0
    for carrier in targets.carriers:
        known = finite_rows(carrier.sigma_mm) & np.isfinite(carrier.nominal_mm).all(axis=1)
        own = np.flatnonzero(known)
        # Half the list apart: far enough for a good ratio, and no more pairs than targets.
        for a, b in zip(own, np.roll(own, len(own) // 2), strict=True):
            length = float(np.linalg.norm(carrier.nominal_mm[b] - carrier.nominal_mm[a]))
            if length > 0.0:
                pairs.append((first + int(a), first + int(b), length))
        first += len(carrier.ids)
    return pairs


def knows_size(observations: Observations) -> bool:
    """Whether a measured distance or nominal coordinates tell the size."""
    return bool(observations.targets.distances or _nominal_pairs(observations.targets))
