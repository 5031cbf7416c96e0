"""Where a corner bracket can sit at a joint of two members, and which of these places are free.

Two members meet face to face, or the end of one on a face of the other. A bracket lies in the
corner between a face of the one and a face of the other, on a slot of both.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from geometry.arrays import Floats
from geometry.camera import RigCamera
from rig.build.mounts.clashes import Joined, Site, pairs
from rig.build.mounts.kinematics import frame
from rig.build.mounts.solids import carried, round_part
from rig.build.mounts.structure import Joint, Member, PlacedPart, Solid, Structure
from rig.build.mounts.surroundings import Surroundings
from rig.catalogue.items import Bracket

LEG_MM = 4.0
"""Thickness of a leg where the catalogue does not say."""

TOUCH_MM = 1.0
"""Faces that lie no further apart than this meet: members are cut to whole millimetres."""

OVER_END_MM = 3.5
"""How far a bracket may reach over the end of a member: its screw is in its middle, and of a
bracket 18 mm wide the nut, 10 mm long, ends 4 mm before its edge."""

SAME_MM = 0.6
"""Slots of two members that are no further apart than this are one line for a bracket."""

KEYS_MM: Mapping[str, tuple[float, float]] = {
    "M5": (4.0, 25.0), "M6": (5.0, 28.0), "M8": (6.0, 32.0), "5/16-18": (6.35, 33.0),
}  # fmt: skip
"""Of the key that turns a screw, by its thread: width, and length of the short arm, ISO 2936."""

SCREW_HEAD_MM: Mapping[str, float] = {"M5": 5.0, "M6": 6.0, "M8": 8.0, "5/16-18": 7.9}
"""Height of the head of a cap screw, ISO 4762: as high as its thread is wide."""


def leg_mm(bracket: Bracket) -> tuple[float, float, float]:
    """Length and thickness of a corner bracket's legs, and its width along the corner."""
    length, _, width = bracket.size_mm or (20.0, 20.0, 18.0)
    return length, bracket.leg_mm or LEG_MM, width


class _Box:
    """A member as a box: axes (3, 3) in columns, its length the last; middle and half sizes."""

    def __init__(self, member: Member) -> None:
        start, end = member.axis_mm[0], member.axis_mm[-1]
        along = (end - start) / np.linalg.norm(end - start)
        self.axes = np.stack([member.across, np.cross(along, member.across), along], axis=1)
        self.middle = (start + end) / 2.0
        self.half = np.array([*member.size_mm, float(np.linalg.norm(end - start))]) / 2.0
        self.module = min(member.size_mm)

    def slots(self, axis: int) -> Floats:
        """Middles of the slots across ``axis`` (0 or 1), from the middle of the member."""
        count = max(1, round(2.0 * float(self.half[axis]) / self.module))
        return np.asarray(self.module * (np.arange(count, dtype=np.float64) - (count - 1) / 2.0))


def corner_places(one: Member, other: Member, bracket: Bracket) -> tuple[Floats, ...]:
    """Frames (4, 4) of a bracket in the corners of two members that meet; empty for others.

    The origin is the middle of the inner edge, x and y run along the legs: x on one member's face,
    y on the other's.
    """
    a, b = _Box(one), _Box(other)
    return (*_along(b, a, bracket), *_along(a, b, bracket))


def _along(one: _Box, other: _Box, bracket: Bracket) -> Iterator[Floats]:
    """Places with a leg on the face of ``one`` along it, before and behind ``other``."""
    turn = one.axes.T @ other.axes
    if not np.allclose(np.abs(turn).max(axis=0), 1.0, atol=1e-6):
        return
    away = one.axes.T @ (other.middle - one.middle)
    half = np.abs(turn) @ other.half
    gap = np.abs(away) - one.half - half
    contact = int(np.argmax(gap))
    # On its own end a member has no slot for the leg.
    if contact == 2 or abs(gap[contact]) > TOUCH_MM:
        return
    lies = int(np.argmax(np.abs(turn[:, 2])))
    if lies == 2:
        return
    edge = 1 - contact
    normal = np.sign(away[contact]) * np.eye(3)[contact]
    places = one.slots(edge)
    if lies == contact:
        own = int(np.argmax(np.abs(turn[edge, :2])))
        theirs = away[edge] + other.slots(own)
        places = np.array([p for p in places if np.abs(theirs - p).min() < SAME_MM])
    else:
        within = np.abs(places - away[edge]) <= half[edge] - bracket_half(bracket) + OVER_END_MM
        places = places[within]
    length = leg_mm(bracket)[0]
    for place in sorted(places.tolist(), key=abs):
        for side in (1.0, -1.0):
            corner = away[2] + side * half[2]
            if abs(corner + side * length) > one.half[2] + SAME_MM:
                continue
            point = corner * np.eye(3)[2] + place * np.eye(3)[edge]
            point += one.half[contact] * normal
            x, y = side * np.eye(3)[2], normal
            at = frame(point, x, y, np.cross(x, y))
            yield np.asarray(_rig(one) @ at)


