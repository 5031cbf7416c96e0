"""How long each screw must be, from what it goes through, and which bores are tapped for it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from geometry.arrays import Floats
from rig.build.mounts.structure import Joint, Member, Structure, levelling_feet
from rig.catalogue import Catalogue
from rig.catalogue.items import Bracket

LENGTHS_MM = (6, 8, 10, 12, 16, 20, 25, 30, 35, 40, 45, 50, 55, 60, 70, 80, 90, 100, 120)
"""Lengths that socket cap screws are sold in, ISO 4762."""

IN_NUT = 0.8
"""What a screw must have in a nut, in diameters: the height of a nut, ISO 4032, is that."""

IN_ALUMINIUM = 2.0
"""The same in a thread that is cut into aluminium."""

LEG_MM = 4.0
"""Thickness of a corner bracket's or pivot's leg where the catalogue does not say."""

UNDER_HEAD_MM = 6.0
"""What a printed wedge has under the heads of its screws."""

CAMERA_SCREW_MM = 12.0
"""Of the screw into a camera: 6 mm in the wedge, 6 mm in the camera."""

SCREWS = ("cap-screw", "stud")

CAP_MM = 2.0
"""Thickness of an end cap's plate: what lies nearer to an end covers it."""

LIDS = ("member", "joint", "plate", "bracket")
"""Kinds of solids that may lie against an end."""

BEYOND_MM = 4.0
"""How much deeper a bore is tapped than its screw reaches: the tap's lead."""


@dataclass(frozen=True)
class Tap:
    """A bore to tap: ``bores`` core bores at the ``end`` of a member, ``depth_mm`` deep."""

    member: str
    end: str
    bores: int
    thread: str
    depth_mm: float


def screw_mm(joint: Joint, structure: Structure, catalogue: Catalogue) -> float | None:
    """Length of a joint's screws; None where it has none, or what they go through is not known."""
    screw = next((part for part in map(catalogue.fasteners.get, joint.fasteners)
                  if part is not None and part.kind in SCREWS), None)  # fmt: skip
    if screw is None or screw.diameter_mm is None:
        return None
    wedges = {wedge.id for wedge in structure.wedges}
    if joint.on in wedges:
        return CAMERA_SCREW_MM
    through = _through_mm(joint, structure, catalogue)
    if through is None:
        return None
    held = IN_ALUMINIUM if _tapped(joint, structure, catalogue) else IN_NUT
    return _sold_mm(through + held * screw.diameter_mm)


Sized = tuple[str, float | None, int]
"""A part by its id, of a screw its length, and how many."""


def sized(joint: Joint, structure: Structure, catalogue: Catalogue) -> tuple[Sized, ...]:
    """What a joint is made with, screws of each length by themselves."""
    length, ends = screw_mm(joint, structure, catalogue), _into_ends(joint, structure, catalogue)
    found: list[Sized] = []
    for part, count in joint.fasteners.items():
        fastener = catalogue.fasteners.get(part)
        if fastener is None or fastener.kind not in SCREWS:
            found.append((part, None, count))
            continue
        found.append((part, length, count - ends))
        if ends:
            found.append((part, _end_screw_mm(joint, structure, catalogue), ends))
    return tuple(found)


def _into_ends(joint: Joint, structure: Structure, catalogue: Catalogue) -> int:
    """How many screws of a pivot go into the core bore of the member that ends on it."""
    placed = (catalogue.brackets.get(p.part) for p in structure.parts if p.joint == joint.id)
    if not any(bracket is not None and bracket.kind == "pivot" for bracket in placed):
        return 0
    known = [(catalogue.fasteners[p].kind, n) for p, n in joint.fasteners.items()
             if p in catalogue.fasteners]  # fmt: skip
    screws = sum(count for kind, count in known if kind in SCREWS)
    return max(0, screws - sum(count for kind, count in known if "nut" in kind))


def _end_screw_mm(joint: Joint, structure: Structure, catalogue: Catalogue) -> float | None:
    through = _through_mm(joint, structure, catalogue)
    sizes = [f.diameter_mm for f in map(catalogue.fasteners.get, joint.fasteners)
             if f is not None and f.kind in SCREWS and f.diameter_mm is not None]  # fmt: skip
    return None if through is None or not sizes else _sold_mm(through + IN_ALUMINIUM * sizes[0])


def _sold_mm(wanted: float) -> float:
    return float(next((length for length in LENGTHS_MM if length >= wanted - 1e-9), wanted))


def taps(structure: Structure, catalogue: Catalogue) -> tuple[Tap, ...]:
    """Every bore that screws through a plate or a pivot, or studs of feet, are screwed into."""
    members = {member.id: member for member in structure.members}
    found = []
    for joint in structure.joints:
        member = members.get(joint.other)
        length = screw_mm(joint, structure, catalogue)
        through = _through_mm(joint, structure, catalogue)
        if member is None or length is None or not _tapped(joint, structure, catalogue):
            continue
        depth = length - (through or 0.0) + BEYOND_MM
        bores = sum(n for part, n in joint.fasteners.items() if part in catalogue.fasteners)
        thread = next(catalogue.fasteners[part].thread for part in joint.fasteners
                      if part in catalogue.fasteners)  # fmt: skip
        found.append(Tap(member.id, member.start, bores, thread, depth))
    return (*found, *_foot_taps(structure, catalogue), *_pivot_taps(structure, catalogue))


