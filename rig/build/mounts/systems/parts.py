"""The parts of the catalogue that go together with a profile."""

from __future__ import annotations

from common.errors import InputError
from rig.build.mounts.systems.heads import HeadKind
from rig.build.mounts.systems.levelling import Levelling
from rig.build.mounts.systems.outrigger import Outrigger
from rig.build.mounts.systems.plate import PlateSystem
from rig.build.mounts.systems.threads import adapter_for
from rig.catalogue import Catalogue
from rig.catalogue.catalogue import pick
from rig.catalogue.items import Bracket, Profile


def profile_named(wanted: str, catalogue: Catalogue) -> Profile:
    """The profile of this id or name."""
    return pick(wanted, catalogue.profiles, "profile")


def bracket_for(
    profile: Profile, kind: str, catalogue: Catalogue, thread: str | None = None
) -> Bracket:
    """The bracket of a kind that fits a profile and whose size is known.

    One with a stud ``thread`` before others, which need an adapter.
    """
    fitting = [
        bracket
        for bracket in catalogue.brackets.values()
        if bracket.kind == kind and profile.series in bracket.series and bracket.size_mm is not None
    ]
    if not fitting:
        series = sorted(
            {s for b in catalogue.brackets.values() if b.kind == kind for s in b.series}
        )
        raise InputError(
            "mount-part",
            f"the catalogue has no {kind} bracket for profile {profile.id}",
            f"choose a profile of series {' or '.join(series)}, or add the bracket",
        )
    return next((b for b in fitting if thread and b.thread == thread), fitting[0])


def levelling_for(profile: Profile, catalogue: Catalogue) -> Levelling | None:
    """What a frame of a profile stands on; None where the catalogue has no foot for it."""
    for part in catalogue.brackets.values():
        if part.kind == "levelling-foot" and profile.series in part.series and part.height_mm:
            return Levelling(part, t_nut_for(profile, catalogue))
    return None


def t_nut_for(profile: Profile, catalogue: Catalogue) -> str:
    """Id of the T-nut for a profile's slot: of its series, or with its bolt's thread."""
    nuts = [f for f in catalogue.fasteners.values() if f.kind == "t-nut"]
    for nut in nuts:
        if nut.series == profile.series:
            return nut.id
    for nut in nuts:
        if nut.thread == profile.bolt:
            return nut.id
    raise InputError(
        "mount-part",
        f"the catalogue has no T-nut for profile {profile.id}",
        f"add one to it, or choose a profile of series {nuts[0].series if nuts else '2020'}",
    )


def screw_for(thread: str | None, catalogue: Catalogue) -> str:
    """Id of the screw with a thread; a stud where no cap screw has it."""
    screws = [f for f in catalogue.fasteners.values() if f.thread == thread]
    for kind in ("cap-screw", "stud"):
        for screw in screws:
            if screw.kind == kind:
                return screw.id
    raise InputError(
        "mount-part", f"the catalogue has no screw with the thread {thread}", "add one to it"
    )


def outrigger_of(
    profile: Profile, head: HeadKind, catalogue: Catalogue, *, level: bool = True
) -> Outrigger:
    """Stub, arm, plate and head of one profile; ``level``: on levelling feet."""
    thread = head.part.base_thread
    plate = bracket_for(profile, "head-plate", catalogue, thread)
    return Outrigger(
        profile=profile,
        plate=plate,
        adapter=adapter_for(plate.thread, thread, f"head {head.part.id}", catalogue),
        corner=bracket_for(profile, "corner", catalogue),
        pivot=bracket_for(profile, "pivot", catalogue),
        t_nut=t_nut_for(profile, catalogue),
        screw=screw_for(profile.bolt, catalogue),
        head=head,
        levelling=levelling_for(profile, catalogue) if level else None,
    )


def plate_of(
    profile: Profile,
    thickness_mm: float,
    material: str,
    catalogue: Catalogue,
    *,
    level: bool = True,
) -> PlateSystem:
    """A plate whose posts are of a profile with two core bores side by side."""
    if profile.height_mm < 1.5 * profile.width_mm:
        double = [p.id for p in catalogue.profiles.values() if p.height_mm >= 1.5 * p.width_mm]
        raise InputError(
            "plate-profile",
            f"a post of profile {profile.id} would turn on its one screw",
            f"choose {' or '.join(double)}, which takes two",
        )
    return PlateSystem(
        profile=profile,
        corner=bracket_for(profile, "corner", catalogue),
        pivot=bracket_for(profile, "pivot", catalogue),
        t_nut=t_nut_for(profile, catalogue),
        screw=screw_for(profile.bolt, catalogue),
        thickness_mm=thickness_mm,
        material=material,
        catalogue=catalogue,
        levelling=levelling_for(profile, catalogue) if level else None,
    )


def stand_named(wanted: str, catalogue: Catalogue) -> Bracket:
    """The stand of this id or name."""
    stands = {key: b for key, b in catalogue.brackets.items() if b.kind == "stand"}
    return pick(wanted, stands, "stand")