def bracket_half(bracket: Bracket) -> float:
    """Half of its width along the corner."""
    return leg_mm(bracket)[2] / 2.0


def _rig(box: _Box) -> Floats:
    at = np.eye(4)
    at[:3, :3], at[:3, 3] = box.axes, box.middle
    return at


def corner_solid(owner: str, at: Floats, bracket: Bracket) -> Solid:
    """A bracket with its gussets; the heads of its screws lie between them."""
    length, thick, width = leg_mm(bracket)
    outline = np.array([[0.0, 0], [length, 0], [length, thick], [thick, length], [0, length]])
    ends = [np.column_stack([outline, np.full(5, z)]) for z in (-width / 2.0, width / 2.0)]
    return Solid(owner, "joint", carried(at, np.concatenate(ends)))


def _keys(owner: str, at: Floats, bracket: Bracket) -> tuple[Solid, Solid]:
    """The room that a key needs over each of the two screws."""
    length, thick, _ = leg_mm(bracket)
    width, arm = KEYS_MM.get(bracket.bolt or "", KEYS_MM["M8"])
    low = thick + SCREW_HEAD_MM.get(bracket.bolt or "", 8.0)
    x, y, z = np.eye(3)
    on_x = frame(length / 2.0 * x, z, x, y)
    on_y = frame(length / 2.0 * y, y, z, x)
    return (
        round_part(owner, "key", at @ on_x, width, low, low + arm),
        round_part(owner, "key", at @ on_y, width, low, low + arm),
    )


def with_corners(
    structure: Structure,
    joined: Joined,
    corner: Bracket,
    cameras: tuple[RigCamera, ...],
    around: Surroundings,
) -> tuple[Structure, Joined]:
    """The structure with a placed part for each corner bracket that its joints ask for.

    Of the places of a joint those are taken that clash with nothing and leave room for a key.
    """
    site = Site(structure.solids, (*cameras, *around.standing), around, 0.0)
    members = {member.id: member for member in structure.members}
    joints, parts, solids, touching = [], [], [], []
    for joint in structure.joints:
        count = joint.fasteners.get(corner.id, 0)
        ends = (members.get(joint.on), members.get(joint.other))
        if not count or ends[0] is None or ends[1] is None:
            joints.append(joint)
            continue
        places = corner_places(ends[0], ends[1], corner)
        taken = _freest(places, count, joint, corner, site, around)
        for k, at in enumerate(taken, 1):
            part = PlacedPart(f"{joint.id} bracket {k}", corner.id, "corner bracket", at,
                              joint=joint.id)  # fmt: skip
            solid = corner_solid(part.id, at, corner)
            site.add((solid,))
            parts.append(part)
            solids.append(solid)
            touching += [(part.id, joint.on), (part.id, joint.other)]
        # What found no place is still needed, and counted.
        left = {corner.id: count - len(taken)} if len(taken) < count else {}
        others = {key: n for key, n in joint.fasteners.items() if key != corner.id}
        joints.append(replace(joint, fasteners=left | others))
    made = replace(
        structure, joints=tuple(joints), parts=(*structure.parts, *parts),
        solids=(*structure.solids, *solids),
    )  # fmt: skip
    return made, joined | pairs(*touching)


def _freest(
    places: Iterable[Floats],
    count: int,
    joint: Joint,
    corner: Bracket,
    site: Site,
    around: Surroundings,
) -> list[Floats]:
    """The first places without a clash, else those with the fewest."""
    joined = pairs(("", joint.on), ("", joint.other))
    rated: list[tuple[tuple[int, int], int, Floats]] = []
    for index, at in enumerate(places):
        solid = corner_solid("", at, corner)
        if solid.corners_mm[:, 2].min() < around.floor_z_mm - TOUCH_MM:
            continue
        clashes = site.clashes((solid,), joined)
        keys = site.clashes(_keys("", at, corner), frozenset())
        rated.append(((clashes, keys), index, at))
        if sum(rate == (0, 0) for rate, _, _ in rated) == count:
            break
    return [at for _, _, at in sorted(rated, key=lambda entry: entry[:2])[:count]]


def unplaced(structure: Structure, corner: Bracket) -> tuple[str, ...]:
    """What is to be known of joints whose brackets found no place; nothing where all have one."""
    short = [joint.id for joint in structure.joints if corner.id in joint.fasteners]
    if not short:
        return ()
    return (
        f"No place is free for a bracket of joint {', '.join(short[:3])}"
        f"{f' and {len(short) - 3} more' if len(short) > 3 else ''}: hold it by a plate of your "
        "own, or screw through.",
    )
