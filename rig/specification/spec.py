"""A rig to be designed, as the program sees it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from common.errors import InputError
from geometry.camera import Camera, RigCamera
from geometry.frames import Pose
from geometry.preparation import SubjectOptions
from geometry.scanoptions import ScanOptions
from rig.specification.contradictions import check_limits
from solver.limits import Limits
from solver.strategy import Strategy


@dataclass(frozen=True, eq=False)
class RigSpec:
    """What a design is asked for.

    ``count`` cameras of the kind ``camera`` are placed; ``fixed`` ones stand already and come
    on top. ``start`` holds one start pose per camera to place, or none. ``starts`` is the
    number of starts to try, ``strategy`` where they come from. With a ``count`` of 0 the rig is the
    fixed cameras. Raises :class:`InputError` when the parts contradict each other.
    """

    name: str
    camera: Camera
    count: int
    seed: int
    starts: int
    strategy: Strategy
    limits: Limits
    fixed: tuple[RigCamera, ...]
    start: tuple[Pose, ...]
    scan_options: ScanOptions
    subject_options: SubjectOptions

    def __post_init__(self) -> None:
        total = self.count + len(self.fixed)
        if self.count < 0 or total < 2:
            raise InputError(
                "rig-too-few-cameras",
                f"the rig has {total} camera{'' if total == 1 else 's'}, {self.count} to place",
                "place more, or give the [[fixed]] ones: one camera cannot measure",
            )
        if self.start and len(self.start) != self.count:
            raise InputError(
                "limits-contradict",
                f"cameras is {self.count}, but there are {len(self.start)} [[start]] poses",
                "give one start pose per camera to place, or none",
            )
        names = [camera.name for camera in self.fixed]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError(
                "value", f"two fixed cameras are called {twice[0]!r}", "give each a name of its own"
            )
        check_limits(self.camera, self.limits, total)

    def with_count(self, count: int) -> RigSpec:
        """The same rig with another number of cameras to place."""
        return replace(self, count=count)

    def with_seed(self, seed: int) -> RigSpec:
        """The same rig with another seed."""
        options = replace(self.subject_options, seed=seed)
        return replace(self, seed=seed, subject_options=options)
