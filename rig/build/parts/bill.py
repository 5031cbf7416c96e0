"""The bill of materials: every part of a plan once, how many, how heavy, and what they cost."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from common.errors import InputError, NotFoundError
from geometry.arrays import Floats
from geometry.camera import RigCamera
from rig.build.mounts.plan import MountPlan
from rig.build.mounts.structure import Plate
from rig.build.parts.masses import small_part_g
from rig.build.parts.screws import end_caps, sized
from rig.catalogue.catalogue import Catalogue

PRINT_DENSITY_G_PER_CM3 = 1.27
"""PETG, printed solid: an upper bound of what a wedge weighs."""

DENSITIES_G_PER_CM3: Mapping[str, float] = {
    "aluminium": 2.70,
    "aluminum": 2.70,
    "steel": 7.85,
    "stainless": 7.93,
    "plywood": 0.68,
    "mdf": 0.75,
    "acrylic": 1.19,
    "polycarbonate": 1.20,
    "pom": 1.41,
}
"""Usual densities; a material is looked up by its first word."""

METRE_MM = 1000.0
Sized = tuple[str, float | None]
"""A part and, of a screw, its length."""

KINDS = ("camera", "lens", "mount", "head", "profile", "bracket", "fastener")


@dataclass(frozen=True)
class Prices:
    """``each``: price by catalogue id, of one piece, or of one metre of a profile."""

    currency: str = ""
    each: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for part, price in self.each.items():
            if not (math.isfinite(price) and price >= 0.0):
                raise InputError(
                    "price", f"the price of {part} is {price}", "give a number of zero or more"
                )


@dataclass(frozen=True)
class BillLine:
    """One kind of part. ``length_mm`` is the sum of what is cut, None of what comes in pieces.

    ``mass_g`` and ``cost`` are of all ``quantity`` of them; None where a figure is not known.
    """

    kind: str
    part: str
    name: str
    maker: str
    quantity: int
    length_mm: float | None = None
    mass_g: float | None = None
    price: float | None = None
    cost: float | None = None
    note: str = ""


@dataclass(frozen=True)
class Bill:
    """All lines, with the sums of what is known and the parts of which something is not."""

    lines: tuple[BillLine, ...]
    currency: str = ""

    @property
    def mass_g(self) -> float:
        """Mass of all lines whose mass is known."""
        return sum(line.mass_g for line in self.lines if line.mass_g is not None)

    @property
    def cost(self) -> float | None:
        """Cost of all lines with a price; None when there is none."""
        costs = [line.cost for line in self.lines if line.cost is not None]
        return sum(costs) if costs else None

    @property
    def without_mass(self) -> tuple[str, ...]:
        """Parts whose mass is not known."""
        return tuple(line.part or line.name for line in self.lines if line.mass_g is None)

    @property
    def without_price(self) -> tuple[str, ...]:
        """Parts without a price."""
        return tuple(line.part or line.name for line in self.lines if line.cost is None)


def bill_of_materials(
    plan: MountPlan,
    catalogue: Catalogue,
    prices: Prices | None = None,
    wedge_volumes_mm3: Mapping[str, float] | None = None,
) -> Bill:
    """The bill of a plan. Cameras that are ``fixed`` are there already and are not counted.

    ``wedge_volumes_mm3`` by the wedge's id gives printed wedges their mass.
    :class:`NotFoundError` for a part or a price's id that is not in the catalogue.
    """
    priced = _resolved(prices or Prices(), plan, catalogue)
    lines = [
        *_cameras(plan, catalogue, priced),
        *_profiles(plan, catalogue, priced),
        *_pieces(plan, catalogue, priced),
        *(_plate_line(plate, priced) for plate in plan.structure.plates),
        *_wedges(plan, wedge_volumes_mm3 or {}, priced),
    ]
    return Bill(tuple(lines), priced.currency)


def must_be_known(prices: Prices, cameras: Sequence[RigCamera], catalogue: Catalogue) -> None:
    """Raises :class:`InputError` for a price of nothing that a plan for ``cameras`` could have.

    Asked before a plan is made, which takes its time.
    """
    own = {camera.camera.name for camera in cameras} | {"plate"}
    own |= {f"{camera.name} wedge" for camera in cameras}
    for part in set(prices.each) - own:
        try:
            catalogue.find(part)
        except NotFoundError as error:
            raise InputError(error.detail, f"prices: {error.problem}", error.remedy) from error


def _resolved(prices: Prices, plan: MountPlan, catalogue: Catalogue) -> Prices:
    """Prices by id; a misspelt id would else leave its price out without a word."""
    own = {m.camera.camera.name for m in plan.mounts}
    own |= {p.id for p in plan.structure.plates} | {w.id for w in plan.structure.wedges}
    each = {k if k in own else catalogue.find(k)[1].id: v for k, v in prices.each.items()}
    return Prices(prices.currency, each)


def _line(
    kind: str, name: tuple[str, str, str], quantity: int, mass_each_g: float | None, prices: Prices
) -> BillLine:
    """A line of pieces; ``name`` is part, name and maker."""
    price = prices.each.get(name[0])
    return BillLine(
        kind,
        *name,
        quantity,
        None,
        None if mass_each_g is None else mass_each_g * quantity,
        price,
        None if price is None else price * quantity,
    )


def _cameras(plan: MountPlan, catalogue: Catalogue, prices: Prices) -> list[BillLine]:
    kinds = Counter(m.camera.camera.name for m in plan.mounts if not m.camera.fixed)
    lines = []
    for kind, count in kinds.items():
        parts = catalogue.parts_of(kind)
        if parts is None:
            lines.append(_line("camera", (kind, kind, ""), count, None, prices))
            continue
        for table, part in zip(("camera", "lens"), parts, strict=True):
            if part.kind != "built-in":
                name = (part.id, part.name, part.maker)
                mass: Any = getattr(part, "mass_g", None)
                lines.append(_line(table, name, count, mass, prices))
    return _merged(lines)


def _merged(lines: Iterable[BillLine]) -> list[BillLine]:
    """Lines of the same part as one: two kinds of camera may share a lens."""
    found: dict[tuple[str, str], BillLine] = {}
    for line in lines:
        former = found.get((line.kind, line.part))
        found[line.kind, line.part] = line if former is None else _sum(former, line)
    return list(found.values())


def _sum(one: BillLine, other: BillLine) -> BillLine:
    mass, cost = (
        None if a is None or b is None else a + b
        for a, b in ((one.mass_g, other.mass_g), (one.cost, other.cost))
    )
    count = one.quantity + other.quantity
    return BillLine(
        one.kind, one.part, one.name, one.maker, count, None, mass, one.price, cost, one.note
    )


def _profiles(plan: MountPlan, catalogue: Catalogue, prices: Prices) -> list[BillLine]:
    lines = []
    for wanted in dict.fromkeys(member.part for member in plan.structure.members):
        members = [m for m in plan.structure.members if m.part == wanted]
        length = sum(member.length_mm for member in members)
        kind, part = catalogue.find(wanted)
        per_metre = getattr(part, "mass_kg_per_m", None)
        price = prices.each.get(part.id)
        lines.append(
            BillLine(
                kind,
                part.id,
                part.name,
                part.maker,
                len(members),
                length,
                None if per_metre is None else per_metre * length,
                price,
                None if price is None else price * length / METRE_MM,
                "price per metre" if price is not None else "",
            )
        )
    return lines


def _pieces(plan: MountPlan, catalogue: Catalogue, prices: Prices) -> list[BillLine]:
    """Placed parts, what joints are made with, and the caps of open ends; screws by length."""
    counts: Counter[Sized] = Counter((part.part, None) for part in plan.structure.parts)
    for joint in plan.structure.joints:
        for part, length, count in sized(joint, plan.structure, catalogue):
            counts[part, length] += count
    for part, count in end_caps(plan.structure, catalogue).items():
        counts[part, None] += count
    return _counted(counts, catalogue, prices)


def _counted(counts: Counter[Sized], catalogue: Catalogue, prices: Prices) -> list[BillLine]:
    lines = []
    for (wanted, length), count in counts.items():
        kind, part = catalogue.find(wanted)
        mass = small_part_g(part.id, length, catalogue)
        name = part.name if length is None else f"{part.name} × {length:g} mm"
        lines.append(_line(kind, (part.id, name, part.maker), count, mass, prices))
    return sorted(lines, key=lambda line: (KINDS.index(line.kind), line.part, line.name))


def _plate_line(plate: Plate, prices: Prices) -> BillLine:
    size = np.ptp(plate.outline_mm, axis=0)
    name = f"Plate {size[0]:.0f} × {size[1]:.0f} × {plate.thickness_mm:g} mm, {plate.material}"
    return _line("plate", (plate.id, name, ""), 1, plate_mass_g(plate), prices)


def density_g_per_cm3(material: str) -> float | None:
    """The usual density of a material, by its first word; None for one that is not known."""
    words = material.lower().split()
    return DENSITIES_G_PER_CM3.get(words[0]) if words else None


def plate_mass_g(plate: Plate) -> float | None:
    """Mass of a plate less its holes and cut-outs; None for a material that is not known."""
    density = density_g_per_cm3(plate.material)
    if density is None:
        return None
    area = _area_mm2(plate.outline_mm) - sum(map(_area_mm2, plate.cutouts_mm))
    area -= sum(math.pi / 4.0 * hole.diameter_mm**2 for hole in plate.holes)
    return float(area * plate.thickness_mm * density / METRE_MM)


def _area_mm2(outline_mm: Floats) -> float:
    x, y = outline_mm.T
    return abs(float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)))


def _wedges(
    plan: MountPlan, volumes_mm3: Mapping[str, float], prices: Prices
) -> Iterable[BillLine]:
    for wedge in plan.structure.wedges:
        volume = volumes_mm3.get(wedge.id)
        mass = None if volume is None else volume * PRINT_DENSITY_G_PER_CM3 / METRE_MM
        name = (wedge.id, f"Printed wedge for {wedge.camera}", "")
        line = _line("wedge", name, 1, mass, prices)
        yield BillLine(**{**line.__dict__, "note": "PETG, mass if printed solid"})