def _pivot_taps(structure: Structure, catalogue: Catalogue) -> Iterator[Tap]:
    """The core bore of each member that ends on a pivot."""
    members = {member.id: member for member in structure.members}
    for joint in structure.joints:
        bores = _into_ends(joint, structure, catalogue)
        ends = [(float(np.linalg.norm(members[m].axis_mm[-k] - joint.point_mm)), m, k)
                for m in (joint.on, joint.other) if m in members for k in (0, 1)]  # fmt: skip
        length = _end_screw_mm(joint, structure, catalogue)
        if bores and ends and length is not None:
            _, name, last = min(ends)
            words = members[name].start if last == 0 else f"opposite its {members[name].start}"
            thread = next(catalogue.fasteners[p].thread for p in joint.fasteners)
            depth = length - (_through_mm(joint, structure, catalogue) or 0.0) + BEYOND_MM
            yield Tap(name, words, bores, thread, depth)


def _foot_taps(structure: Structure, catalogue: Catalogue) -> Iterator[Tap]:
    """The core bore over each levelling foot that no nut in a slot holds."""
    for member, joint, part in levelling_feet(structure):
        thread = catalogue.brackets[part.part].thread
        sizes = [f.diameter_mm for f in catalogue.fasteners.values()
                 if f.thread == thread and f.diameter_mm is not None]  # fmt: skip
        if not joint.fasteners and thread and sizes:
            yield Tap(member.id, member.start, 1, thread, IN_ALUMINIUM * sizes[0] + BEYOND_MM)


def end_caps(structure: Structure, catalogue: Catalogue) -> dict[str, int]:
    """How many caps the open ends of members take, by catalogue id.

    An end that is screwed to a plate or on a levelling foot, that is mitred to another member, or
    against which another part lies, has no room for one.
    """
    closed = {tap.member for tap in taps(structure, catalogue)}
    lids = [(solid.owner, ConvexHull(solid.corners_mm).equations) for solid in structure.solids
            if solid.kind in LIDS]  # fmt: skip
    counts: dict[str, int] = {}
    for member in structure.members:
        cap = _cap(member, catalogue)
        if cap is not None:
            counts[cap.id] = counts.get(cap.id, 0) + _open_ends(member, closed, lids)
    return {part: count for part, count in counts.items() if count}


def _open_ends(member: Member, closed: set[str], lids: list[tuple[str, Floats]]) -> int:
    """How many of a member's ends a cap goes on; it is tapped at its start."""
    count = 0
    for end, mitre in enumerate(member.mitres_deg):
        there, back = member.axis_mm[-end], member.axis_mm[1 if end == 0 else -2]
        out = there + CAP_MM * (there - back) / np.linalg.norm(there - back)
        covered = any(
            owner != member.id and (planes[:, :3] @ out + planes[:, 3] <= 0.0).all()
            for owner, planes in lids
        )
        count += mitre == 0.0 and not covered and not (end == 0 and member.id in closed)
    return count


def _cap(member: Member, catalogue: Catalogue) -> Bracket | None:
    profile = catalogue.profiles.get(member.part)
    if profile is None:
        return None
    return next((part for part in catalogue.brackets.values()
                 if part.kind == "end-cap" and profile.series in part.series), None)  # fmt: skip


def _tapped(joint: Joint, structure: Structure, catalogue: Catalogue) -> bool:
    """Whether screws go into a member's own bores: through a plate, without nuts."""
    nuts = [p for p in map(catalogue.fasteners.get, joint.fasteners) if p and "nut" in p.kind]
    return not nuts and joint.on in {plate.id for plate in structure.plates}


def _through_mm(joint: Joint, structure: Structure, catalogue: Catalogue) -> float | None:
    """What lies between a screw's head and its thread."""
    with_it = [*joint.fasteners, *(p.part for p in structure.parts if p.joint == joint.id)]
    brackets = [b for b in map(catalogue.brackets.get, with_it) if b is not None]
    if brackets:
        return _leg_mm(brackets[0])
    for plate in structure.plates:
        if plate.id in (joint.on, joint.other):
            return plate.thickness_mm
    if joint.other in {wedge.id for wedge in structure.wedges}:
        return UNDER_HEAD_MM
    placed = {part.id: part.part for part in structure.parts}
    bracket = catalogue.brackets.get(placed.get(joint.other, ""))
    return None if bracket is None or bracket.size_mm is None else bracket.size_mm[2]


def _leg_mm(bracket: Bracket) -> float:
    return LEG_MM if bracket.leg_mm is None else bracket.leg_mm
