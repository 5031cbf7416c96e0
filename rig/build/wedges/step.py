"""The wedge as STEP for a CAD program, through the optional extra ``cad``."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats
from rig.build.wedges.recipe import PrintPart, Recess
from rig.build.wedges.shape import facets

if TYPE_CHECKING:
    from build123d import Face, Part, Plane, Solid


def wedge_step(part: PrintPart) -> bytes:
    """The wedge as STEP, millimetres, in its print frame; round holes are true cylinders.

    :class:`InputError` when the extra ``cad`` is not installed.
    """
    try:
        import build123d as cad
    except ImportError as error:
        raise InputError(
            "step-missing",
            "STEP files need the extra `cad`, which is not installed",
            "run `pip install rigwright[cad]`, or take STL or 3MF",
        ) from error
    solid = _body(part)
    solid = solid.cut(*(_cut_solid(cut) for cut in part.cuts)).solids()[0]
    solid.label = part.name
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "part.step"
        cad.export_step(solid, str(path), unit=cad.Unit.MM, timestamp="2000-01-01T00:00:00")
        return path.read_bytes()


def _body(part: PrintPart) -> Solid:
    """The convex body: a block that every face's plane cuts off."""
    import build123d as cad

    low, high = part.corners_mm.min(axis=0), part.corners_mm.max(axis=0)
    size, middle = high - low + 2.0, (low + high) / 2.0
    block = cad.Solid.make_box(*size, cad.Plane(tuple(middle - size / 2.0)))
    for normal, corners in facets(part.corners_mm):
        plane = cad.Plane(origin=tuple(corners[0]), z_dir=tuple(normal))
        block = block.split(plane, keep=cad.Keep.BOTTOM)
    return block


def _plane(cut: Recess) -> Plane:
    import build123d as cad

    matrix = cut.print_from_cut
    return cad.Plane(
        origin=tuple(matrix[:3, 3]), x_dir=tuple(matrix[:3, 0]), z_dir=tuple(matrix[:3, 2])
    )


def _cut_solid(cut: Recess) -> Part:
    import build123d as cad

    plane = _plane(cut)
    if cut.radius_mm is None:
        return _extruded(plane, cut)
    radius = cut.radius_mm
    drill = plane * cad.Pos(0, 0, cut.depth_mm / 2.0) * cad.Cylinder(radius, cut.depth_mm)
    side = radius / np.sqrt(2.0)
    roof = [(-side, side), (0.0, 0.0), (side, side), (0.0, radius * np.sqrt(2.0))]
    wire = cad.Polyline(*roof, close=True)
    return drill + cad.extrude(plane * cad.make_face(wire.edges()), cut.depth_mm, dir=plane.z_dir)


def _extruded(plane: Plane, cut: Recess) -> Part:
    """Any other outlines: those that run clockwise are solid letters' borders, or all of one."""
    import build123d as cad

    faces = [_face(outline) for outline in cut.outlines_mm]
    if cut.end_share != 1.0:
        far = cad.Pos(0, 0, cut.depth_mm) * _face(cut.outlines_mm[0] * cut.end_share)
        return plane * cad.loft([faces[0], far], ruled=True)
    turns = [_turn(outline) for outline in cut.outlines_mm]
    # A typeface runs outer borders one way and holes the other; the first border is an outer one.
    outer = [face for face, turn in zip(faces, turns, strict=True) if turn * turns[0] > 0.0]
    holes = [face for face, turn in zip(faces, turns, strict=True) if turn * turns[0] < 0.0]
    solids = [cad.extrude(plane * face, cut.depth_mm, dir=plane.z_dir) for face in outer]
    whole = solids[0].fuse(*solids[1:]) if len(solids) > 1 else solids[0]
    for face in holes:
        whole = whole - cad.extrude(plane * face, cut.depth_mm, dir=plane.z_dir)
    return whole


def _face(outline: Floats) -> Face:
    import build123d as cad

    wire = cad.Polyline(*((float(x), float(y)) for x, y in outline), close=True)
    return cad.make_face(wire.edges())


def _turn(outline: Floats) -> float:
    x, y = outline.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
