"""The ribs of an arc: polygons of straight profile in upright planes about the subject."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from geometry.arrays import Floats
from rig.build.mounts.kinematics import frame
from rig.build.mounts.settings import Link, Motion, Setting, shift, turn
from rig.build.mounts.solids import box, carried
from rig.build.mounts.structure import Member, PlacedPart, Solid
from rig.build.mounts.systems.outrigger import Z
from rig.catalogue.items import Bracket, Profile

CORNER_SIZES = 2.1
"""How far from a corner of the polygon the middle of a stub stays, in sizes of the profile: the
strips over the joint reach 1.5 of them, the stub half of one."""


@dataclass(frozen=True, eq=False)
class Rib:
    """A polygon about ``centre_mm`` (3,), turned to ``turn_deg`` about the vertical.

    Its ``count`` + 1 corners lie at ``radius_mm``, at even steps from elevation ``low_deg`` to
    ``high_deg``.
    """

    id: str
    profile: Profile
    centre_mm: Floats
    turn_deg: float
    radius_mm: float
    low_deg: float
    high_deg: float
    count: int
    step_mm: float

    @cached_property
    def axes(self) -> Floats:
        """Rotation (3, 3) of its plane: x across, y to the subject at elevation 0."""
        return turn(Z, self.turn_deg)

    def corner(self, index: int) -> Floats:
        """A corner (3,), counted from the lower end."""
        angle = np.radians(self.low_deg + (self.high_deg - self.low_deg) * index / self.count)
        out = np.array([0.0, -np.cos(angle), np.sin(angle)])
        return np.asarray(self.centre_mm + self.radius_mm * self.axes @ out)

    @cached_property
    def facets(self) -> tuple[Facet, ...]:
        """All facets from the lower end upwards."""
        return tuple(Facet(self, index) for index in range(self.count))

    def nearest(self, point_mm: Floats) -> list[Facet]:
        """Facets by how near they lie to the direction of a point."""
        away = point_mm - self.centre_mm
        return sorted(self.facets, key=lambda f: -float((f.middle_mm - self.centre_mm) @ away))


@dataclass(frozen=True, eq=False)
class Facet:
    """One straight piece of a rib."""

    rib: Rib
    index: int

    @property
    def id(self) -> str:
        """Id of the member."""
        return f"{self.rib.id}.{self.index + 1}"

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width across and depth."""
        return self.rib.profile.width_mm, self.rib.profile.height_mm

    @cached_property
    def ends_mm(self) -> tuple[Floats, Floats]:
        """Lower and upper corner."""
        return self.rib.corner(self.index), self.rib.corner(self.index + 1)

    @property
    def middle_mm(self) -> Floats:
        """Half-way between the corners."""
        return np.asarray((self.ends_mm[0] + self.ends_mm[1]) / 2.0)

    @property
    def length_mm(self) -> float:
        """From corner to corner."""
        return float(np.linalg.norm(self.ends_mm[1] - self.ends_mm[0]))

    @property
    def lean_deg(self) -> float:
        """How far it leans from the vertical."""
        return float(np.degrees(np.arccos(np.clip(self._start()[2, 2], -1.0, 1.0))))

    def _start(self) -> Floats:
        low, high = self.ends_mm
        z, x = (high - low) / self.length_mm, self.rib.axes[:, 0]
        return frame(low, x, np.cross(z, x), z)

    def setting(self) -> Setting:
        """Length of facet from its lower corner to the stub."""
        free = CORNER_SIZES * self.size_mm[1]
        return Setting(
            "along", "mm", self.length_mm / 2.0, self.rib.step_mm, free, self.length_mm - free,
            f"the lower corner of {self.id} to the middle of the stub",
        )  # fmt: skip

    def links(self) -> tuple[Link, ...]:
        """Along the facet to the middle of the stub."""
        return (Link(self._start(), Motion.SLIDE, Z, "along"),)

    def at(self, value: float) -> Floats:
        """The stub's frame at a length along the facet."""
        return np.asarray(self._start() @ shift(value * Z))

    def frame_for(self, point_mm: Floats) -> Floats:
        """The stub's frame abreast of a point."""
        start = self._start()
        return self.at(float(start[:3, 2] @ (point_mm - start[:3, 3])))

    def member(self) -> Member:
        """The piece of profile."""
        axis, across = np.stack(self.ends_mm), self.rib.axes[:, 0]
        return Member(
            self.id, self.rib.profile.id, "facet", axis, across, self.size_mm,
            mitres_deg=self.mitres_deg,
        )  # fmt: skip

    @property
    def mitres_deg(self) -> tuple[float, float]:
        """Half of the bend to the next facet, at the ends that meet one."""
        half = (self.rib.high_deg - self.rib.low_deg) / self.rib.count / 2.0
        return (half if self.index else 0.0, half if self.index + 1 < self.rib.count else 0.0)

    def solid(self) -> Solid:
        """The room it takes: shorter on the side of the subject, where facets meet in a mitre."""
        (width, depth), slopes = self.size_mm, np.tan(np.radians(self.mitres_deg))
        corners = np.array([
            [x, y, y * slopes[0] if end == 0 else self.length_mm - y * slopes[1]]
            for end in (0, 1)
            for x in (-width / 2.0, width / 2.0)
            for y in (-depth / 2.0, depth / 2.0)
        ])  # fmt: skip
        return Solid(self.id, "member", carried(self._start(), corners))


def bend_id(upper: Facet) -> str:
    """Id of the joint at the lower end of a facet."""
    return f"{upper.id} bend"


def strips(rib: Rib, strip: Bracket) -> list[tuple[PlacedPart, Solid]]:
    """The strips at all bends of a rib."""
    return [made for lower, upper in pairwise(rib.facets) for made in _bend(lower, upper, strip)]


def _bend(lower: Facet, upper: Facet, strip: Bracket) -> list[tuple[PlacedPart, Solid]]:
    """The strips on both sides of a bend, each with a screw into either facet.

    They lie along the chord from screw to screw, which cuts the corner on the inner side.
    """
    width, length, thick = strip.size_mm or (20.0, 60.0, 4.0)
    screw = length / 2.0 - width / 2.0
    along = [lower.at(lower.length_mm - screw)[:3, 3], upper.at(screw)[:3, 3]]
    chord = (along[1] - along[0]) / np.linalg.norm(along[1] - along[0])
    middle, out = (along[0] + along[1]) / 2.0, []
    for k, side in enumerate((1.0, -1.0), 1):
        normal = side * lower.rib.axes[:, 0]
        at = frame(middle + lower.size_mm[0] / 2.0 * normal, np.cross(chord, normal), chord, normal)
        joint = bend_id(upper)
        part = PlacedPart(f"{joint} strip {k}", strip.id, "joining strip", at, joint=joint)
        half = np.array([width / 2.0, length / 2.0, 0.0])
        out.append((part, box(part.id, "joint", at, -half, half + np.array([0.0, 0.0, thick]))))
    return out
