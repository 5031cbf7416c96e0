"""The wedge as a mesh, and whether it prints without support."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from common.errors import InputError, InternalError
from geometry.arrays import Floats
from rig.build.mounts.structure import Wedge
from rig.build.wedges.engraving import ENGRAVED_MM, engravings
from rig.build.wedges.recipe import Bearing, PrintPart, Recess, engraved, screw_cuts
from rig.build.wedges.shape import BED_MM, LEAST_BED_MM2, WedgeShape, shapes_of, stands
from rig.catalogue.catalogue import Catalogue

if TYPE_CHECKING:
    import trimesh
    from manifold3d import CrossSection, Manifold

BEARING_SHARE = 0.6
"""Share of a screw head's ring that must be there: a head on less digs in and tilts."""

WHOLE_LETTERS = 0.98
"""Share of a name that must meet material; what is missing lies over a hole."""

LARGEST_OVERHANG_DEG = 60.0
SLIVER_MM2 = 1e-4
"""Smaller triangles say nothing: their normals are rounding."""


def print_part(wedge: Wedge, catalogue: Catalogue) -> PrintPart:
    """How to print a wedge: the lightest shape that stands, needs no support and holds its screws.

    :class:`InputError` when there is none, or when the camera's name does not fit on it.
    """
    problems: list[InputError] = []
    for shape in shapes_of(wedge):
        try:
            return _printed(wedge, shape, catalogue)
        except InputError as error:
            problems.append(error)
    raise problems[0]


def _printed(wedge: Wedge, shape: WedgeShape, catalogue: Catalogue) -> PrintPart:
    """The recipe of a wedge in one shape."""
    cuts, bearings = screw_cuts(wedge, shape, catalogue)
    solid = _carved(shape.corners_mm, cuts)
    _check_bearings(wedge.id, bearings, solid)
    _check_overhang(wedge.id, solid)
    _check_stands(wedge.id, solid)
    rig_from_print = wedge.rig_from_base @ np.linalg.inv(shape.print_from_base)
    for place in engravings(wedge.camera, shape.corners_mm):
        name = engraved(place)
        letters = _cross_section(name.outlines_mm).area() * ENGRAVED_MM
        if (solid ^ _cut_solid(name)).volume() >= WHOLE_LETTERS * letters:
            return PrintPart(
                wedge.id,
                wedge.camera,
                shape.corners_mm,
                (*cuts, name),
                place.letters_mm,
                rig_from_print,
            )
    raise InputError(
        "wedge-name",
        f"the name {wedge.camera!r} does not fit on wedge {wedge.id}",
        "give the camera a shorter name",
    )


def wedge_mesh(part: PrintPart) -> trimesh.Trimesh:
    """The watertight mesh of a wedge in its print frame, millimetres.

    :class:`InternalError` when it is not closed, would need support or would not stand.
    """
    mesh = _mesh(_carved(part.corners_mm, part.cuts))
    if not (mesh.is_watertight and mesh.volume > 0.0):
        raise InternalError(
            "wedge-mesh", f"the mesh of wedge {part.name} is not closed", "report the plan"
        )
    if overhang_deg(mesh) > LARGEST_OVERHANG_DEG:
        raise InternalError(
            "wedge-overhang", f"wedge {part.name} would need support", "report the plan"
        )
    if not stands_on_bed(mesh):
        raise InternalError(
            "wedge-bed", f"wedge {part.name} would not stand on the bed", "report the plan"
        )
    return mesh


def _carved(corners_mm: Floats, cuts: tuple[Recess, ...]) -> Manifold:
    from manifold3d import Manifold, OpType

    body = Manifold.hull_points(np.ascontiguousarray(corners_mm))
    return Manifold.batch_boolean([body, *map(_cut_solid, cuts)], OpType.Subtract)


