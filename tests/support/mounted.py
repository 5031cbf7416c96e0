"""One camera on three slides and a head, and networks whose limits are known in closed form."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from rigs import compact_camera

from geometry.camera import RigCamera
from geometry.frames import Pose
from rig.build.mounts.kinematics import ANGLES, head_links
from rig.build.mounts.settings import CameraMount, Link, Motion, Setting, chain_pose
from solver.result import ConstraintRow, Sense

SLIDES = ("x", "y", "z")
NAMES = (*SLIDES, *ANGLES)


def slider(
    name: str = "cam01",
    values: Mapping[str, float] | None = None,
    steps: tuple[float, float] = (1.0, 1.0),
    span: tuple[float, float] = (500.0, 170.0),
    arm_mm: float = 0.0,
) -> CameraMount:
    """A camera ``arm_mm`` before where its slides say, turned by its head's angles."""
    slides = tuple(
        Link(np.eye(4), Motion.SLIDE, axis, key)
        for key, axis in zip(SLIDES, np.eye(3), strict=True)
    )
    chain = slides + head_links(np.eye(4), 0.0, 0.0, np.array([0.0, 0.0, -arm_mm]))
    at = dict.fromkeys(NAMES, 0.0) | dict(values or {})
    units = {key: ("mm" if key in SLIDES else "deg") for key in NAMES}
    settings = tuple(
        Setting(
            key,
            units[key],
            at[key],
            steps[units[key] == "deg"],
            -span[units[key] == "deg"],
            span[units[key] == "deg"],
            "the origin",
        )
        for key in NAMES
    )
    pose = chain_pose(chain, at)
    return CameraMount(placed(name, pose), pose, settings, chain)


def placed(name: str, pose: Pose) -> RigCamera:
    """The compact camera in a pose."""
    return RigCamera(name, compact_camera(), pose, 900.0)


def row(
    name: str, slack: float, limit: float = 10.0, sense: Sense = Sense.AT_LEAST
) -> ConstraintRow:
    """A row of the limits with so much slack; of an equality the tolerance is 2."""
    value = {
        Sense.AT_LEAST: limit + slack,
        Sense.AT_MOST: limit - slack,
        Sense.EQUAL: limit + 2.0 - slack,
    }[sense]
    return ConstraintRow(name, value, limit, sense, "mm", slack, False, slack >= 0.0)


@dataclass
class BoxNetwork:
    """Stands for a network: camera n breaks ``wall_<axis>`` where its centre leaves its box.

    ``low_mm`` and ``high_mm`` (3,): how far the centre may go. ``asked`` counts the questions.
    """

    low_mm: np.ndarray
    high_mm: np.ndarray
    bend: Callable[[float], float] = field(default=lambda off: off)
    asked: int = 0

    def rows(self, _index: int, camera: RigCamera) -> dict[str, ConstraintRow]:
        """Slack of the six walls."""
        centre = np.array([self.bend(float(v)) for v in camera.pose.position_rig_mm])
        found = {}
        for axis, value, low, high in zip(SLIDES, centre, self.low_mm, self.high_mm, strict=True):
            found[f"low_{axis}/{camera.name}"] = row(f"low_{axis}/{camera.name}", value - low)
            found[f"high_{axis}/{camera.name}"] = row(f"high_{axis}/{camera.name}", high - value)
        return found

    def broken(self, _index: int, camera: RigCamera) -> str:
        """The wall that the centre is farthest beyond."""
        self.asked += 1
        worst = min(self.rows(_index, camera).values(), key=lambda r: r.slack)
        return worst.name if worst.slack < 0.0 else ""
