"""Targets that do not lie where the other targets of their carrier say: misread, or moved."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calibration.detection import opencv
from calibration.detection.detections import Point
from calibration.detection.gates import Gates, Rejection, Rule
from calibration.detection.planes import straightened
from calibration.observations import Carrier
from calibration.targets.boards import Board
from calibration.targets.kinds import CharucoPlate, TargetPlan
from geometry.arrays import Bools, Floats

_ENOUGH_ON_A_PLANE, _ENOUGH_IN_SPACE = 6, 8
_FLAT = 1e-3


def carrier_strangers(
    plan: TargetPlan, points: Sequence[Point], size_px: tuple[int, int], gates: Gates
) -> tuple[list[Point], list[Rejection]]:
    """Points that agree with their carriers, and rejections of those that do not.

    A carrier is asked when enough of its targets with known places are seen: six on a plane,
    eight in space. Plates have their own, closer rule.
    """
    seen = {p.target: p for p in points}
    rejections: list[Rejection] = []
    for kind in plan.carriers:
        if isinstance(kind, CharucoPlate | Board):
            continue
        carrier = kind.carrier()
        known = np.asarray(np.isfinite(carrier.sigma_mm).all(axis=1))
        rows = [k for k, name in enumerate(carrier.ids) if name in seen and known[k]]
        if len(rows) < _ENOUGH_ON_A_PLANE:
            continue
        pixels = np.array([seen[carrier.ids[k]].pixel for k in rows]).reshape(-1, 2)
        limit = max(3.0, gates.pose_share * float(np.ptp(pixels, axis=0).max()))
        good = _agreeing(carrier, rows, pixels, limit, size_px)
        for k in np.flatnonzero(~good):
            point = seen.pop(carrier.ids[rows[k]])
            rejections.append(Rejection(point.target, Rule.POSE, limit, limit, point.pixel))
    return [p for p in points if p.target in seen], rejections


def _agreeing(
    carrier: Carrier,
    rows: Sequence[int],
    pixels: Floats,
    limit_px: float,
    size_px: tuple[int, int],
) -> Bools:
    nominal = carrier.nominal_mm[rows]
    everything = np.ones(len(rows), dtype=bool)
    away = nominal - nominal.mean(axis=0)
    _, size, axes = np.linalg.svd(away, full_matrices=False)
    if size[1] < _FLAT * size[0]:
        return everything
    if size[2] < _FLAT * size[0]:
        plane = away @ axes[:2].T
        found = opencv.homography(plane, straightened(plane, pixels, size_px), limit_px)
        mask = None if found is None else found[1]
    elif len(rows) >= _ENOUGH_IN_SPACE:
        mask = opencv.pose_agreement(nominal, pixels, size_px, limit_px)
    else:
        return everything
    # Where fewer than half agree there is no telling which half is right.
    return everything if mask is None or mask.mean() < 0.5 else mask
