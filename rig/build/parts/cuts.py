"""The cut list: what to saw from each profile, and where its joints are marked."""

from __future__ import annotations

from dataclasses import dataclass

from rig.build.mounts.plan import MountPlan
from rig.build.mounts.structure import Member
from rig.catalogue.catalogue import Catalogue

SAME_LENGTH_MM = 0.05
"""Half of the tenth of a millimetre that lengths are stated to."""


@dataclass(frozen=True)
class Cut:
    """Pieces that are cut alike. ``members`` are their ids; ``mass_g`` of all of them.

    ``radius_mm`` of a bent piece's axis; its length is then that of the arc. ``mitres_deg``: how
    far the saw is turned at start and end; ``long_side_mm`` is then longer than the middle.
    """

    part: str
    name: str
    role: str
    length_mm: float
    quantity: int
    members: tuple[str, ...]
    mass_g: float | None
    radius_mm: float | None = None
    note: str = ""
    mitres_deg: tuple[float, float] = (0.0, 0.0)
    long_side_mm: float = 0.0


def cut_list(plan: MountPlan, catalogue: Catalogue) -> tuple[Cut, ...]:
    """Members by profile, the longest first, those of one length and role together."""
    groups: list[list[Member]] = []
    for member in sorted(plan.structure.members, key=lambda m: (m.part, -m.length_mm, m.id)):
        group = next((g for g in groups if _alike(g[0], member)), None)
        if group is None:
            groups.append([member])
        else:
            group.append(member)
    return tuple(_cut(group, catalogue) for group in groups)


def _alike(one: Member, other: Member) -> bool:
    same = (one.part, one.role, one.radius_mm, one.note, one.mitres_deg)
    close = abs(one.length_mm - other.length_mm) < SAME_LENGTH_MM
    return close and same == (other.part, other.role, other.radius_mm, other.note, other.mitres_deg)


def _cut(group: list[Member], catalogue: Catalogue) -> Cut:
    first = group[0]
    _, part = catalogue.find(first.part)
    per_metre = getattr(part, "mass_kg_per_m", None)
    mass = None if per_metre is None else per_metre * sum(m.length_mm for m in group)
    return Cut(
        part.id,
        part.name,
        first.role,
        first.length_mm,
        len(group),
        tuple(member.id for member in group),
        mass,
        first.radius_mm,
        first.note,
        first.mitres_deg,
        first.long_side_mm,
    )
