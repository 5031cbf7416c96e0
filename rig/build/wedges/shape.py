"""The outer shape of a wedge, and how it lies on the printer's bed.

The wedge is the convex hull of a slab on its base and a slab under its seat. It is printed lying
on a side of its base: base and seat then stand nearly upright, layers run from one to the other
and do not split there, and screw holes run nearly level.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats
from rig.build.mounts.structure import Wedge

if TYPE_CHECKING:
    from manifold3d import Manifold

FLANGE_MM = 6.0
"""Material under the head of a base screw."""

SEAT_MM = 6.0
"""Material under the head of the camera screw: a 1/4-20 screw of 12 mm reaches 6 mm beyond."""

STEEPEST_DEG = 58.0
"""Overhang allowed to the outer shape: 60 degrees is what the printer is held to."""

LEAST_MM3 = 500.0
BED_MM = 0.01
LEAST_BED_MM2 = 150.0
"""Flat face on the bed: a square of 12 mm holds a part of this size to it."""

STANDS_SHARE = 0.1
"""How far inside its bed face a part's centre of mass lies, as a share of its height: it then
stands by itself on a bed that leans by 5.7 degrees, and a nozzle does not tip it."""


@dataclass(frozen=True, eq=False)
class WedgeShape:
    """``print_from_base`` (4, 4): z up from the bed. ``corners_mm`` (K, 3) in the print frame."""

    print_from_base: Floats
    corners_mm: Floats
    volume_mm3: float


def shapes_of(wedge: Wedge) -> list[WedgeShape]:
    """The ways to print a wedge that stand by themselves and need no support on the outside.

    The lightest first. :class:`InputError` when base and seat cannot be joined.
    """
    upright = [shape for shape in _candidates(wedge) if _steepest_deg(shape) <= STEEPEST_DEG]
    if not upright:
        raise InputError(
            "wedge-shape",
            f"wedge {wedge.id} cannot be printed: its seat leans too far over its base",
            "make the base larger or turn it with the camera",
        )
    found = [shape for shape in upright if stands(shape.corners_mm, _centre_of_mass(shape))]
    if not found:
        raise InputError(
            "wedge-bed",
            f"wedge {wedge.id} cannot be printed: it has no face to stand on by itself",
            "make the base larger or turn it with the camera",
        )
    return sorted(found, key=lambda shape: shape.volume_mm3)


def stands(on_bed_mm: Floats, centre_mm: Floats) -> bool:
    """Whether a part stands by itself on those of its points (N, 3) that are on the bed, z = 0.

    Its centre of mass (3,) must lie well inside a face of some area.
    """
    from scipy.spatial import ConvexHull, QhullError

    flat = on_bed_mm[on_bed_mm[:, 2] < BED_MM][:, :2]
    try:
        face = ConvexHull(flat)
    except (QhullError, ValueError):
        # A corner or an edge: nothing to stand on.
        return False
    inside = -(face.equations[:, :2] @ centre_mm[:2] + face.equations[:, 2]).max()
    # Of a flat hull the "volume" is its area.
    return bool(face.volume >= LEAST_BED_MM2 and inside >= STANDS_SHARE * centre_mm[2])


def _centre_of_mass(shape: WedgeShape) -> Floats:
    import trimesh

    return np.asarray(trimesh.convex.convex_hull(shape.corners_mm).center_mass)


def _candidates(wedge: Wedge) -> Iterator[WedgeShape]:
    """On each of the four sides of the base, as it is and with the seat let down to the bed."""
    corners = _corners(wedge)
    base = np.array([0.0, 0.0, 1.0])
    for up in np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]]):
        axes = np.array([np.cross(base, up), base, up])
        placed = corners @ axes.T
        bed = placed[:, 2].min()
        dropped = placed.copy()
        dropped[:, 2] = bed
        for points in (placed, np.concatenate([placed, dropped])):
            solid = _trimmed(points, axes, wedge)
            vertices = solid.to_mesh64().vert_properties[:, :3]
            # The seat's plane may have cut off what was lowest.
            lowest = vertices[:, 2].min()
            matrix = np.eye(4)
            matrix[:3, :3], matrix[2, 3] = axes, -lowest
            vertices = vertices - [0.0, 0.0, lowest]
            yield WedgeShape(matrix, vertices, solid.volume())


def _corners(wedge: Wedge) -> Floats:
    """Corners (16, 3) of both slabs in the base frame."""
    base = _slab(wedge.base_size_mm, 0.0, FLANGE_MM)
    seat = _slab(wedge.seat_size_mm, -SEAT_MM, 0.0)
    matrix = wedge.base_from_seat
    return np.concatenate([base, seat @ matrix[:3, :3].T + matrix[:3, 3]])


def _slab(size_mm: tuple[float, float], low: float, high: float) -> Floats:
    x, y = size_mm[0] / 2.0, size_mm[1] / 2.0
    return np.array([[i, j, k] for i in (-x, x) for j in (-y, y) for k in (low, high)])


def _trimmed(points: Floats, axes: Floats, wedge: Wedge) -> Manifold:
    """The hull, cut off at the base plane and at the seat plane."""
    from manifold3d import Manifold

    normal = axes @ wedge.base_from_seat[:3, 2]
    reach = float(normal @ (axes @ wedge.base_from_seat[:3, 3]))
    solid = Manifold.hull_points(np.ascontiguousarray(points))
    solid = solid.trim_by_plane((0.0, 1.0, 0.0), 0.0).trim_by_plane(tuple(-normal), -reach)
    if solid.volume() < LEAST_MM3:
        raise InputError(
            "wedge-shape",
            f"wedge {wedge.id} has its seat below its base",
            "raise the seat above the plate or profile",
        )
    return solid


def facets(corners_mm: Floats) -> list[tuple[Floats, Floats]]:
    """Faces of a convex solid: outward unit normal (3,) and corners (N, 3) of each."""
    from scipy.spatial import ConvexHull

    planes = np.unique(np.round(ConvexHull(corners_mm).equations, 6), axis=0)
    out = []
    for plane in planes:
        on = np.abs(corners_mm @ plane[:3] + plane[3]) < 1e-3
        if on.sum() >= 3:
            out.append((plane[:3], corners_mm[on]))
    return out


def _steepest_deg(shape: WedgeShape) -> float:
    """Overhang of the outer shape."""
    falls = [
        -normal[2] for normal, corners in facets(shape.corners_mm) if corners[:, 2].max() > BED_MM
    ]
    return float(np.degrees(np.arcsin(np.clip(max(falls), 0.0, 1.0))))
