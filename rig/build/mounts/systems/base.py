"""The one interface of all mount systems."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, Self

from geometry.camera import RigCamera
from rig.build.mounts.clashes import Joined
from rig.build.mounts.settings import CameraMount
from rig.build.mounts.structure import Structure
from rig.build.mounts.surroundings import Surroundings
from rig.build.mounts.systems.heads import HeadKind


@dataclass(frozen=True)
class Spread:
    """By how much feet reach farther than usual, forward and back, and a row of them aside, mm.

    ``tied``: bays that stand beside each other are one body, where the mount has such.
    """

    front_mm: float = 0.0
    rear_mm: float = 0.0
    beside_mm: float = 0.0
    tied: bool = False


USUAL = Spread()


@dataclass(frozen=True, eq=False)
class Built:
    """A structure with the mounts it carries.

    ``joined``: pairs of owners that touch by intent. ``mounts`` have their tapes and what
    carries them. ``notes`` say what a builder should know.
    """

    structure: Structure
    mounts: tuple[CameraMount, ...]
    joined: Joined
    notes: tuple[str, ...] = ()


class Holding(Protocol):
    """Which camera hangs where, before the settings are final."""

    @property
    def system(self) -> MountSystem:
        """Whose arrangement it is."""
        ...

    @property
    def mounts(self) -> tuple[CameraMount, ...]:
        """The cameras on their mounts, in the order they were given."""
        ...

    def with_mounts(self, mounts: tuple[CameraMount, ...]) -> Self:
        """The same arrangement at other settings."""
        ...

    def with_stays(self) -> Self:
        """The same arrangement with back-stays, where the mount has uprights that can lean."""
        ...

    def with_spread(self, spread: Spread) -> Self:
        """The same arrangement on a wider base, where the mount can have one."""
        ...

    def build(self) -> Built:
        """Cut, drill and join everything for the present settings."""
        ...


class MountSystem(Protocol):
    """A way of holding cameras."""

    @property
    def kind(self) -> str:
        """``t-slot``, ``plate``, ``arc`` or ``tripods``."""
        ...

    @property
    def head(self) -> HeadKind | None:
        """The heads of its cameras; None where they have none."""
        ...

    @property
    def steps(self) -> tuple[float, float]:
        """To what its slides (mm) and angles (degrees) can be set; 0: made to the figure."""
        ...

    def hold(self, cameras: tuple[RigCamera, ...], around: Surroundings) -> Holding:
        """Arrange the mounts so that every camera has its wanted pose, not yet rounded.

        Raises a one-line :class:`InputError` that names the nearest possibility for a camera
        that cannot be held.
        """
        ...
