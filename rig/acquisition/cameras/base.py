"""What every camera offers, whatever it is reached by.

A backend is a way to reach cameras (a driver, a library, a folder); it finds them and opens
them. Instants are nanoseconds; which clock they are of stands beside them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8] | NDArray[np.uint16]


class TriggerKind(StrEnum):
    """What makes a camera expose."""

    EDGE = "edge"
    """The rising edge of its trigger line."""
    SOFTWARE = "software"
    """A command over its bus, sent by :meth:`CameraDevice.software_trigger`."""
    NONE = "none"
    """It cannot be triggered: it runs freely, or somebody else fires it."""


class TimestampKind(StrEnum):
    """Which clock stamps a frame."""

    DEVICE = "device"
    """The camera's own, related to the host's by :meth:`CameraDevice.clock_samples`."""
    PTP = "ptp"
    """One clock shared by all cameras of the bus."""
    HOST = "host"
    """The host's, at arrival: later than the exposure by an unknown time."""
    NONE = "none"


class FrameStatus(StrEnum):
    """How a frame arrived."""

    OK = "ok"
    INCOMPLETE = "incomplete"
    """Part of its data is missing."""
    LATE = "late"
    """Whole, but after its deadline."""


@dataclass(frozen=True)
class CameraInfo:
    """A camera that was found.

    ``id`` is its serial number or what names it for good, never an index of a port or of a list.
    """

    id: str
    backend: str
    model: str = ""
    vendor: str = ""
    address: str = ""


@dataclass(frozen=True)
class CameraCapabilities:
    """What a camera can do. ``exposure_start_delay_us`` is from edge to exposure, where known."""

    trigger: TriggerKind
    timestamps: TimestampKind
    frame_counter: bool
    frame_counter_modulus: int | None = None
    """The counter's values before it begins again; None when it never does."""
    frame_counter_skips_zero: bool = False
    exposure_start_delay_us: float | None = None
    settable: frozenset[str] = frozenset()
    """Names of the fields of :class:`CameraSettings` that it obeys."""
    by_files: bool = False
    """Whether its pictures are files of another program, which may be of any shot."""
    fetched: bool = False
    """Whether it keeps its pictures until it is asked for them."""
    wait_overrun_s: float = 0.0
    """How much longer than its timeout :meth:`CameraDevice.wait_frames` may take.

    More than zero only where pictures are computed: the frames then state when they would have
    come, and lateness is judged by that.
    """
    previews: bool = False
    """Whether it can show what it sees without taking a picture: :class:`Previewing`."""


@dataclass(frozen=True)
class CameraSettings:
    """What is asked of a camera; None leaves a setting alone."""

    exposure_us: float | None = None
    gain_db: float | None = None
    iso: int | None = None
    f_number: float | None = None
    pixel_format: str | None = None


@dataclass(frozen=True)
class ArmSpec:
    """One capture to be ready for. ``deadline_s`` is for each frame, from the moment of firing.

    ``number`` counts the captures of a session from 1; 0 for what belongs to none.
    """

    capture_id: str
    shots: int
    deadline_s: float
    number: int = 0


@dataclass(frozen=True)
class ClockSample:
    """One reading of a camera's clock between two readings of the host's monotonic clock."""

    host_before_ns: int
    device_ns: int
    host_after_ns: int


@dataclass(frozen=True, eq=False)
class Frame:
    """One picture as it came, before anybody says which shot it belongs to.

    Either ``pixels`` (H, W) or (H, W, 3) RGB, 8 or 16 bits, or ``encoded``, the bytes of a file
    of ``media_type`` as the camera made it (JPEG, raw). ``counter`` and ``device_ns`` are the
    camera's own; ``arrived_host_ns`` is monotonic time of the host.
    """

    camera_id: str
    arrived_host_ns: int
    status: FrameStatus
    pixels: Image | None = None
    encoded: bytes | None = None
    media_type: str = ""
    counter: int | None = None
    device_ns: int | None = None
    exposure_us: float | None = None
    metadata: Mapping[str, str] = field(default_factory=dict)

    @property
    def has_picture(self) -> bool:
        """Whether there is anything to file: the transport may have lost all of it."""
        return self.pixels is not None or bool(self.encoded)


