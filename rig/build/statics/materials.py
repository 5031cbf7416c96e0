"""What profiles and plates are worth as beams."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

from common.errors import InputError
from rig.build.mounts.structure import Member, Plate
from rig.build.parts.bill import density_g_per_cm3
from rig.build.statics.beams import Section
from rig.catalogue import Catalogue
from rig.catalogue.items import Profile

POISSON = 0.33
"""Of aluminium; that of steel and of plastics lies between 0.3 and 0.4."""

ALUMINIUM_G_PER_CM3 = 2.70
TORSION_SHARE = 0.2
"""Torsion constant of a slotted profile as a share of its smaller inertia, where it is not given:
slots open the section, so that it is a fifth and not twice as large as of a solid one."""

ELASTICITIES_N_PER_MM2: Mapping[str, float] = {
    "aluminium": 70_000.0,
    "aluminum": 70_000.0,
    "steel": 210_000.0,
    "stainless": 200_000.0,
    "plywood": 9_000.0,
    "mdf": 3_000.0,
    "acrylic": 3_200.0,
    "polycarbonate": 2_400.0,
    "pom": 2_800.0,
}
"""Usual moduli; a material is looked up by its first word."""

RIGID = Section(70_000.0, 26_000.0, 1e5, 2e6, 2e6, 2e6, 0.0)
"""What joins middle lines: twenty times as stiff as the stiffest profile, and weightless."""

_NEEDED = ("inertia_x_mm4", "inertia_y_mm4", "elasticity_n_per_mm2", "mass_kg_per_m")


def member_section(member: Member, catalogue: Catalogue) -> Section:
    """The beam of a member; :class:`InputError` for a profile whose figures do not suffice."""
    _, part = catalogue.find(member.part)
    missing = [key for key in _NEEDED if getattr(part, key, None) is None]
    if not isinstance(part, Profile) or missing:
        raise InputError(
            "frame-profile",
            f"the catalogue does not say {(missing or _NEEDED)[0]} of profile {member.part}",
            "add it in a file of your own, or choose another profile",
        )
    upright = abs(member.size_mm[0] - part.width_mm) < abs(member.size_mm[0] - part.height_mm)
    lying = not upright and part.width_mm != part.height_mm
    return _profile_section(part, lying)


def _profile_section(part: Profile, lying: bool) -> Section:
    x, y = float(part.inertia_x_mm4 or 0.0), float(part.inertia_y_mm4 or 0.0)
    e, mass = float(part.elasticity_n_per_mm2 or 0.0), float(part.mass_kg_per_m or 0.0)
    across, other = (y, x) if lying else (x, y)
    torsion = part.torsion_mm4 or TORSION_SHARE * min(x, y)
    area = mass / ALUMINIUM_G_PER_CM3 * 1e3
    return Section(e, e / 2.0 / (1.0 + POISSON), area, across, other, torsion, mass)


@lru_cache(maxsize=64)
def _strip(material: str, thick_mm: float, width_mm: float) -> Section:
    density = density_g_per_cm3(material)
    words = material.lower().split()
    e = ELASTICITIES_N_PER_MM2.get(words[0]) if words else None
    if e is None or density is None:
        raise InputError(
            "frame-material",
            f"how stiff {material} is, is not known",
            f"begin the material with {', '.join(ELASTICITIES_N_PER_MM2)}",
        )
    area = width_mm * thick_mm
    bend = width_mm * thick_mm**3 / 12.0 / (1.0 - POISSON**2)
    # Half of the weight: strips both ways cover the plate twice.
    mass = 0.5 * area * density * 1e-3
    return Section(
        e, e / 2.0 / (1.0 + POISSON), area, bend, thick_mm * width_mm**3 / 12.0,
        width_mm * thick_mm**3 / 6.0, mass,
    )  # fmt: skip


def strip_section(plate: Plate, width_mm: float) -> Section:
    """A strip of a plate ``width_mm`` wide (Hambly, Bridge Deck Behaviour: grillage)."""
    return _strip(plate.material, plate.thickness_mm, round(width_mm, 6))