def _cross_section(outlines: tuple[Floats, ...]) -> CrossSection:
    from manifold3d import CrossSection, FillRule

    return CrossSection([np.ascontiguousarray(o) for o in outlines], FillRule.NonZero)


def _cut_solid(cut: Recess) -> Manifold:
    from manifold3d import Manifold

    share = (cut.end_share, cut.end_share)
    solid = Manifold.extrude(_cross_section(cut.outlines_mm), cut.depth_mm, scale_top=share)
    return solid.transform(np.ascontiguousarray(cut.print_from_cut[:3]))


def _check_bearings(wedge_id: str, bearings: tuple[Bearing, ...], solid: Manifold) -> None:
    from manifold3d import Manifold

    for ring in bearings:
        disk = Manifold.cylinder(0.2, ring.outer_mm) - Manifold.cylinder(0.2, ring.inner_mm)
        placed = disk.transform(np.ascontiguousarray(ring.print_from_ring[:3]))
        if (placed ^ solid).volume() < BEARING_SHARE * disk.volume():
            raise InputError(
                "wedge-screw",
                f"{ring.what} of wedge {wedge_id} has nothing to press on",
                "move the hole, or make base or seat larger",
            )


def _check_overhang(wedge_id: str, solid: Manifold) -> None:
    """A screw head's seat leans with the wedge, and may face the bed where the outside does not."""
    if overhang_deg(_mesh(solid)) > LARGEST_OVERHANG_DEG:
        raise InputError(
            "wedge-shape",
            f"wedge {wedge_id} cannot be printed without support: its seat leans too far",
            "turn the camera, or its post",
        )


def _check_stands(wedge_id: str, solid: Manifold) -> None:
    """Holes and pockets may take the face away that a wedge would stand on."""
    if not stands_on_bed(_mesh(solid)):
        raise InputError(
            "wedge-bed",
            f"wedge {wedge_id} cannot be printed: with its holes it has no face to stand on",
            "make the base larger or turn it with the camera",
        )


def stands_on_bed(mesh: trimesh.Trimesh) -> bool:
    """Whether a part, z up, has a flat face on the bed and its centre of mass well inside it."""
    on_bed = (mesh.vertices[mesh.faces][:, :, 2] < BED_MM).all(axis=1)
    face_mm2 = float(mesh.area_faces[on_bed].sum())
    return face_mm2 >= LEAST_BED_MM2 and stands(mesh.vertices, mesh.center_mass)


def _mesh(solid: Manifold) -> trimesh.Trimesh:
    import trimesh

    raw = solid.to_mesh64()
    return trimesh.Trimesh(raw.vert_properties[:, :3], raw.tri_verts, process=False)


def overhang_deg(mesh: trimesh.Trimesh, up: Floats | None = None) -> float:
    """Steepest overhang of a mesh: angle from the vertical of its down-facing surfaces, degrees.

    0 is an upright wall, 90 a level ceiling; what lies on the bed does not count. ``up`` (3,) is
    the direction of printing, +z unless given. 0 where nothing faces down.
    """
    direction = np.array([0.0, 0.0, 1.0]) if up is None else np.asarray(up) / np.linalg.norm(up)
    heights = mesh.vertices @ direction
    on_bed = (heights[mesh.faces] < heights.min() + BED_MM).all(axis=1)
    falls = -(mesh.face_normals @ direction)
    counted = falls[~on_bed & (mesh.area_faces > SLIVER_MM2)]
    return float(np.degrees(np.arcsin(np.clip(counted.max(initial=0.0), 0.0, 1.0))))


def wedge_corners_mm(wedge: Wedge) -> Floats:
    """Corners (K, 3) in the rig frame of the lightest convex body the wedge is cut from."""
    shape = shapes_of(wedge)[0]
    rig_from_print = wedge.rig_from_base @ np.linalg.inv(shape.print_from_base)
    return np.asarray(shape.corners_mm @ rig_from_print[:3, :3].T + rig_from_print[:3, 3])
