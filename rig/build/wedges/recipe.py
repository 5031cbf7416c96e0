"""What a printed wedge is made of: a convex body, and what is cut out of it.

The recipe is the same for the mesh and for STEP; both only carry it out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats
from rig.build.mounts.structure import Hole, Wedge
from rig.build.wedges.engraving import ENGRAVED_MM, Engraving
from rig.build.wedges.fastenings import Room, room_for
from rig.build.wedges.shape import FLANGE_MM, SEAT_MM, WedgeShape
from rig.catalogue.catalogue import Catalogue

CLEARANCE_MM = 0.6
"""By how much a pocket is wider than what goes in: printed holes come out a little small."""

NUT_CLEARANCE_MM = 0.3
SIDES = 64
BEYOND_MM = 1.0
ORIENTATION = "as the file lies: on a side of the base, base and seat upright"


@dataclass(frozen=True, eq=False)
class Recess:
    """Outlines extruded along z of ``print_from_cut`` (4, 4) from 0 to ``depth_mm``.

    ``radius_mm`` of a round hole (its outline then has a roof as well); ``end_share`` scales the
    outline at the far end, for the cone of a countersunk head.
    """

    print_from_cut: Floats
    outlines_mm: tuple[Floats, ...]
    depth_mm: float
    radius_mm: float | None = None
    end_share: float = 1.0


@dataclass(frozen=True, eq=False)
class Bearing:
    """A ring that a head or nut presses on: it must be there when the part is printed."""

    print_from_ring: Floats
    inner_mm: float
    outer_mm: float
    what: str


@dataclass(frozen=True, eq=False)
class PrintPart:
    """A wedge as it is printed: z up from the bed, millimetres.

    ``corners_mm`` (K, 3) of its convex body; ``rig_from_print`` (4, 4) puts it where it belongs.
    ``orientation`` says in words how it lies.
    """

    name: str
    camera: str
    corners_mm: Floats
    cuts: tuple[Recess, ...]
    letters_mm: float
    rig_from_print: Floats
    orientation: str = ORIENTATION


def screw_cuts(
    wedge: Wedge, shape: WedgeShape, catalogue: Catalogue
) -> tuple[tuple[Recess, ...], tuple[Bearing, ...]]:
    """All holes and pockets of a wedge, and what has to be left under heads and nuts."""
    reach = float(np.linalg.norm(np.ptp(shape.corners_mm, axis=0))) + BEYOND_MM
    found = [_camera_screw(wedge, shape, room_for(wedge.screw, catalogue), reach)]
    found += [_base_hole(hole, shape, catalogue, reach) for hole in wedge.base_holes]
    return tuple(cut for cuts, _ in found for cut in cuts), tuple(ring for _, ring in found)


def engraved(place: Engraving) -> Recess:
    """The cut that a name makes."""
    start = _moved(place.print_from_face, -ENGRAVED_MM)
    return Recess(start, place.outlines_mm, ENGRAVED_MM + BEYOND_MM)


def _hole_frame(at_print_mm: Floats, axis_print: Floats) -> Floats:
    """A frame (4, 4) with z along the axis and y as far up as can be, so that roofs point up."""
    axis = axis_print / np.linalg.norm(axis_print)
    up = np.array([0.0, 0.0, 1.0]) - axis[2] * axis
    up = up / np.linalg.norm(up)
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack([np.cross(up, axis), up, axis])
    matrix[:3, 3] = at_print_mm
    return matrix


def _moved(frame: Floats, along_mm: float) -> Floats:
    moved = np.array(frame)
    moved[:3, 3] += along_mm * frame[:3, 2]
    return moved


def teardrop(radius_mm: float) -> Floats:
    """A circle with a roof of 45 degrees towards +y, (N, 2): prints level without support."""
    angles = np.radians(np.linspace(135.0, 405.0, round(0.75 * SIDES) + 1))
    round_part = radius_mm * np.column_stack([np.cos(angles), np.sin(angles)])
    return np.concatenate([round_part, [[0.0, radius_mm * np.sqrt(2.0)]]])


def hexagon(across_flats_mm: float) -> Floats:
    """A hexagon with upright flats and a roof of 45 degrees, (6, 2)."""
    half = across_flats_mm / 2.0
    side = half / np.sqrt(3.0)
    corners = [[half, side], [0.0, side + half], [-half, side], [-half, -side], [0.0, -2.0 * side]]
    return np.array([*corners, [half, -side]])


def _round(frame: Floats, radius_mm: float, depth_mm: float) -> Recess:
    return Recess(frame, (teardrop(radius_mm),), depth_mm, radius_mm)


def _camera_screw(
    wedge: Wedge, shape: WedgeShape, room: Room, reach_mm: float
) -> tuple[list[Recess], Bearing]:
    """The hole through the seat, and behind it the way for the screw's head and its key."""
    print_from_seat = shape.print_from_base @ wedge.base_from_seat
    frame = _hole_frame(print_from_seat[:3, 3], -print_from_seat[:3, 2])
    radius, head = wedge.screw_hole_mm / 2.0, room.head_diameter_mm / 2.0
    hole = _round(_moved(frame, -BEYOND_MM), radius, SEAT_MM + 2.0 * BEYOND_MM)
    recess = _round(_moved(frame, SEAT_MM), head + CLEARANCE_MM / 2.0, reach_mm)
    ring = Bearing(_moved(frame, SEAT_MM - BEYOND_MM), radius, head, "the camera screw")
    return [hole, recess], ring


def _base_hole(
    hole: Hole, shape: WedgeShape, catalogue: Catalogue, reach_mm: float
) -> tuple[list[Recess], Bearing]:
    """A hole through the base, and above it room for what ``hole.kind`` says.

    ``through``: a cap screw's head; ``countersunk``: a countersunk one; ``tapped``: a hexagon
    nut, the screw comes through the plate from behind.
    """
    at = shape.print_from_base @ np.array([hole.x_mm, hole.y_mm, 0.0, 1.0])
    frame = _hole_frame(at[:3], shape.print_from_base[:3, 2])
    room = room_for(hole.thread or f"M{np.floor(hole.diameter_mm):g}", catalogue)
    radius, head = hole.diameter_mm / 2.0, room.head_diameter_mm / 2.0
    top = _moved(frame, FLANGE_MM)
    cuts = [_round(_moved(frame, -BEYOND_MM), radius, FLANGE_MM + 2.0 * BEYOND_MM)]
    outer = head
    if hole.kind == "tapped":
        flats = room.across_flats_mm + NUT_CLEARANCE_MM
        # The nut lies as deep as a head would: its pocket is what keeps it from turning.
        cuts.append(Recess(top, (hexagon(flats),), room.nut_height_mm + NUT_CLEARANCE_MM))
        head, outer = flats / np.sqrt(3.0), room.across_flats_mm / 2.0
        top = _moved(top, room.nut_height_mm)
    elif hole.kind == "countersunk":
        depth = head - radius
        share = (head + CLEARANCE_MM / 2.0) / radius
        cuts.append(Recess(_moved(top, -depth), (teardrop(radius),), depth + 1e-3, None, share))
        outer = radius + 0.5
    cuts.append(_round(top, head + CLEARANCE_MM / 2.0, reach_mm))
    ring = Bearing(_moved(frame, BEYOND_MM), radius, outer, f"base screw {hole.label}".strip())
    return cuts, ring
