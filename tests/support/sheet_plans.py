"""Plans of cameras with odd rolls, and one that looks steeply down, on every kind of mount."""

from __future__ import annotations

from functools import cache

import numpy as np
from rigs import compact_camera, face, face_limits

from geometry.camera import RigCamera
from geometry.frames import Pose
from rig.build.mounts.making import figures
from rig.build.mounts.plan import MountPlan, Price
from rig.build.mounts.surroundings import Surroundings
from rig.build.mounts.systemfile import parse_system
from solver.quality import evaluate

KINDS = ("t-slot", "plate", "arc", "tripods")


@cache
def cameras() -> tuple[RigCamera, ...]:
    """Odd rolls, and one that looks so steeply down that its head needs a pivot."""
    target = face().design_points.centroid_mm
    views = ((-40.0, 5.0, 20.0), (0.0, 62.0, 0.0), (38.0, -12.0, 33.0))
    found = []
    for k, (azimuth, elevation, roll) in enumerate(views, 1):
        az, el = np.radians([azimuth, elevation])
        way = np.array([np.sin(az) * np.cos(el), -np.cos(az) * np.cos(el), np.sin(el)])
        pose = Pose.looking_at(target + 900.0 * way, target, roll)
        found.append(RigCamera(f"cam{k:02d}", compact_camera(), pose, 900.0))
    return tuple(found)


@cache
def plan(kind: str) -> MountPlan:
    held = cameras() if kind in ("t-slot", "arc") else (cameras()[0], cameras()[2])
    around = Surroundings(face(), face_limits(), (), -1400.0, 2.0)
    built = parse_system(f'kind = "{kind}"').system.hold(held, around).build()
    now = figures(evaluate(face(), tuple(m.camera for m in built.mounts), face_limits()))
    return MountPlan(
        "rig", kind, around.datum_mm, built.structure, built.mounts, Price(now, now, now), (), (),
        1.0, 1,
    )  # fmt: skip
