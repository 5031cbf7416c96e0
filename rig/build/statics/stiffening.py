"""Building a mount so stiffly that its cameras stay where they are set: stays, larger profiles."""

from __future__ import annotations

from dataclasses import dataclass, replace

from common.errors import InputError
from geometry.camera import RigCamera
from rig.build.mounts.plan import Sag, Tolerance
from rig.build.mounts.settings import CameraMount
from rig.build.mounts.structure import Structure
from rig.build.mounts.surroundings import Surroundings
from rig.build.mounts.systems.base import Built, Holding, MountSystem
from rig.build.statics.sag import sags
from rig.build.statics.weights import Masses
from rig.catalogue.items import Profile

ROOM = 0.7
"""Share of what is allowed that a mount may use up before its settings are final."""

MADE_LEAN_DEG, MADE_SHIFT_MM = 0.3, 2.0
"""What parts made to the figure may give way where their tolerances are not known yet."""


@dataclass(frozen=True)
class Stiffened:
    """The system that is stiff enough, or the stiffest there is, with what was added to it."""

    system: MountSystem
    first: Holding
    notes: tuple[str, ...] = ()


def stiffened(
    system: MountSystem,
    larger: tuple[tuple[Profile, MountSystem], ...],
    cameras: tuple[RigCamera, ...],
    around: Surroundings,
    masses: Masses,
) -> Stiffened:
    """The first of: as it is, with back-stays, with back-stays of a larger profile.

    Larger profiles are judged in the frame of the first; only the one chosen is arranged anew.
    """
    first = system.hold(cameras, around)
    built = first.build()
    plain = _tried(built.structure, built, masses)
    if plain is None or _little(plain, built.mounts):
        return Stiffened(system, first)
    stayed = first.with_stays()
    structure = stayed.build().structure
    found = _tried(structure, built, masses) or ()
    words = (f"Back-stays are built in: without them {_words(plain)}.",)
    if _little(found, built.mounts) or not larger:
        return Stiffened(stayed.system, stayed, words)
    for profile, other in larger:
        tried = _tried(with_profile(structure, profile), built, masses) or ()
        if _little(tried, built.mounts) or profile is larger[-1][0]:
            try:
                held = other.hold(cameras, around)
            except InputError:
                break
            more = f"Profile {profile.id} is used: with {_of(structure)} {_words(found)}."
            return Stiffened(other, held, (*words, more))
    return Stiffened(stayed.system, stayed, words)


def settled_sags(
    structure: Structure,
    mounts: tuple[CameraMount, ...],
    tolerances: tuple[Tolerance, ...],
    masses: Masses,
) -> tuple[tuple[Sag, ...], tuple[str, ...]]:
    """The sags of a finished plan, and what is to be known of them."""
    try:
        found = sags(structure, mounts, tolerances, masses)
    except InputError as error:
        return (), (f"Whether it leans is not known: {error.problem}; {error.remedy}.",)
    notes = []
    heavy = [mount.name for mount in mounts if masses.published(mount.camera) is None]
    if found and heavy:
        notes.append(
            f"A camera with its lens is taken as {masses.camera_kg:g} kg: say camera_kg if it is "
            "not, and plan again."
        )
    over = [sag for sag in found if sag.worst.share > 1.0]
    if over:
        notes.append(f"It leans: {advice(structure, mounts, tolerances, masses)}.")
    return found, tuple(notes)


def advice(
    structure: Structure,
    mounts: tuple[CameraMount, ...],
    tolerances: tuple[Tolerance, ...],
    masses: Masses,
) -> str:
    """What would keep cameras from leaning that lean: the first larger profile that does."""
    own = masses.catalogue.profiles[_of(structure)]
    square = [p for p in masses.catalogue.profiles.values()
              if p.width_mm == p.height_mm and p.width_mm > own.width_mm]  # fmt: skip
    for profile in sorted(square, key=lambda p: p.width_mm):
        try:
            found = sags(with_profile(structure, profile), mounts, tolerances, masses)
        except InputError:
            continue
        if all(sag.worst.share <= 1.0 for sag in found):
            return f"profile {profile.id} would hold it"
    return "lighter cameras or shorter arms would hold it"


def with_profile(structure: Structure, profile: Profile) -> Structure:
    """The same frame of another profile, its middle lines where they are."""
    size = (profile.width_mm, profile.height_mm)
    members = tuple(replace(m, part=profile.id, size_mm=size) for m in structure.members)
    return replace(structure, members=members)


def _of(structure: Structure) -> str:
    return structure.members[0].part


def _tried(structure: Structure, built: Built, masses: Masses) -> tuple[Sag, ...] | None:
    """The sags; None where they cannot be computed, or nothing is there to give way."""
    try:
        return sags(structure, built.mounts, (), masses) or None
    except InputError:
        return None


def _little(found: tuple[Sag, ...], mounts: tuple[CameraMount, ...]) -> bool:
    """Whether cameras give way so little that there is room for what is not known yet."""
    for sag, mount in zip(found, mounts, strict=True):
        steps = [s.step for s in mount.settings if s.unit == "deg" and s.step > 0.0]
        if steps and sag.lean_deg > ROOM * min(steps) / 2.0:
            return False
        made = not steps and (sag.lean_deg > MADE_LEAN_DEG or sag.shift > MADE_SHIFT_MM)
        if made:
            return False
    return bool(found)


def _words(found: tuple[Sag, ...]) -> str:
    worst = max(found, key=lambda sag: sag.lean_deg)
    return f"{worst.camera} would lean by {worst.lean_deg:.2f} degrees under its own weight"
