"""The assembly steps: numbered sentences that name members, lengths, holes and settings."""

from __future__ import annotations

from rig.mounts.settings import CameraMount, Setting
from rig.mounts.structure import Joint, Member, Plate, Structure


def assembly_steps(structure: Structure, mounts: tuple[CameraMount, ...]) -> tuple[str, ...]:
    """What to do, one step after the other."""
    steps = [_cut(structure.members)] if structure.members else []
    steps += [_drill(plate) for plate in structure.plates]
    carried = {name for mount in mounts for name in mount.carried_by}
    frame = {m.id for m in structure.members} | {p.id for p in structure.parts}
    frame |= {p.id for p in structure.plates}
    own = {f"{m.name} stub" for m in mounts} | {f"{m.name} arm" for m in mounts}
    for joint in structure.joints:
        if joint.on in frame - own and joint.other in frame - own:
            steps.append(_join(joint))
    steps += [
        "Set up the subject's head form or a pointer at the datum, and check that the frame stands "
        "level and square to it."
    ]
    for mount in mounts:
        steps.append(_hang(mount, structure, carried))
        steps.append(_check(mount))
    return tuple(f"{k}. {text}" for k, text in enumerate(steps, 1))


def _cut(members: tuple[Member, ...]) -> str:
    pieces = "; ".join(f"{m.id} {m.part} {m.length_mm:.0f} mm" for m in members)
    return f"Cut to length: {pieces}."


def _drill(plate: Plate) -> str:
    holes = "; ".join(
        f"{h.label} at {h.x_mm:.1f}, {h.y_mm:.1f} mm, {h.kind} {h.diameter_mm:.1f} mm"
        + (f" {h.thread}" if h.thread else "")
        for h in plate.holes
    )
    return f"Drill plate {plate.id} ({plate.material}, {plate.thickness_mm:g} mm): {holes}."


def _join(joint: Joint) -> str:
    where = "" if joint.along_mm is None else f", {joint.along_mm:.0f} mm from its start"
    angle = "" if joint.angle_deg is None else f", at {joint.angle_deg:g} degrees"
    parts = ", ".join(f"{count} x {part}" for part, count in joint.fasteners.items())
    return f"Join {joint.other} to {joint.on}{where}{angle}" + (f" with {parts}." if parts else ".")


def _value(setting: Setting) -> str:
    unit = "mm" if setting.unit == "mm" else "degrees"
    digits = 0 if setting.step >= 1.0 else 1
    return f"{setting.name} {setting.value:.{digits}f} {unit} (from {setting.measured_from})"


def _hang(mount: CameraMount, structure: Structure, carried: set[str]) -> str:
    chain = ", ".join(name for name in mount.carried_by if name in carried)
    angles = [
        f"{j.other} at {j.angle_deg:g} degrees on {j.on}"
        for j in structure.joints
        if j.angle_deg is not None and j.other in mount.carried_by
    ]
    pitched = f" Fix {'; '.join(angles)}." if angles else ""
    settings = "; ".join(_value(s) for s in mount.settings)
    return f"Hang {mount.name} on {chain}.{pitched} Set {settings}."


def _check(mount: CameraMount) -> str:
    tapes = "; ".join(f"{t.start} to {t.end} {t.length_mm:.0f} mm" for t in mount.tapes)
    focus = mount.camera.focus_distance_mm
    return f"Check {mount.name} with the tape: {tapes}. Focus at {focus:.0f} mm."
