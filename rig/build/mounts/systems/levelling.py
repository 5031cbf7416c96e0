"""Levelling feet: what a frame stands on, so that it stands level on a floor that is not.

One is near either end of each foot of the frame, its stud in a T-nut of the lower slot; these carry
it. One is under each upright, its stud in the core bore: run down last, it steadies.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import Floats
from rig.build.mounts.clashes import Joined, pairs
from rig.build.mounts.solids import round_part
from rig.build.mounts.structure import LEVELLING, Joint, Member, PlacedPart, Solid, Structure
from rig.build.mounts.surroundings import Surroundings
from rig.catalogue.items import Bracket

PAD_MM = 10.0
"""Thickness of a pad: under it there is the floor, over it its lock nut."""

NUT_SHARE = 0.5
"""Diameter of stud and lock nuts over that of the pad: nuts to M8 are 15 mm over their corners."""

TWO_BORES = 1.5
"""Height over width from which a profile has two core bores."""

Z = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Levelling:
    """The foot of a profile and the T-nut that holds it in a slot."""

    foot: Bracket
    t_nut: str

    @property
    def diameter_mm(self) -> float:
        """Of its pad."""
        return (self.foot.size_mm or (25.0, 30.0, 25.0))[0]

    @property
    def lift_mm(self) -> float:
        """From the floor to the frame: the middle of what can be set, in whole millimetres."""
        return float(np.round(np.mean(self.foot.height_mm or (25.0, 25.0))))


def base_z_mm(around: Surroundings, levelling: Levelling | None) -> float:
    """Height of the underside of a frame that stands on levelling feet, or on the floor."""
    return around.floor_z_mm + (0.0 if levelling is None else levelling.lift_mm)


def levelled(
    structure: Structure, joined: Joined, levelling: Levelling | None
) -> tuple[Structure, Joined]:
    """The structure on levelling feet, with who touches whom; as it was without them."""
    if levelling is None:
        return structure, joined
    made = [m for member in structure.members for m in _under(member, levelling)]
    joints = tuple(joint for joint, _ in made)
    parts = tuple(part for _, part in made)
    solids = tuple(solid for part in parts for solid in _solids(part, levelling))
    on_it = replace(
        structure, joints=(*structure.joints, *joints), parts=(*structure.parts, *parts),
        solids=(*structure.solids, *solids),
    )  # fmt: skip
    return on_it, joined | pairs(*((joint.on, joint.other) for joint in joints))


def _under(member: Member, levelling: Levelling) -> Iterator[tuple[Joint, PlacedPart]]:
    """The feet of a member, each with the joint that holds it."""
    if member.role == "upright":
        yield _one(member, "", member.axis_mm[0] + _bore(member), 0.0, levelling)
    elif member.role.split()[-1] == "foot":
        inset = levelling.diameter_mm / 2.0
        start, end = member.axis_mm
        along = (end - start) / member.length_mm
        under = -member.size_mm[1] / 2.0 * Z
        for number, at in ((" 1", inset), (" 2", member.length_mm - inset)):
            yield _one(member, number, start + at * along + under, at, levelling)


def _one(
    member: Member, number: str, point_mm: Floats, along_mm: float, levelling: Levelling
) -> tuple[Joint, PlacedPart]:
    name = f"{member.id} pad{number}"
    at = np.eye(4)
    at[:3, 3] = point_mm - levelling.lift_mm * Z
    # In a slot a T-nut holds the stud, in a bore the thread that is cut into it.
    nuts = {} if member.role == "upright" else {levelling.t_nut: 1}
    joint = Joint(name, member.id, name, point_mm, along_mm, None, nuts)
    return joint, PlacedPart(name, levelling.foot.id, LEVELLING, at, joint=joint.id)


def _bore(member: Member) -> Floats:
    """From the middle of an upright to the core bore that is tapped, (3,)."""
    width, height = member.size_mm
    if height < TWO_BORES * width:
        return np.zeros(3)
    return np.asarray(height / 4.0 * np.cross(Z, member.across))


def _solids(part: PlacedPart, levelling: Levelling) -> tuple[Solid, Solid]:
    """Pad, and stud with its nuts."""
    at, wide = part.rig_from_part, levelling.diameter_mm
    return (
        round_part(part.id, "joint", at, wide, 0.0, PAD_MM),
        round_part(part.id, "joint", at, NUT_SHARE * wide, PAD_MM, levelling.lift_mm),
    )
