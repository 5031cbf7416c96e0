"""What can be chosen about the flat things of the scene: targets and the timing board."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

from rig.acquisition.timingboard.reading import TimingBoard
from rig.simulation.checks import require, require_range

Triple = tuple[float, float, float]

TARGET_KINDS = ("aruco", "charuco", "image")


@dataclass(frozen=True)
class PlaceSettings:
    """Where a flat thing stands: its middle, the way its face looks, and the way its top points.

    All in the rig frame. ``up_rig`` need only be roughly right.
    """

    position_rig_mm: Triple
    facing_rig: Triple = (0.0, -1.0, 0.0)
    up_rig: Triple = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        f, u = self.facing_rig, self.up_rig
        cross = (f[1] * u[2] - f[2] * u[1], f[2] * u[0] - f[0] * u[2], f[0] * u[1] - f[1] * u[0])
        sine = math.hypot(*cross) / max(math.hypot(*f) * math.hypot(*u), 1e-300)
        numbers = all(map(math.isfinite, (*self.position_rig_mm, *f, *u)))
        require(
            numbers and sine > 1e-3,
            "place",
            "a flat thing of the simulation has no clear place",
            "give position_rig_mm, and facing_rig and up_rig that do not point the same way",
        )


@dataclass(frozen=True)
class HeldSettings:
    """A target that somebody holds up, in another place for each capture.

    Drawn about its ``place``: up to ``within_mm`` away along the rig's axes, turned by up to
    ``roll_deg`` in its plane and tilted by up to ``tilt_deg`` out of it. Within a capture it is
    still. The draw depends on ``seed`` and the number of the capture in its session only, outside a
    session on how many captures there were since the program began.
    """

    within_mm: Triple = (40.0, 40.0, 40.0)
    tilt_deg: float = 35.0
    roll_deg: float = 180.0
    seed: int = 0

    def __post_init__(self) -> None:
        for value in self.within_mm:
            require_range("held_within_mm", value, 0.0, 1e4)
        require_range("held_tilt_deg", self.tilt_deg, 0.0, 80.0)
        require_range("held_roll_deg", self.roll_deg, 0.0, 180.0)
        require_range("held_seed", self.seed, 0, 2**63)


@dataclass(frozen=True)
class TargetSettings:
    """A flat target. ``size_mm`` is the side of a marker, of a ChArUco square, a picture's width.

    A picture's width is that of all of it, white border included. Pictures that ``rigwright
    targets`` writes say theirs, and another one is refused.

    ``kind`` ``aruco`` takes ``dictionary`` (an OpenCV name, AprilTags too) and ``marker_id``,
    ``charuco`` ``dictionary`` and ``squares`` (across, down), ``image`` the file ``image``.
    Coded targets have a white border of an eighth of ``size_mm``. The back is plain grey. A
    ``sharp`` image has pixels with hard edges, as printed. ``held``: somebody holds it, in
    another place for each capture.
    """

    kind: str
    place: PlaceSettings
    size_mm: float
    dictionary: str = "DICT_4X4_50"
    marker_id: int = 0
    squares: tuple[int, int] = (7, 5)
    image: Path | None = None
    sharp: bool = False
    held: HeldSettings | None = None

    def __post_init__(self) -> None:
        require(
            self.kind in TARGET_KINDS,
            "target-kind",
            f"a target of kind {self.kind!r} is not known",
            f"give {', '.join(TARGET_KINDS)}",
        )
        require_range("target_size_mm", self.size_mm, 0.1, 1e5)
        require(
            self.kind != "image" or self.image is not None,
            "target-image",
            "a target of kind image has no image",
            "give its file",
        )


@dataclass(frozen=True)
class BoardSettings:
    """The LED timing board: what it is, where it stands, how bright its LEDs are.

    ``level`` is the radiance of an LED that is on. The counter is 0 at the rising edge of
    ``sync_output`` in each shot; without one it runs freely, 0 at instant 0 of the host's clock.
    """

    place: PlaceSettings
    board: TimingBoard = field(default_factory=TimingBoard)
    level: float = 0.6
    sync_output: int | None = None

    def __post_init__(self) -> None:
        require_range("led_level", self.level, 0.0, 1e3)
