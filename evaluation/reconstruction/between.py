"""More patches where points lie thin: between those of a map, and a step beyond its rims.

Where few cameras see a surface, or at a slant, the grid of one picture leaves gaps that its pixels
need not leave. Places for patches are guessed on the planes of their neighbours, and those are
taken that no point is near to: each gap once, in the picture that shows most of it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from evaluation.reconstruction.depthmaps import DepthMap, Matching, bend, matched
from evaluation.reconstruction.fusion import MeasuredPoints, points_of
from evaluation.reconstruction.views import View
from geometry.arrays import Bools, Floats

Ints = NDArray[np.int64]

STEP_PX = 2.0
"""How far a patch may be from the plane of its neighbour, in pixels of the widest companion."""


def guesses(map_: DepthMap, thin: Bools, least_mm: float) -> tuple[MeasuredPoints, Floats]:
    """Places between the patches of the cells ``thin`` (h, w), and beyond the rims of all.

    Only those that are farther than ``least_mm`` from the patch on whose plane they lie. Beside
    them that plane: inverse depth and slopes there (N, 3).
    """
    known = np.isfinite(map_.inverse_depth_per_mm)
    half = map_.stride_px // 2
    _, (iy, ix) = ndimage.distance_transform_edt(~known, return_indices=True)
    rim = np.nonzero(ndimage.maximum_filter(known, 3) & ~known)
    cells = np.nonzero(thin & known)
    offsets = [(half, half), (half, 0), (0, half)] if half else []
    pixels = np.concatenate([_pixels(map_, *rim)] + [_pixels(map_, *cells) + o for o in offsets])
    near = tuple(
        np.concatenate([of_rim[rim], *[at] * len(offsets)])
        for of_rim, at in zip((iy, ix), cells, strict=True)
    )
    slopes, from_ = map_.slopes[near], _pixels(map_, *near)
    begin = map_.inverse_depth_per_mm[near]
    rho = begin + np.einsum("ij,ij->i", slopes, pixels - from_)
    places = _placed(map_, pixels, rho, slopes)
    apart = places.points_mm - _placed(map_, from_, begin, slopes).points_mm
    far = (np.linalg.norm(apart, axis=1) > least_mm) & (rho > 0.0) & (places.per_mm2 > 0.0)
    return places.subset(far), np.column_stack([rho, slopes])[far]


def _pixels(map_: DepthMap, rows: Ints, columns: Ints) -> Ints:
    return np.column_stack([columns, rows]) * map_.stride_px


def _placed(map_: DepthMap, pixels: Ints, rho: Floats, slopes: Floats) -> MeasuredPoints:
    nothing = np.zeros(len(rho))
    return points_of(map_, pixels, rho, slopes, nothing, nothing.astype(np.int8))


def gaps(places: Sequence[MeasuredPoints], points_mm: Floats, least_mm: float) -> list[Bools]:
    """Which places fill gaps: farther than ``least_mm`` from every point, one in a cube of that.

    It is the one with most pixels to the square millimetre.
    """
    tree = cKDTree(points_mm)
    free = [~np.isfinite(tree.query(p.points_mm, distance_upper_bound=least_mm)[0]) for p in places]
    chosen = np.concatenate(free)
    at = np.concatenate([p.points_mm for p in places])[chosen]
    dense = np.concatenate([p.per_mm2 for p in places])[chosen]
    best_first = np.argsort(-dense, kind="stable")
    cubes = np.floor(at[best_first] / least_mm).astype(np.int64)
    _, first = np.unique(cubes @ np.array([1 << 42, 1 << 21, 1]), return_index=True)
    taken = np.zeros(len(at), dtype=bool)
    taken[best_first[first]] = True
    chosen[chosen] = taken
    return np.split(chosen, np.cumsum([len(p.points_mm) for p in places])[:-1])


def filled(
    map_: DepthMap,
    others: Sequence[View],
    pixels: Ints,
    planes: Floats,
    matching: Matching,
    scale_px_mm: float,
    steepest_deg: float,
) -> MeasuredPoints:
    """Patches at ``pixels`` (N, 2) from ``planes`` (N, 3) that matched and stayed near them.

    ``scale_px_mm`` as in :func:`.depthmaps.steady`; see :func:`.depthmaps.facing` for
    ``steepest_deg``.
    """
    found = matched(map_.reference, others, pixels, planes[:, 0], planes[:, 1:], matching)
    # Curvature as the map's own patches tell it: these lie too far apart.
    columns, rows = pixels.T // map_.stride_px
    rho = found[:, 0] - bend(map_, matching.half_width_samples)[rows, columns]
    good = np.abs(found[:, 0] - planes[:, 0]) * scale_px_mm <= STEP_PX
    views = np.nan_to_num(found[:, 5]).astype(np.int8)
    made = points_of(map_, pixels[good], rho[good], found[good, 1:3], found[good, 3], views[good])
    rays = made.points_mm - map_.reference.pose.position_rig_mm
    cosine = -np.einsum("ij,ij->i", made.normals, rays) / np.linalg.norm(rays, axis=1)
    return made.subset(cosine >= np.cos(np.radians(steepest_deg)))
