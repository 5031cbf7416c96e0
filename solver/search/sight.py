"""Which candidates would stand in each other's view: no solve can part what looks at each other."""

from __future__ import annotations

import numpy as np

from geometry.arrays import Bools, Floats, Ints
from geometry.camera import RigCamera
from solver.constraints.builders.rays import frame_normals
from solver.sphere_cover import sphere_cover


def in_each_others_view(cameras: tuple[RigCamera, ...], clearance_mm: float) -> Bools:
    """Pairs (m, m) of which one comes nearer to the view of the other than ``clearance_mm``.

    As the limit on sight lines has it: a body's spheres must all be clear of one and the same
    side of the view, or lie behind the camera.
    """
    kinds = {id(c.camera): c.camera for c in cameras}
    covers = {k: sphere_cover(camera.body) for k, camera in kinds.items()}
    bodies = [covers[id(c.camera)] for c in cameras]
    reach = np.array([(np.linalg.norm(o, axis=1) + r).max() for o, r in bodies])
    centres = np.stack([c.pose.position_rig_mm for c in cameras])
    out = np.zeros((len(cameras), len(cameras)), dtype=np.bool_)
    for i, looking in enumerate(cameras):
        sides = _sides(looking)
        clear = (looking.pose.to_camera(centres) @ sides.T).max(axis=1) - reach
        # Few come so near that their shape matters.
        doubtful = np.flatnonzero(clear < clearance_mm)
        out[i, doubtful] = _inside(cameras, bodies, looking, sides, doubtful, clearance_mm)
    np.fill_diagonal(out, val=False)
    return np.asarray(out | out.T)


def _sides(looking: RigCamera) -> Floats:
    """Outward normals (5, 3) of a view in the camera's frame: its four sides and its back."""
    sides = np.concatenate([frame_normals(looking.camera.frame_limits()), [[0.0, 0.0, -1.0]]])
    return np.asarray(sides / np.linalg.norm(sides, axis=1, keepdims=True))


def _inside(
    cameras: tuple[RigCamera, ...],
    bodies: list[tuple[Floats, Floats]],
    looking: RigCamera,
    sides: Floats,
    others: Ints,
    clearance_mm: float,
) -> Bools:
    """Which of the ``others`` (k,) have a sphere too near on every side, (k,)."""
    out = np.zeros(len(others), dtype=np.bool_)
    for at, k in enumerate(others):
        offset, radius = bodies[k]
        local = looking.pose.to_camera(cameras[k].pose.to_rig(offset))
        out[at] = (local @ sides.T - radius[:, None]).min(axis=0).max() < clearance_mm
    return out