@dataclass(frozen=True)
class CameraHealth:
    """How a camera is. ``problem`` is empty when all is well, else one sentence."""

    connected: bool
    armed: bool = False
    problem: str = ""
    counters: Mapping[str, int] = field(default_factory=dict)


class CameraDevice(Protocol):
    """One open camera. Used by one thread at a time; :meth:`health` from any.

    Errors: :class:`~common.errors.DeviceError` ``device/camera-gone`` when it does not
    answer, :class:`~common.errors.InputError` for settings it cannot have.
    """

    @property
    def info(self) -> CameraInfo:
        """Which camera this is."""
        ...

    @property
    def capabilities(self) -> CameraCapabilities:
        """What it can do."""
        ...

    def configure(self, settings: CameraSettings) -> CameraSettings:
        """Ask for settings; returns what the camera really has now, None where it cannot tell."""
        ...

    def arm(self, spec: ArmSpec) -> None:
        """Get ready. When this returns, the next edge (or software trigger) makes a frame.

        Frames that arrived before are dropped and counted in ``health().counters``.
        """
        ...

    def software_trigger(self) -> None:
        """Expose now; only for :attr:`TriggerKind.SOFTWARE`."""
        ...

    def wait_frames(self, count: int, timeout_s: float) -> Sequence[Frame]:
        """The frames since :meth:`arm`: when ``count`` are there, or as many as came in time.

        Never raises for frames that do not come: fewer are returned. More than ``count`` may be
        returned: all that have come.
        """
        ...

    def disarm(self) -> None:
        """Stop waiting for triggers. Disarming twice changes nothing."""
        ...

    def clock_samples(self, count: int) -> Sequence[ClockSample]:
        """Readings of the camera's clock; empty unless timestamps are ``DEVICE`` or ``PTP``."""
        ...

    def health(self) -> CameraHealth:
        """How it is; never raises."""
        ...

    def close(self) -> None:
        """Let go of it. Closing twice changes nothing."""
        ...


@runtime_checkable
class Previewing(Protocol):
    """What a :class:`CameraDevice` offers besides where its capabilities say ``previews``."""

    def preview(self, over: Callable[[], bool]) -> Frame | None:
        """What it sees now, by the thread that the camera belongs to, while it is not armed.

        Triggers, counters and the pictures of captures are as if nothing had been asked. Given up
        as soon as ``over`` is true, with None. Raises :class:`DeviceError` as other commands do.
        """
        ...


@runtime_checkable
class FileFed(Protocol):
    """What a :class:`CameraDevice` tells besides where its capabilities say ``by_files``.

    By the thread that the camera belongs to. None of it raises.
    """

    def between(self) -> Sequence[Frame]:
        """Files that came since the capture before and until this one was armed, without content.

        They are no pictures of this one; those of the one before may be late.
        """
        ...

    def kinds(self) -> frozenset[str]:
        """Media types that the newest exposure of before brought, empty when there is none."""
        ...

    def unread(self) -> str:
        """What came since :meth:`CameraDevice.arm` and cannot be filed, by name; else empty."""
        ...


class CameraBackend(Protocol):
    """One way to reach cameras.

    Making one whose library is not installed raises :class:`~common.errors.DeviceError`
    ``device/backend-missing``, with the command that installs it.
    """

    @property
    def name(self) -> str:
        """Its name in station files: ``simulated``, ``folder``, ``genicam``..."""
        ...

    def discover(self) -> Sequence[CameraInfo]:
        """The cameras that can be opened now."""
        ...

    def open(self, camera_id: str) -> CameraDevice:
        """Open one by its :attr:`CameraInfo.id`."""
        ...

    def close(self) -> None:
        """Close what is open and let go of the library."""
        ...
