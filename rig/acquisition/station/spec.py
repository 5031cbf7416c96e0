"""A station as the rest of the program sees it: frozen, checked as a whole."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

from common.errors import InputError
from rig.acquisition.cameras.base import CameraSettings


class Interlock(StrEnum):
    """What a capture asks of the interlock before it arms the box."""

    REQUIRED = "required"
    """The box must say that it is closed."""
    IF_PRESENT = "if-present"
    """Only an open one stops a capture; a box that has none is fine."""


class ImageFormat(StrEnum):
    """How pictures are filed that come as pixels. Files made by a camera stay as they are."""

    JPEG = "jpeg"
    PNG = "png"
    TIFF = "tiff"


@dataclass(frozen=True)
class TriggerPlan:
    """The box and how to reach it. ``lead_us`` is from FIRE to the first shot's start.

    ``half_press`` (ESPER): the focus lines are held from ARM until the capture is over, and for
    ``focus_lead_us`` at least before it fires.
    """

    backend: str
    url: str
    serial_number: str | None = None
    lead_us: float = 2000.0
    interlock: Interlock = Interlock.IF_PRESENT
    half_press: bool = False
    focus_lead_us: float = 0.0


@dataclass(frozen=True)
class CameraPlan:
    """One camera: which device, which outputs fire it, and what is expected of it.

    ``delay_us`` is from the shot's zero to the rising edge on ``output``; the focus line rises
    ``focus_lead_us`` before that edge. ``expected_lag_us`` is from that edge to the start of the
    exposure, right to ``lag_tolerance_us``.
    """

    name: str
    backend: str
    id: str
    output: int | None = None
    focus_output: int | None = None
    focus_lead_us: float = 0.0
    delay_us: float = 0.0
    width_us: float = 1000.0
    settings: CameraSettings = field(default_factory=CameraSettings)
    expected_lag_us: float = 0.0
    lag_tolerance_us: float = 20_000.0
    image_size_px: tuple[int, int] | None = None
    kinds: frozenset[str] = frozenset()
    """Media types of the files that each shot must bring; empty: one of any kind."""


@dataclass(frozen=True)
class LightPlan:
    """A strobe or a synchronisation LED: its output and its pulse in each shot."""

    output: int
    delay_us: float
    width_us: float


@dataclass(frozen=True)
class BoardPlan:
    """An LED timing board as it was built; the fields are those of a ``TimingBoard``."""

    bits: int = 16
    tick_us: float = 100.0
    pitch_mm: float = 7.0
    row_gap_mm: float = 10.0
    led_diameter_mm: float = 3.0
    marker_mm: float = 20.0
    dictionary: str = "DICT_4X4_50"
    marker_ids: tuple[int, int, int, int] = (40, 41, 42, 43)


@dataclass(frozen=True)
class CapturePolicy:
    """How captures are taken. ``skew_limit_us`` is for the middles of the exposures."""

    ready_deadline_s: float = 5.0
    frame_deadline_s: float = 2.0
    settle_s: float = 0.1
    allow_partial: bool = False
    min_free_mb: float = 1000.0
    skew_limit_us: float = 1000.0
    image_format: ImageFormat = ImageFormat.JPEG
    jpeg_quality: int = 95


@dataclass(frozen=True)
class Station:
    """Everything about a rig that stands. Raises :class:`InputError` for contradictions."""

    name: str
    cameras: tuple[CameraPlan, ...]
    trigger: TriggerPlan | None = None
    strobes: tuple[LightPlan, ...] = ()
    leds: tuple[LightPlan, ...] = ()
    board: BoardPlan | None = None
    policy: CapturePolicy = CapturePolicy()
    design: Path | None = None
    backend_options: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    simulation: Mapping[str, Any] | None = None
    """Settings of the simulated backend as they stand in the file, or None."""
    path: Path | None = None
    text: str = ""
    """The file it was read from, as it stood."""

    def __post_init__(self) -> None:
        _names_differ([camera.name for camera in self.cameras])
        _devices_differ(self.cameras)
        _outputs_differ(self)
        lost = [c.name for c in self.cameras if c.output is not None and self.trigger is None]
        if lost:
            raise InputError(
                "station-no-trigger",
                f"camera {lost[0]!r} is fired by an output, but the station has no trigger box",
                "add [trigger], or leave output away",
            )

    def camera(self, name: str) -> CameraPlan:
        """The camera of that name; :class:`InputError` when there is none."""
        for camera in self.cameras:
            if camera.name == name:
                return camera
        names = ", ".join(camera.name for camera in self.cameras)
        raise InputError("camera-unknown", f"there is no camera {name!r}", f"choose one of {names}")

    @property
    def zero_us(self) -> float:
        """From the shot's start at the box to its zero: room for the focus lines to lead."""
        leads = [
            camera.focus_lead_us - camera.delay_us
            for camera in self.cameras
            if camera.focus_output is not None
        ]
        return max([0.0, *leads])

    def shutter_delay_us(self, camera: CameraPlan) -> float:
        """From the shot's start at the box to the rising edge that fires ``camera``."""
        return self.zero_us + camera.delay_us


def _names_differ(names: list[str]) -> None:
    if not names:
        raise InputError("station-empty", "the station has no camera", "add a [[camera]]")
    folded = [name.casefold() for name in names]
    twice = sorted({n for n, f in zip(names, folded, strict=True) if folded.count(f) > 1})
    if twice:
        # Names become folders, and a session may be copied to a disk that ignores case.
        raise InputError(
            "value",
            f"two cameras are called {twice[0]!r} (capitals do not count)",
            "give each a name of its own",
        )


def _devices_differ(cameras: tuple[CameraPlan, ...]) -> None:
    seen: dict[tuple[str, str], str] = {}
    for camera in cameras:
        other = seen.setdefault((camera.backend, camera.id), camera.name)
        if other != camera.name:
            raise InputError(
                "value",
                f"cameras {other!r} and {camera.name!r} are the same device {camera.id!r}",
                "give each its own id",
            )


@dataclass(frozen=True)
class _Use:
    """What an output does: ``timing`` is what its pulse is made of."""

    user: str
    job: str
    timing: tuple[float, ...]


def _outputs_differ(station: Station) -> None:
    """Several cameras may hang on one output, by a line each, where one pulse fits them all."""
    used: dict[int, _Use] = {}
    for output, use in _outputs(station):
        other = used.setdefault(output, use)
        if other.job != use.job or (use.job == "light" and other is not use):
            raise InputError(
                "value",
                f"output {output} is used by {other.user} and by {use.user}",
                "give each its own output; only cameras may share one, for the same job",
            )
        if other.timing != use.timing:
            raise InputError(
                "value",
                f"{other.user} and {use.user} share output {output}, and their pulses differ",
                "give them equal delay_us, width_us and, for a focus line, focus_lead_us; or each "
                "its own output",
            )


def _outputs(station: Station) -> list[tuple[int, _Use]]:
    found = []
    for camera in station.cameras:
        name, pulse = f"camera {camera.name!r}", (camera.delay_us, camera.width_us)
        if camera.output is not None:
            found.append((camera.output, _Use(name, "shutter", pulse)))
        if camera.focus_output is not None:
            use = _Use(f"the focus of {name}", "focus", (*pulse, camera.focus_lead_us))
            found.append((camera.focus_output, use))
    lights = [(f"strobe {k}", light) for k, light in enumerate(station.strobes, 1)]
    lights += [(f"LED {k}", light) for k, light in enumerate(station.leds, 1)]
    found += [(light.output, _Use(name, "light", ())) for name, light in lights]
    return found
