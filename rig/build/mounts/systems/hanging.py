"""Finding a free place for each outrigger in turn: on a rail that stands, or on a new one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Protocol

from common.errors import InputError
from geometry.arrays import Floats
from geometry.camera import RigCamera
from rig.build.mounts.clashes import Joined, Site, pairs
from rig.build.mounts.kinematics import reach
from rig.build.mounts.settings import CameraMount, Link, Setting, chain_pose
from rig.build.mounts.solids import camera_solids
from rig.build.mounts.structure import Solid
from rig.build.mounts.surroundings import Surroundings
from rig.build.mounts.systems.heads import Stance, stances
from rig.build.mounts.systems.outrigger import FOOTINGS, HeadFooting, Hung, Outrigger

ROOM_MM = 14.0
"""Room kept while mounts are arranged: rounding an angle by half a degree moves a camera
about 6 mm at arm's length, and its neighbour may come the same way."""


class Rail(Protocol):
    """Something along which stubs are set."""

    @property
    def id(self) -> str:
        """Id of the member."""
        ...

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width across and depth."""
        ...

    def setting(self) -> Setting:
        """The position along it, at a value near the middle."""
        ...

    def links(self) -> tuple[Link, ...]:
        """From the rig frame to the frame of a stub on it."""
        ...

    def frame_for(self, point_mm: Floats) -> Floats:
        """The frame (4, 4) of the stub that comes nearest to a point (3,)."""
        ...

    def at(self, value: float) -> Floats:
        """The frame (4, 4) of a stub at a value of the setting."""
        ...


class Rails(Protocol):
    """The rails of a mount in the making."""

    def options(self, camera: RigCamera) -> Iterable[Rail]:
        """Rails for a camera, the best first; new ones are not yet part of the mount."""
        ...

    def keep(self, rail: Rail) -> None:
        """Make a rail part of the mount."""
        ...

    def solids(self, rail: Rail) -> tuple[Solid, ...]:
        """The room a rail takes; nothing when it stands already."""
        ...


@dataclass(frozen=True, eq=False)
class _Option:
    hung: Hung
    rail: Rail
    rail_solids: tuple[Solid, ...]
    own: tuple[Solid, ...]

    @property
    def solids(self) -> tuple[Solid, ...]:
        """All that it adds."""
        return (*self.rail_solids, *self.own)


def hang_all(
    cameras: tuple[RigCamera, ...],
    around: Surroundings,
    rails: Rails,
    parts: Outrigger,
    step_mm: float,
    order: Iterable[int],
) -> tuple[Hung, ...]:
    """One outrigger per camera: the first place without a clash, else the one with fewest."""
    everyone = (*cameras, *around.standing)
    solids = tuple(s for camera in everyone for s in camera_solids(camera))
    site = Site(solids, everyone, around, ROOM_MM)
    hung: dict[int, Hung] = {}
    for index in order:
        best: tuple[int, _Option] | None = None
        for option in _options(cameras[index], rails, parts, step_mm):
            joined = _touching(option)
            count = site.clashes(option.solids, joined)
            count += site.between(option.own, option.rail_solids, joined)
            if best is None or count < best[0]:
                best = (count, option)
            if count == 0:
                break
        if best is None:
            raise InputError(
                "mount-reach",
                f"no rail can carry {cameras[index].name}",
                "allow longer arms or choose another mount",
            )
        chosen = best[1]
        rails.keep(chosen.rail)
        site.add(chosen.solids)
        hung[index] = chosen.hung
    return tuple(hung[k] for k in range(len(cameras)))


def _touching(option: _Option) -> Joined:
    return pairs(*option.hung.touching())


def _options(
    camera: RigCamera, rails: Rails, parts: Outrigger, step_mm: float
) -> Iterator[_Option]:
    for rail in rails.options(camera):
        rough = rail.frame_for(camera.pose.position_rig_mm)
        bases = [(foot, rough[:3, :3] @ foot.rotation()) for foot in FOOTINGS]
        for stance in stances(parts.head, camera, bases):
            for side in (1, -1):
                hung = _hang(camera, rail, parts, step_mm, stance, side)
                if hung is not None:
                    yield _Option(hung, rail, rails.solids(rail), hung.solids())


def _hang(
    camera: RigCamera,
    rail: Rail,
    parts: Outrigger,
    step_mm: float,
    stance: Stance[HeadFooting],
    side: int,
) -> Hung | None:
    """The outrigger at its exact settings; None when one of them is out of range."""
    chain = (*rail.links(), *parts.links(rail.size_mm[1], side, stance.foot, camera))
    settings = (rail.setting(), *parts.settings(stance.angles_deg, step_mm, rail.id))
    values = {s.name: s.value for s in settings}
    try:
        found = reach(chain, values, [s.name for s in settings], stance.pose)
    except InputError:
        # From this rail the pose cannot be reached; another may do.
        return None
    if any(not s.low <= found[s.name] <= s.high for s in settings):
        return None
    placed = camera.moved_to(chain_pose(chain, found))
    mount = CameraMount(placed, camera.pose, tuple(_at(s, found[s.name]) for s in settings), chain)
    along = found[settings[0].name]
    return Hung(mount, rail.id, rail.at(along), rail.size_mm, side, stance.foot, parts)


def _at(setting: Setting, value: float) -> Setting:
    return Setting(
        setting.name, setting.unit, value, setting.step, setting.low, setting.high,
        setting.measured_from, setting.origin,
    )  # fmt: skip


def spread_order(cameras: tuple[RigCamera, ...]) -> list[int]:
    """From left to right: neighbours are arranged one after the other."""
    return sorted(range(len(cameras)), key=lambda k: float(cameras[k].pose.position_rig_mm[0]))
