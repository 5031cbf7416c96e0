"""Whether a structure stays on its feet when somebody pushes it at the height of the head."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull

from common.errors import InputError
from geometry.arrays import Floats
from rig.build.mounts.plan import GRAVITY_M_S2, Stance
from rig.build.mounts.settings import CameraMount
from rig.build.mounts.structure import Structure, levelling_feet
from rig.build.parts.bill import plate_mass_g
from rig.build.statics.framing import FOOT
from rig.build.statics.materials import member_section
from rig.build.statics.weights import Masses, weights

PUSH_SHARE, PUSH_LEAST_N, PUSH_MOST_N = 0.2, 20.0, 250.0
"""A fifth of the weight, 250 N at most: the push that IEC 60950-1, 4.1, asks what stands on a floor
to withstand. At least 20 N, four times the touch of which the lean is told: a light rig is pushed
no more gently."""

FLOOR_MM = 1.0
"""What ends so near over the lowest point of a structure stands on the floor."""

WAYS = {
    "towards the subject": np.array([0.0, 1.0]),
    "away from the subject": np.array([0.0, -1.0]),
    "to the subject's left": np.array([1.0, 0.0]),
    "to the subject's right": np.array([-1.0, 0.0]),
}


def stances(
    structure: Structure, mounts: tuple[CameraMount, ...], datum_mm: Floats, masses: Masses
) -> tuple[Stance, ...]:
    """One for each part that stands by itself; empty for mounts without members.

    Pushed at the height of the datum (3,), about the edges of what lies on the floor, of levelling
    feet about their middles: a pad swivels on its stud. Raises
    :class:`InputError` where a profile's or a plate's mass is not known.
    """
    if not structure.members:
        return ()
    corners = _on_floor(structure)
    floor = min(float(c[:, 2].min()) for c in corners.values())
    found = []
    for body in _bodies(structure):
        mass, centre = _mass(structure, mounts, masses, body)
        low = {k: corners[k][corners[k][:, 2] < floor + FLOOR_MM] for k in body if k in corners}
        on = tuple(m.id for m in structure.members if len(low.get(m.id, ())))
        foot = [low[k] for k in on]
        feet = tuple(m.id for m in structure.members if m.id in on and m.role.endswith(FOOT))
        points = np.concatenate(foot)[:, :2] if foot else np.zeros((0, 2))
        push = float(np.clip(PUSH_SHARE * mass * GRAVITY_M_S2, PUSH_LEAST_N, PUSH_MOST_N))
        height = float(datum_mm[2]) - floor
        inside, way = _least_inside(points, centre[:2])
        # Negative where it falls over by itself.
        tips = mass * GRAVITY_M_S2 * inside / height
        named = max(WAYS, key=lambda word: float(WAYS[word] @ way))
        found.append(Stance(feet or on, mass, centre, height, push, tips, named, way))
    return tuple(found)


def _on_floor(structure: Structure) -> dict[str, Floats]:
    """Points (N, 3) on which members may stand, by member."""
    level: dict[str, list[Floats]] = {}
    for member, _, part in levelling_feet(structure):
        level.setdefault(member.id, []).append(part.rig_from_part[:3, 3])
    if level:
        return {member: np.stack(points) for member, points in level.items()}
    return {s.owner: s.corners_mm for s in structure.solids if s.kind == "member"}


def _least_inside(foot_mm: Floats, centre_mm: Floats) -> tuple[float, Floats]:
    """How far a point (2,) lies inside the hull of a foot (N, 2), and towards which edge."""
    # Two, or several in a row, are no base: it falls over their line.
    if np.linalg.matrix_rank(foot_mm - foot_mm.mean(axis=0), tol=FLOOR_MM) < 2:
        return 0.0, np.array([0.0, 1.0])
    edges = ConvexHull(foot_mm).equations
    inside = -(edges[:, :2] @ centre_mm + edges[:, 2])
    worst = int(np.argmin(inside))
    return float(inside[worst]), edges[worst, :2]


def _bodies(structure: Structure) -> Iterable[set[str]]:
    """Members and plates that joints hold together, as sets of ids."""
    ids = [*(m.id for m in structure.members), *(p.id for p in structure.plates)]
    number = {name: k for k, name in enumerate(ids)}
    ends = [(number[j.on], number[j.other]) for j in structure.joints
            if j.on in number and j.other in number]  # fmt: skip
    rows, columns = np.array(ends, dtype=np.int64).reshape(-1, 2).T
    links = coo_array((np.ones(len(rows)), (rows, columns)), shape=(len(ids), len(ids)))
    count, label = connected_components(links, directed=False)
    return [{ids[k] for k in np.flatnonzero(label == body)} for body in range(count)]


def _mass(
    structure: Structure, mounts: tuple[CameraMount, ...], masses: Masses, body: set[str]
) -> tuple[float, Floats]:
    """Mass in kg and its centre (3,) of a body with everything that hangs on it."""
    pieces: list[tuple[float, Floats]] = []
    for member in structure.members:
        if member.id in body:
            per_mm = member_section(member, masses.catalogue).mass_kg_per_m * 1e-3
            pieces.append((per_mm * member.length_mm, member.axis_mm.mean(axis=0)))
    for plate in structure.plates:
        if plate.id in body:
            mass_g = plate_mass_g(plate)
            if mass_g is None:
                raise InputError(
                    "plate-mass",
                    f"the density of plate {plate.id}'s material {plate.material!r} is not known",
                    "name a material that is, such as aluminium",
                )
            middle = np.append(plate.outline_mm.mean(axis=0), -plate.thickness_mm / 2.0)
            at = plate.rig_from_plate[:3, :3] @ middle + plate.rig_from_plate[:3, 3]
            pieces.append((mass_g * 1e-3, at))
    carried = {m.name for m in mounts if body & set(m.carried_by)}
    joints = {j.id for j in structure.joints if body & {j.on, j.other}}
    pieces += [
        (w.mass_kg, w.at_mm)
        for w in weights(structure, mounts, masses)
        if w.camera in carried or w.joint in joints
    ]
    total = sum(mass for mass, _ in pieces)
    return total, np.asarray(sum(mass * at for mass, at in pieces) / total)
