"""What is cut, drilled, printed and bolted together: members, plates, wedges, parts and joints.

All points in the rig frame, millimetres, unless a name says otherwise. ``part`` is always an
entry of the catalogue, or empty for what is made for this rig (a plate, a printed wedge).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from geometry.arrays import Floats, frozen

LEVELLING = "levelling foot"
"""Role of the part on which a member stands."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A convex solid: ``corners_mm`` (K, 3). ``owner`` is the member, part or camera it is of.

    ``kind``: ``member``, ``plate``, ``bracket``, ``joint`` (a corner bracket or a pivot with its
    screws), ``head``, ``wedge``, ``camera``, ``lens`` or ``cable``.
    """

    owner: str
    kind: str
    corners_mm: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "corners_mm", frozen(self.corners_mm))


@dataclass(frozen=True, eq=False)
class Member:
    """A length of profile, tube or bent bar along ``axis_mm`` (N, 3): two points when straight.

    ``across`` is the unit vector of the profile's width, at right angles to the axis (of a bent
    member: the normal of its plane). ``radius_mm`` of a bent member's axis, else None.
    ``length_mm`` is what is cut, along the axis. ``mitres_deg``: by how much the saw is turned at
    start and end, so that the side away from ``across`` x axis is the longer; 0 is a square cut.
    """

    id: str
    part: str
    role: str
    axis_mm: Floats
    across: Floats
    size_mm: tuple[float, float]
    radius_mm: float | None = None
    note: str = ""
    mitres_deg: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "axis_mm", frozen(self.axis_mm))
        object.__setattr__(self, "across", frozen(self.across))

    @property
    def start(self) -> str:
        """Which end its axis begins at, in words."""
        x, y, z = self.axis_mm[-1] - self.axis_mm[0]
        if abs(z) >= max(abs(x), abs(y)):
            return "lower end" if z > 0.0 else "upper end"
        if abs(y) >= abs(x):
            return "rear end" if y > 0.0 else "front end"
        return "end on the subject's right" if x > 0.0 else "end on the subject's left"

    def side_of(self, point_mm: Floats) -> str:
        """On which of its sides a point lies, in words; nothing for its ends and bent members."""
        if self.radius_mm is not None or len(self.axis_mm) != 2:
            return ""
        first, last = self.axis_mm
        along = (last - first) / np.linalg.norm(last - first)
        off = point_mm - first - along * float((point_mm - first) @ along)
        # Within a quarter of the profile it is about the middle: a joint at its end.
        if np.linalg.norm(off) < 0.25 * min(self.size_mm):
            return ""
        axis = int(np.abs(off).argmax())
        names = (
            ("side on the subject's right", "side on the subject's left"),
            ("side away from the subject", "side towards the subject"),
            ("lower side", "upper side"),
        )
        return names[axis][int(off[axis] > 0.0)]

    @property
    def long_side_mm(self) -> float:
        """Length of its longer side: what it takes of a bar."""
        slopes = float(np.tan(np.radians(self.mitres_deg)).sum())
        return self.length_mm + abs(slopes) * self.size_mm[1] / 2.0

    @property
    def length_mm(self) -> float:
        """What is cut; of a bent member the length of its arc."""
        steps = np.linalg.norm(np.diff(self.axis_mm, axis=0), axis=1)
        if self.radius_mm is None:
            return float(steps.sum())
        return float(2.0 * self.radius_mm * np.arcsin(steps / (2.0 * self.radius_mm)).sum())


@dataclass(frozen=True)
class Hole:
    """A hole in a plate or in the base of a wedge; centre in that part's own plane.

    ``kind``: ``through``, ``tapped``, ``countersunk``; ``thread`` where it has one.
    """

    label: str
    x_mm: float
    y_mm: float
    diameter_mm: float
    kind: str = "through"
    thread: str = ""


@dataclass(frozen=True, eq=False)
class Plate:
    """A flat plate: ``outline_mm`` (N, 2) anticlockwise, in the plane of ``rig_from_plate`` (4, 4).

    The plate's z = 0 is the face that the cameras' mounts sit on, z points out of it.
    """

    id: str
    material: str
    thickness_mm: float
    rig_from_plate: Floats
    outline_mm: Floats
    holes: tuple[Hole, ...]
    cutouts_mm: tuple[Floats, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "rig_from_plate", frozen(self.rig_from_plate))
        object.__setattr__(self, "outline_mm", frozen(self.outline_mm))
        object.__setattr__(self, "cutouts_mm", tuple(frozen(hole) for hole in self.cutouts_mm))


@dataclass(frozen=True, eq=False)
class Wedge:
    """A printed wedge: its base lies on a plate or profile, its seat carries the camera.

    ``rig_from_base`` (4, 4): base plane z = 0, z out of the plate. ``base_from_seat`` (4, 4): the
    seat plane z = 0, z out of the wedge towards the camera; the camera's thread is over the
    seat's origin. ``seat_size_mm`` along the seat's x and y. ``base_holes`` are screwed down.
    ``screw`` and ``screw_hole_mm``: the camera screw through the seat.
    """

    id: str
    camera: str
    rig_from_base: Floats
    base_from_seat: Floats
    seat_size_mm: tuple[float, float]
    base_size_mm: tuple[float, float]
    base_holes: tuple[Hole, ...]
    screw: str
    screw_hole_mm: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "rig_from_base", frozen(self.rig_from_base))
        object.__setattr__(self, "base_from_seat", frozen(self.base_from_seat))


@dataclass(frozen=True, eq=False)
class PlacedPart:
    """A bought part in its place: ``rig_from_part`` (4, 4). ``camera`` when it serves one only.

    ``joint``: the id of the joint that a bracket or a pivot is of.
    """

    id: str
    part: str
    role: str
    rig_from_part: Floats
    camera: str = ""
    joint: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "rig_from_part", frozen(self.rig_from_part))


@dataclass(frozen=True, eq=False)
class Joint:
    """Where ``on`` and ``other`` (ids) meet at ``point_mm``.

    ``along_mm``: from the start of ``on`` to the middle of the joint, None where ``on`` is no
    member.
    ``angle_deg``: the angle that is set there, None where there is nothing to set.
    ``fasteners``: catalogue entry to count. Brackets and pivots that are placed are not among them.
    """

    id: str
    on: str
    other: str
    point_mm: Floats
    along_mm: float | None = None
    angle_deg: float | None = None
    fasteners: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "point_mm", frozen(self.point_mm))


def joint_side(joint: Joint, members: Mapping[str, Member]) -> str:
    """On which side of ``on`` a joint holds the other part, in words; nothing where it has none.

    A joint that is marked on the middle line of its member says nothing itself: then it is the
    side on which the other member passes.
    """
    on, other = members.get(joint.on), members.get(joint.other)
    if on is None:
        return ""
    words = on.side_of(joint.point_mm)
    if words or other is None or other.radius_mm is not None or len(other.axis_mm) != 2:
        return words
    first, last = other.axis_mm
    way = last - first
    share = float(np.clip((joint.point_mm - first) @ way / (way @ way), 0.0, 1.0))
    return on.side_of(first + share * way)


@dataclass(frozen=True, eq=False)
class Structure:
    """Everything that holds the cameras. ``solids`` are what may collide or stand in a view."""

    members: tuple[Member, ...]
    plates: tuple[Plate, ...]
    wedges: tuple[Wedge, ...]
    parts: tuple[PlacedPart, ...]
    joints: tuple[Joint, ...]
    solids: tuple[Solid, ...]


def levelling_feet(structure: Structure) -> Iterator[tuple[Member, Joint, PlacedPart]]:
    """Each levelling foot with its member and its joint; its part's origin is on the floor."""
    members = {member.id: member for member in structure.members}
    joints = {joint.id: joint for joint in structure.joints}
    for part in structure.parts:
        if part.role == LEVELLING:
            joint = joints[part.joint]
            yield members[joint.on], joint, part
