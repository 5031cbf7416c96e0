"""Start values of lenses that Brown's terms do not describe, and from one model to another."""

from __future__ import annotations

import numpy as np

from calibration.adjustment.camera import Interior
from calibration.adjustment.initialisation.resection import placed_candidates
from geometry.arrays import Floats, Ints
from geometry.camera import LensModel, perspective

EDGES_RAD = np.linspace(0.3, 1.5, 17)
"""Angles off the axis at which the outermost target is tried: 17 to 86 degrees."""

MAX_VIEWS = 8
LEAST_POINTS = 6
SAMPLES = 60
EQUIDISTANT = np.zeros(4)


def fisheye_start(views: list[tuple[Floats, Floats]], size_px: tuple[int, int]) -> Interior | None:
    """An equidistant lens from views of known carriers, (points (n, 3), pixels (n, 2)) each.

    Of all focal lengths the one under which each carrier, placed by itself, fits best. None where
    no view has points enough.
    """
    usable = [v for v in sorted(views, key=lambda v: -len(v[0])) if len(v[0]) >= LEAST_POINTS]
    usable = usable[:MAX_VIEWS]
    if not usable:
        return None
    middle = (np.array(size_px) - 1.0) / 2.0
    reach = max(float(np.linalg.norm(pixels - middle, axis=1).max()) for _, pixels in usable)
    tried = [Interior(reach / edge, middle, EQUIDISTANT) for edge in EDGES_RAD]
    misfits = [float(np.mean([_misfit_px(i, *v) for v in usable])) for i in tried]
    best = int(np.argmin(misfits))
    return tried[best] if np.isfinite(misfits[best]) else None


def _misfit_px(interior: Interior, points_mm: Floats, pixels: Floats) -> float:
    """Median misfit of a carrier's points (n, 3) where it fits best, pixels; at most huge."""
    worst = float(np.ptp(pixels))
    found = [worst]
    for placed in placed_candidates(points_mm, interior.normalised(pixels)):
        local = points_mm @ placed.rotation.T + placed.translation_mm
        there = interior.pixels(perspective(local))
        off = np.linalg.norm(np.where(np.isfinite(there), there, np.inf) - pixels, axis=1)
        found.append(float(np.median(off)))
    return min(found)


def as_lens(interior: Interior, lens: LensModel, size_px: tuple[int, int] | Ints) -> Interior:
    """The same lens as nearly as another model can say it within the picture (radial terms)."""
    if interior.lens_model is lens:
        return interior
    if lens is LensModel.RATIONAL and interior.lens_model is LensModel.BROWN:
        return _with(interior, np.concatenate([interior.distortion, np.zeros(3)]))
    edge = interior.principal_point_px + np.array([np.hypot(*size_px) / 2.0, 0.0])
    across = np.linspace(interior.principal_point_px, edge, SAMPLES)[1:]
    radius = interior.normalised(across)[:, 0]
    seen = np.isfinite(radius)
    bent = (across[seen, 0] - interior.principal_point_px[0]) / interior.focal_length_px
    base = np.arctan(radius[seen]) if lens is LensModel.FISHEYE else radius[seen]
    count = 4 if lens is LensModel.FISHEYE else 3
    powers = base[:, None] ** (2 * np.arange(count) + 3)
    terms = np.linalg.lstsq(powers, bent - base, rcond=None)[0]
    if lens is LensModel.FISHEYE:
        return _with(interior, terms)
    brown = np.array([terms[0], terms[1], 0.0, 0.0, terms[2]])
    return as_lens(_with(interior, brown), lens, size_px)


def _with(interior: Interior, terms: Floats) -> Interior:
    return Interior(interior.focal_length_px, interior.principal_point_px, terms, interior.affinity)
