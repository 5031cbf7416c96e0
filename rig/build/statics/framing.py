"""The frame of beams that a structure is: members, the joints between them, plates, feet.

Joints, heads, wedges and cameras are taken as rigid, profiles as beams along their middle lines,
a plate as a grid of strips. A structure stands on the levelling feet under its feet, or on the ends
of these; what is run down under an upright may come off the floor, and is not counted on.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats
from rig.build.mounts.structure import Joint, Member, Plate, Structure, levelling_feet
from rig.build.statics.beams import Beam, Frame, Section
from rig.build.statics.materials import RIGID, member_section, strip_section
from rig.catalogue import Catalogue

LONGEST_MM = 250.0
"""Beams are divided so finely that the sag between two nodes is a hundredth of a millimetre:
5 w L^4 / 384 EI of the lightest profile, 5 N/m and 490 N m2, is 0.5 micrometres."""

STRIP_MM = 100.0
SAME_MM = 1e-3
FOOT = "foot"
EDGE_HOLES = ("S1", "S2", "S3", "S4")
"""Holes by which a plate is screwed to its uprights."""


@dataclass
class _Nodes:
    """Places of nodes, and which node of each member lies how far along it."""

    places: list[Floats] = field(default_factory=list)
    along: dict[str, dict[float, int]] = field(default_factory=dict)

    def add(self, place_mm: Floats) -> int:
        self.places.append(np.asarray(place_mm, dtype=np.float64))
        return len(self.places) - 1

    def on(self, member: Member, along_mm: float) -> int:
        """The node so far along a member, a new one where there is none."""
        mine = self.along.setdefault(member.id, {})
        for other, node in mine.items():
            if abs(other - along_mm) < SAME_MM:
                return node
        mine[along_mm] = self.add(_at(member, along_mm))
        return mine[along_mm]


@dataclass(frozen=True, eq=False)
class StructureFrame:
    """A structure as a frame. ``places_mm`` (N, 3) of its nodes.

    ``node_of_joint``: by joint id and the id of the member or plate that it is on.
    """

    frame: Frame
    places_mm: Floats
    node_of_joint: dict[tuple[str, str], int]


def frame_of(structure: Structure, catalogue: Catalogue) -> StructureFrame:
    """The frame of a structure; :class:`InputError` for one that cannot stand."""
    nodes, members = _Nodes(), {m.id: m for m in structure.members}
    plates = {p.id: p for p in structure.plates}
    beams: list[Beam] = []
    grids = {p.id: _grid(p, nodes, beams) for p in structure.plates}
    feet = _feet(structure, nodes)
    if not feet:
        raise InputError("frame-feet", "the structure has no feet", "plan it with a mount that has")
    held: dict[tuple[str, str], int] = {}
    links: list[tuple[int, int]] = []
    for joint in structure.joints:
        ends = [_node(end, joint, members, grids, nodes) for end in (joint.on, joint.other)]
        held |= {
            (joint.id, end): node
            for end, node in zip((joint.on, joint.other), ends, strict=True)
            if node is not None
        }
        if None not in ends:
            links.append((int(ends[0] or 0), int(ends[1] or 0)))
        links += _edge_links(joint, members, plates, grids, nodes)
    for member in structure.members:
        section = member_section(member, catalogue)
        beams += _divided(member, section, nodes)
    same = {b: a for a, b in links if _apart(nodes, a, b) < SAME_MM}
    beams += [_link(nodes, a, b) for a, b in links if _apart(nodes, a, b) >= SAME_MM]
    beams = [Beam(same.get(b.start, b.start), same.get(b.end, b.end), b.section, b.across)
             for b in beams]  # fmt: skip
    held = {key: same.get(node, node) for key, node in held.items()}
    places = np.stack(nodes.places)
    supports: dict[int, tuple[int, ...]] = dict.fromkeys(feet, (0, 1, 2))
    # A node that became another's has no beam: it would be loose.
    supports |= {node: tuple(range(6)) for node in same}
    return StructureFrame(Frame(places, beams, supports), places, held)


def _node(
    end: str,
    joint: Joint,
    members: dict[str, Member],
    grids: dict[str, list[int]],
    nodes: _Nodes,
) -> int | None:
    """Where a joint holds a member or a plate; None for what hangs on these."""
    if end in members:
        member = members[end]
        return nodes.on(member, nearest_along(member, joint.point_mm))
    if end in grids:
        return _nearest(nodes, grids[end], joint.point_mm)
    return None


def _edge_links(
    joint: Joint,
    members: dict[str, Member],
    plates: dict[str, Plate],
    grids: dict[str, list[int]],
    nodes: _Nodes,
) -> Iterable[tuple[int, int]]:
    """A plate lies along its uprights: it is held at every screw through its edge."""
    member, plate = members.get(joint.on), plates.get(joint.other)
    if member is None or plate is None:
        return
    for hole in plate.holes:
        at = (plate.rig_from_plate @ np.array([hole.x_mm, hole.y_mm, 0.0, 1.0]))[:3]
        along = nearest_along(member, at)
        near = np.linalg.norm(_at(member, along) - at)
        if hole.label in EDGE_HOLES and near < plate.thickness_mm + max(member.size_mm):
            yield nodes.on(member, along), _nearest(nodes, grids[plate.id], at)


def _feet(structure: Structure, nodes: _Nodes) -> list[int]:
    """The nodes that a structure stands on."""
    feet = [m for m in structure.members if m.role.split()[-1] == FOOT]
    level = [
        nodes.on(member, nearest_along(member, joint.point_mm))
        for member, joint, _ in levelling_feet(structure)
        if member in feet
    ]
    return level or [nodes.on(foot, along) for foot in feet for along in (0.0, _length(foot))]


def _divided(member: Member, section: Section, nodes: _Nodes) -> list[Beam]:
    """A member as beams from joint to joint, none longer than asked."""
    for along in (0.0, _length(member)):
        nodes.on(member, along)
    stops = sorted(nodes.along[member.id])
    for low, high in itertools.pairwise(stops):
        count = int(np.ceil((high - low) / LONGEST_MM))
        for k in range(1, count):
            nodes.on(member, low + (high - low) * k / count)
    ordered = [node for _, node in sorted(nodes.along[member.id].items())]
    return [Beam(a, b, section, member.across) for a, b in itertools.pairwise(ordered)]


def _grid(plate: Plate, nodes: _Nodes, beams: list[Beam]) -> list[int]:
    """A plate as strips both ways, each as wide as the lines lie apart."""
    low, high = plate.outline_mm.min(axis=0), plate.outline_mm.max(axis=0)
    counts = np.ceil((high - low) / STRIP_MM).astype(int) + 1
    lines = [np.linspace(low[k], high[k], counts[k]) for k in (0, 1)]
    at = plate.rig_from_plate
    middle = -plate.thickness_mm / 2.0
    ids = np.array([
        [nodes.add((at @ np.array([x, y, middle, 1.0]))[:3]) for y in lines[1]] for x in lines[0]
    ])  # fmt: skip
    for axis, step in ((0, (1, 0)), (1, (0, 1))):
        count = counts[1 - axis]
        width = float(high[1 - axis] - low[1 - axis]) / (count - 1)
        for i, k in np.ndindex(int(counts[0] - step[0]), int(counts[1] - step[1])):
            outer = (k if axis == 0 else i) in (0, count - 1)
            section = strip_section(plate, width / 2.0 if outer else width)
            start, end = ids[i, k], ids[i + step[0], k + step[1]]
            beams.append(Beam(int(start), int(end), section, at[:3, 1 - axis]))
    return [int(node) for node in ids.ravel()]


def _link(nodes: _Nodes, one: int, other: int) -> Beam:
    """What holds two nodes as one body."""
    along = nodes.places[other] - nodes.places[one]
    along = along / np.linalg.norm(along)
    across = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
    return Beam(one, other, RIGID, across / np.linalg.norm(across))


def _apart(nodes: _Nodes, one: int, other: int) -> float:
    return float(np.linalg.norm(nodes.places[one] - nodes.places[other]))


def _nearest(nodes: _Nodes, among: list[int], point_mm: Floats) -> int:
    away = [float(np.linalg.norm(nodes.places[node] - point_mm)) for node in among]
    return among[int(np.argmin(away))]


def _length(member: Member) -> float:
    return float(np.linalg.norm(member.axis_mm[-1] - member.axis_mm[0]))


def _at(member: Member, along_mm: float) -> Floats:
    start, end = member.axis_mm[0], member.axis_mm[-1]
    return np.asarray(start + along_mm / _length(member) * (end - start))


def nearest_along(member: Member, point_mm: Floats) -> float:
    """How far along its middle line a member comes nearest to a point."""
    start, end = member.axis_mm[0], member.axis_mm[-1]
    length = _length(member)
    return float(np.clip((point_mm - start) @ (end - start) / length, 0.0, length))
