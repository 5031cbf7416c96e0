"""A design with room to build it: limits kept clear of what settings can come out off.

Designs stand exactly on their limits. Before a mount is arranged the cameras are moved a little
off them, by as much as settings half a step off can take them, where that is worth its cost.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from common.progress import CancelToken
from geometry.camera import RigCamera
from geometry.frames import pan_tilt_roll_from_rotation
from geometry.subject import Subject
from rig.build.mounts.kinematics import ANGLES, head_links
from rig.build.mounts.rounding import Rounder
from rig.build.mounts.settings import CameraMount, Link, Motion, Setting, chain_pose
from solver.limits import Limits
from solver.quality import evaluate
from solver.result import Quality

MOST_LOSS = 0.035
"""Share of the median sigma that room may cost: most of the 5 % that building may."""

VIEWS = 3
"""How often cameras are moved anew where they have come to see what they did not: a limit that was
kept for all they saw before may be broken for that."""

MOST_COVERAGE = 5e-4
"""Share of the region that may lose its second view for it."""


def relaxed(
    cameras: tuple[RigCamera, ...],
    subject: Subject,
    limits: Limits,
    *,
    steps: tuple[float, float],
    spare: float,
    tell: Callable[[float], None],
    cancel: CancelToken,
) -> tuple[tuple[RigCamera, ...], float]:
    """The cameras with room to build them, and how much of ``spare`` they were given.

    ``steps``: to what slides (mm) and angles (degrees) of the mount can be set.
    """
    mounts = tuple(_loose(camera, steps) for camera in cameras if not camera.fixed)
    designed = evaluate(subject, cameras, limits)

    def loss(tried: tuple[RigCamera, ...]) -> float:
        now = evaluate(subject, tried, limits)
        if _second_views(designed) - _second_views(now) > MOST_COVERAGE:
            return float("inf")
        return now.sigma_median_mm / designed.sigma_median_mm - 1.0

    at = cameras
    for _ in range(VIEWS):
        rounder = Rounder(subject, limits, at, mounts, spare=spare, tell=tell, cancel=cancel)
        given = rounder.relax(loss, MOST_LOSS)
        mounts = tuple(rounder.mounts)
        placed = {mount.name: mount.camera for mount in mounts}
        at = tuple(placed.get(c.name, c) for c in cameras)
        if not designed.feasible or evaluate(subject, at, limits).feasible:
            break
    return at, given


def _second_views(quality: Quality) -> float:
    return next((c.share for c in quality.coverage if c.views == 2), 0.0)


def _loose(camera: RigCamera, steps: tuple[float, float]) -> CameraMount:
    """A camera on three slides and a head without size, which stand for any mount."""
    slides = tuple(
        Link(np.eye(4), Motion.SLIDE, axis, name)
        for axis, name in zip(np.eye(3), ("x", "y", "z"), strict=True)
    )
    chain = slides + head_links(np.eye(4), 0.0, 0.0, np.zeros(3))
    place, angles = camera.pose.position_rig_mm, pan_tilt_roll_from_rotation(
        camera.pose.rotation_rig_to_camera
    )  # fmt: skip
    settings = tuple(
        Setting(name, "mm", float(value), steps[0], -1e6, 1e6, "the rig's origin")
        for name, value in zip(("x", "y", "z"), place, strict=True)
    ) + tuple(
        Setting(name, "deg", float(value), steps[1], -360.0, 360.0, "the rig's axes")
        for name, value in zip(ANGLES, angles, strict=True)
    )
    values = {setting.name: setting.value for setting in settings}
    placed = camera.moved_to(chain_pose(chain, values))
    return CameraMount(placed, camera.pose, settings, chain)
