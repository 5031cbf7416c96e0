"""How far every camera sinks and leans under the weight of all, and what a touch does to it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from geometry.arrays import Floats
from rig.build.mounts.plan import Give, Sag, Tolerance
from rig.build.mounts.settings import CameraMount, rig_from_camera
from rig.build.mounts.solids import lens_front
from rig.build.mounts.structure import Structure
from rig.build.mounts.tolerancing import half_step
from rig.build.statics.beams import FREEDOMS
from rig.build.statics.framing import StructureFrame, frame_of
from rig.build.statics.weights import Masses, weights

GRAVITY_M_S2 = np.array([0.0, 0.0, -9.81])
TOUCH_N = 5.0
"""A finger that brushes a camera, a cable that is plugged in."""

LEVER_MM = 300.0
"""A radian of turn counts as much as so many millimetres, as in fitting chains to poses."""

PROBE = 1e-3
LEVELLED_FROM = 3
"""Fewer cameras than this have no motion in common that a stand could be set right by."""


def sags(
    structure: Structure,
    mounts: tuple[CameraMount, ...],
    tolerances: tuple[Tolerance, ...],
    masses: Masses,
) -> tuple[Sag, ...]:
    """How each camera gives way; empty for mounts without members, which are not modelled.

    Raises :class:`InputError` for a structure that cannot stand or of which too little is known.
    """
    if not structure.members:
        return ()
    stood = frame_of(structure, masses.catalogue)
    holders = {m.name: _holder(structure, stood, m) for m in mounts}
    weight = stood.frame.weight(GRAVITY_M_S2) + _hung(structure, stood, mounts, holders, masses)
    touches = [_touch(stood, holders[m.name], m, axis) for m in mounts for axis in np.eye(3)]
    found = stood.frame.moves(np.stack([weight, *touches], axis=2))
    allowed = {(t.camera, t.setting): t for t in tolerances}
    moved = [_moves(mount, found, stood, holders[mount.name]) for mount in mounts]
    weights = np.stack([np.concatenate([m[:3, 0], LEVER_MM * m[3:, 0]]) for m in moved])
    if all(s.step <= 0.0 for mount in mounts for s in mount.settings):
        weights = _levelled(weights, np.stack([m.camera.pose.position_rig_mm for m in mounts]))
    return tuple(
        _sag(mount, moves, weight, slice(1 + 3 * k, 4 + 3 * k), allowed)
        for k, (mount, moves, weight) in enumerate(zip(mounts, moved, weights, strict=True))
    )


def _levelled(weights: Floats, places_mm: Floats) -> Floats:
    """What is left of sags (C, 6), turns times the lever, when the whole stand is set right again.

    What nobody can set on its camera, a plate's holes and wedges, moves with its stand, which is
    levelled and put before the subject with everything hung on it.
    """
    if len(places_mm) < LEVELLED_FROM:
        return weights
    blocks = []
    for place in places_mm - places_mm.mean(axis=0):
        x, y, z = place / LEVER_MM
        turn = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
        blocks.append(np.block([[np.eye(3), turn], [np.zeros((3, 3)), np.eye(3)]]))
    common = np.concatenate(blocks)
    found = np.linalg.lstsq(common, weights.ravel(), rcond=None)[0]
    return np.asarray(weights - (common @ found).reshape(weights.shape))


def _holder(structure: Structure, stood: StructureFrame, mount: CameraMount) -> int:
    """The node of the last beam that carries a camera."""
    own = {p.id for p in structure.parts if p.camera == mount.name}
    own |= {w.id for w in structure.wedges if w.camera == mount.name}
    return next(
        node for (joint, end), node in stood.node_of_joint.items()
        for j in structure.joints
        if j.id == joint and ((end == j.on and j.other in own) or (end == j.other and j.on in own))
    )  # fmt: skip


def _force_at(stood: StructureFrame, node: int, at_mm: Floats, force_n: Floats) -> Floats:
    """A force (3,) at a place as a load (N, 6) on the node that holds the place."""
    load = np.zeros((len(stood.places_mm), FREEDOMS))
    moment = np.cross(at_mm - stood.places_mm[node], force_n)
    load[node] = np.concatenate([force_n, moment])
    return load


def _hung(
    structure: Structure,
    stood: StructureFrame,
    mounts: tuple[CameraMount, ...],
    holders: Mapping[str, int],
    masses: Masses,
) -> Floats:
    """The weight of all that hangs on members, as a load (N, 6)."""
    load = np.zeros((len(stood.places_mm), FREEDOMS))
    held = {joint: node for (joint, _), node in reversed(stood.node_of_joint.items())}
    for weight in weights(structure, mounts, masses):
        node = holders.get(weight.camera, held.get(weight.joint))
        if node is not None:
            load += _force_at(stood, node, weight.at_mm, weight.mass_kg * GRAVITY_M_S2)
    return load


def _touch(stood: StructureFrame, node: int, mount: CameraMount, axis: Floats) -> Floats:
    return _force_at(stood, node, lens_front(mount.camera), TOUCH_N * axis)


def _moves(mount: CameraMount, found: Floats, stood: StructureFrame, node: int) -> Floats:
    """Shifts (mm) and turns (radians) of a camera under each load, (6, K)."""
    eye = mount.camera.pose.position_rig_mm - stood.places_mm[node]
    shifts = found[node, :3] + np.cross(found[node, 3:], eye, axis=0)
    return np.concatenate([shifts, found[node, 3:]])


def _sag(
    mount: CameraMount,
    moves: Floats,
    weight: Floats,
    touches: slice,
    allowed: Mapping[tuple[str, str], Tolerance],
) -> Sag:
    """``weight`` (6,): what its settings would have to make up for, turns times the lever."""
    return Sag(
        mount.name,
        moves[:3, 0],
        float(np.degrees(np.linalg.norm(moves[3:, 0]))),
        float(np.linalg.norm(moves[:3, touches], 2)),
        float(np.degrees(np.linalg.norm(moves[3:, touches], 2))),
        _gives(mount, weight, allowed),
    )


def _gives(
    mount: CameraMount, moved: Floats, allowed: Mapping[tuple[str, str], Tolerance]
) -> tuple[Give, ...]:
    """The errors of the settings that would move a camera as its sag does.

    The least ones where there are more settings than ways to move.
    """
    columns = np.stack([_motion(mount, s.name, s.value) for s in mount.settings], axis=1)
    scale = np.array([1.0 if s.unit == "mm" else np.degrees(1.0 / LEVER_MM)
                      for s in mount.settings])  # fmt: skip
    errors = scale * np.linalg.lstsq(columns * scale, moved, rcond=1e-9)[0]
    out = []
    for setting, error in zip(mount.settings, errors.tolist(), strict=True):
        tolerance = allowed.get((mount.name, setting.name))
        most = np.inf
        if tolerance is not None:
            # Nothing is asked of a frame that nobody could set: half a step is always allowed.
            side = tolerance.plus if error > 0.0 else tolerance.minus
            most = max(abs(side), half_step(setting))
        out.append(Give(setting.name, setting.unit, error, float(most), setting.step))
    return tuple(out)


def _motion(mount: CameraMount, name: str, value: float) -> Floats:
    """Shift (mm) and turn (times the lever) of a camera by one unit of a setting, (6,)."""
    here, there = (
        rig_from_camera(mount.pose({name: value + side * PROBE})) for side in (-1.0, 1.0)
    )
    turned = there[:3, :3] @ here[:3, :3].T
    turn = 0.5 * np.array(
        [turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]
    )
    moved = np.concatenate([there[:3, 3] - here[:3, 3], LEVER_MM * turn])
    return np.asarray(moved / (2.0 * PROBE))
