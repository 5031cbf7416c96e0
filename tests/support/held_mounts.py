"""Four cameras about a face, held by each kind of mount: arranged once for all tests."""

from __future__ import annotations

from functools import cache

from rigs import face, face_cameras, face_limits

from geometry.camera import RigCamera
from rig.build.mounts.surroundings import Surroundings
from rig.build.mounts.systemfile import system_from_mapping
from rig.build.mounts.systems.base import Holding

AROUND = Surroundings(face(), face_limits(), (), -1200.0, 2.0)


@cache
def four_cameras() -> tuple[RigCamera, ...]:
    return face_cameras(face(), 4)


@cache
def held(kind: str) -> Holding:
    """The cameras on a mount with its defaults, not rounded."""
    return system_from_mapping({"kind": kind}).system.hold(four_cameras(), AROUND)
