"""The assembly steps: numbered sentences that name members, lengths, holes and settings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace

from rig.build.mounts.plan import Sag, set_for_weight
from rig.build.mounts.settings import CameraMount, Setting
from rig.build.mounts.structure import (
    Joint,
    Member,
    Plate,
    Structure,
    Wedge,
    joint_side,
    levelling_feet,
)
from rig.build.parts.screws import sized
from rig.catalogue import Catalogue

Members = Mapping[str, Member]


def assembly_steps(
    structure: Structure,
    mounts: tuple[CameraMount, ...],
    catalogue: Catalogue,
    sags: tuple[Sag, ...] = (),
) -> tuple[str, ...]:
    """What to do, one step after the other; screws by the lengths that the bill has.

    ``sags``: how cameras sink, so that the steps say to set what their setting sheets say.
    """
    told = tuple(_with_length(joint, structure, catalogue) for joint in structure.joints)
    structure = replace(structure, joints=told)
    steps = [_cut(structure.members)] if structure.members else []
    steps += [_drill(plate) for plate in structure.plates]
    if structure.wedges:
        steps.append(f"Print the wedges: {', '.join(wedge.id for wedge in structure.wedges)}.")
    own = {m.name: {part for part in m.carried_by if part.startswith(f"{m.name} ")} for m in mounts}
    of_one = {m.name for m in mounts}.union(*own.values())
    members = {member.id: member for member in structure.members}
    level = {joint.id: _join(joint, members) for _, joint, _ in levelling_feet(structure)}
    if level:
        steps.append(f"Put on the levelling feet: {'; '.join(level.values())}.")
    steps += [
        f"J{_join(j, members)[1:]}."
        for j in structure.joints
        if j.id not in level and not {j.on, j.other} & of_one
    ]
    steps += [_level(structure, catalogue)] if level else []
    steps.append(
        "Set up the subject's head form or a pointer at the datum, and check that the mount stands "
        "level and square to it."
    )
    sinking = {sag.camera: sag for sag in sags}
    for mount in mounts:
        mine = own[mount.name] | {mount.name}
        joints = [j for j in structure.joints if {j.on, j.other} & mine]
        steps.append(f"Hang {mount.name}: {_hang(mount, joints, structure.wedges, members)}.")
        steps.append(_set(mount, sinking.get(mount.name)))
        steps.append(_check(mount))
    if any(give.set_more for sag in sags for give in sag.gives):
        steps.append(
            "With every camera hung, check all tapes once more: settings hold what the rig sinks "
            "by under its whole weight."
        )
    return tuple(f"{k}. {text}" for k, text in enumerate(steps, 1))


def _cut(members: tuple[Member, ...]) -> str:
    pieces = "; ".join(f"{m.id} {m.part} {m.length_mm:.0f} mm{_mitred(m)}" for m in members)
    return f"Cut to length: {pieces}."


def _level(structure: Structure, catalogue: Catalogue) -> str:
    """How the levelling feet are set: all to one height, then as the floor asks."""
    feet = list(levelling_feet(structure))
    _, joint, part = feet[0]
    height = float(joint.point_mm[2] - part.rig_from_part[2, 3])
    words = f"Turn the pad of every levelling foot to {height:.0f} mm from the floor to its member"
    if (span := catalogue.brackets[part.part].height_mm) is not None:
        words += f" ({span[0]:.0f} to {span[1]:.0f} mm can be set)"
    last = [member.id for member, _, _ in feet if member.role == "upright"]
    words += ", level the frame by those under its feet, highest place of the floor first"
    words += f", then run those under {', '.join(last)} down until they touch" if last else ""
    return f"{words}, and tighten their lock nuts."


def _mitred(member: Member) -> str:
    """How the saw is turned for a piece that is not cut square."""
    if not any(member.mitres_deg):
        return ""
    start, end = member.mitres_deg
    return (
        f" along its middle, {member.long_side_mm:.1f} mm on its longer side, saw turned by "
        f"{start:.1f} degrees at its {member.start} and {end:.1f} at the other"
    )


def _drill(plate: Plate) -> str:
    holes = "; ".join(
        f"{h.label} at {h.x_mm:.1f}, {h.y_mm:.1f} mm, {h.kind} {h.diameter_mm:.1f} mm"
        + (f" {h.thread}" if h.thread else "")
        for h in plate.holes
    )
    return f"Drill {plate.id} ({plate.material}, {plate.thickness_mm:g} mm): {holes}."


def _hang(
    mount: CameraMount, joints: list[Joint], wedges: tuple[Wedge, ...], members: Members
) -> str:
    """The joints of one camera in the order in which they can be made."""
    wedge = next((w.id for w in wedges if w.camera == mount.name), None)
    if wedge is None:
        return "; ".join(_join(joint, members) for joint in joints)
    # On its post the wedge hides the camera's screw; the camera leaves the base screws free.
    first = [_join(j, members) for j in joints if wedge not in (j.on, j.other)]
    under = [
        f"screw {j.other} onto {j.on} from below, the screw's head in the wedge's pocket" + _with(j)
        for j in joints
        if j.on == wedge
    ]
    last = [
        f"screw {j.other} onto {j.on} with its camera on it{_where(j, members)}, by a straight "
        "key from above" + _with(j)
        for j in joints
        if j.other == wedge
    ]
    return "; ".join([*first, *under, *last, "plug in the cable last"])


def _join(joint: Joint, members: Members) -> str:
    angle = "" if joint.angle_deg is None else f", at {joint.angle_deg:.1f} degrees"
    return f"join {joint.other} to {joint.on}{_where(joint, members)}{angle}" + _with(joint)


def _where(joint: Joint, members: Members) -> str:
    if joint.along_mm is None:
        return ""
    member = members.get(joint.on)
    if member is None:
        return f", the middle {joint.along_mm:.0f} mm from its start"
    side = joint_side(joint, members)
    return (f", on its {side}" if side else "") + (
        f", the middle {joint.along_mm:.0f} mm from its {member.start}"
    )


def _with_length(joint: Joint, structure: Structure, catalogue: Catalogue) -> Joint:
    """The joint with its brackets too, and its screws named by their length, where it is known."""
    named = Counter(p.part for p in structure.parts if p.joint == joint.id and p.id != joint.other)
    for part, length, count in sized(joint, structure, catalogue):
        named[part if length is None else f"{part}, {length:g} mm long"] += count
    return replace(joint, fasteners=dict(named))


def _with(joint: Joint) -> str:
    parts = " and ".join(f"{count} x {part}" for part, count in joint.fasteners.items())
    return f" with {parts}" if parts else ""


def _set(mount: CameraMount, sag: Sag | None) -> str:
    figures = "; ".join(_value(setting, sag) for setting in mount.settings)
    if all(setting.step == 0.0 for setting in mount.settings):
        return (
            f"Nothing is set on {mount.name}; check its figures as drilled and printed: {figures}."
        )
    return f"Set {mount.name}: {figures}."


def _value(setting: Setting, sag: Sag | None) -> str:
    unit = "mm" if setting.unit == "mm" else "degrees"
    digits = 0 if setting.step >= 1.0 else 1
    value = set_for_weight(setting, sag).value
    more = value - setting.value
    weight = ""
    if more:
        way = "more" if more > 0.0 else "less"
        weight = f", which is {setting.value:.{digits}f} and {abs(more):g} {way} for its weight"
    return f"{setting.name} {value:.{digits}f} {unit}{weight} (from {setting.measured_from})"


def _check(mount: CameraMount) -> str:
    tapes = "; ".join(f"{t.start} to {t.end} {t.length_mm:.0f} mm" for t in mount.tapes)
    focus = mount.camera.focus_distance_mm
    return f"Check {mount.name} with the tape: {tapes}. Focus at {focus:.0f} mm."
