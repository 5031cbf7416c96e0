"""Sampling of surfaces: area-uniform points, voxel downsampling with normals."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from geometry.arrays import Floats, Ints
from geometry.scan import Scan
from geometry.surface import SurfacePoints

_SEARCH_STEPS = 24


def surface_samples(scan: Scan, count: int, seed: int) -> SurfacePoints:
    """About ``count`` points spread evenly over the area, with smooth normals.

    Independent of the tessellation: large triangles get more points than small ones. A cloud
    gives its own points.
    """
    if scan.is_cloud:
        return SurfacePoints(scan.vertices_mm, scan.normals)
    rng = np.random.default_rng(seed)
    corners = scan.vertices_mm[scan.faces]
    areas = 0.5 * np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    # Systematic sampling: equal steps along the summed area, so that no region is over-drawn.
    total = np.cumsum(areas)
    picks = (np.arange(count) + rng.random()) * total[-1] / count
    face = np.minimum(np.searchsorted(total, picks), len(areas) - 1)
    u, v = rng.random(count), rng.random(count)
    flip = u + v > 1.0
    u, v = np.where(flip, 1.0 - u, u), np.where(flip, 1.0 - v, v)
    weights = np.stack([1.0 - u - v, u, v], axis=1)
    points = np.einsum("nk,nkm->nm", weights, corners[face])
    normals = np.einsum("nk,nkm->nm", weights, scan.normals[scan.faces[face]])
    # Normals that cancel out on a crease leave the facet's own.
    weak = np.linalg.norm(normals, axis=1) < 1e-6
    normals[weak] = scan.normals[scan.faces[face[weak], 0]]
    return SurfacePoints(points, normals)


def spread(vertices: Floats, faces: Ints, normals: Floats, count: int = 25_000) -> SurfacePoints:
    """About ``count`` points spread evenly by area in the unit of ``vertices`` (V, 3).

    Normals are the faces' own. A cloud gives some of its points, with their ``normals`` (V, 3).
    """
    if len(faces) == 0:
        step = max(1, len(vertices) // (2 * count))
        return SurfacePoints(vertices[::step], normals[::step])
    rng = np.random.default_rng(0)
    corners = vertices[faces]
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(doubled, axis=1)
    total = np.cumsum(area)
    face = np.searchsorted(total, (np.arange(count) + 0.5) / count * total[-1])
    u, v = rng.random((2, count))
    flip = u + v > 1.0
    u, v = np.where(flip, 1.0 - u, u), np.where(flip, 1.0 - v, v)
    weights = np.stack([1.0 - u - v, u, v], axis=1)
    points = np.einsum("nk,nkm->nm", weights, corners[face])
    return SurfacePoints(points, doubled[face] / area[face, None])


def _voxels(points_mm: Floats, voxel_mm: float) -> tuple[Ints, int]:
    """The number of each point's voxel (n,), and how many voxels are occupied."""
    cell = np.floor((points_mm - points_mm.min(axis=0)) / voxel_mm).astype(np.int64)
    size = cell.max(axis=0) + 1
    key = (cell[:, 0] * size[1] + cell[:, 1]) * size[2] + cell[:, 2]
    found, number = np.unique(key, return_inverse=True)
    return number, len(found)


def voxel_downsample(points: SurfacePoints, voxel_mm: float) -> SurfacePoints:
    """One point per occupied voxel: the paper's uniform sampling (section 2.1).

    The mean of a voxel's points lies off a curved surface, where ray casting would call it
    hidden or floating; so the sample nearest to the mean stands for the voxel, with the mean
    normal.
    """
    number, count = _voxels(points.points_mm, voxel_mm)
    share = np.bincount(number, minlength=count)[:, None]
    mean = (
        np.stack([np.bincount(number, points.points_mm[:, k], count) for k in range(3)], axis=1)
        / share
    )
    normal = (
        np.stack([np.bincount(number, points.normals[:, k], count) for k in range(3)], axis=1)
        / share
    )
    nearest = np.asarray(cKDTree(points.points_mm).query(mean)[1])
    weak = np.linalg.norm(normal, axis=1) < 0.1
    normal[weak] = points.normals[nearest[weak]]
    return SurfacePoints(points.points_mm[nearest], normal)


def voxel_size_for(points: SurfacePoints, count: int) -> float:
    """The voxel edge, mm, that leaves about ``count`` points; found by bisection."""
    extent = float(np.ptp(points.points_mm, axis=0).max())
    low, high = extent / (4.0 * count + 16.0), 2.0 * extent
    for _ in range(_SEARCH_STEPS):
        middle = float(np.sqrt(low * high))
        if _voxels(points.points_mm, middle)[1] > count:
            low = middle
        else:
            high = middle
    return high
