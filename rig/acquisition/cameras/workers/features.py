"""The features of GenICam cameras by name: one place for both libraries that reach them.

Names are those of the SFNC of the EMVA and, after them, the older ones cameras still carry.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Optional, Protocol, Union

from common.errors import InputError

Value = Union[str, float, int]  # noqa: UP007  evaluated: a system's Python may be older than 3.10

EXPOSURE = ("ExposureTime", "ExposureTimeAbs")
GAIN = ("Gain",)
LATCHES = (
    ("TimestampLatch", "TimestampLatchValue", None),
    ("GevTimestampControlLatch", "GevTimestampValue", "GevTimestampTickFrequency"),
)
PTP = (("PtpEnable", "PtpStatus"), ("GevIEEE1588", "GevIEEE1588Status"))
PTP_LOCKED = ("Master", "Slave", "Grandmaster")
EXPOSURE_DELAY = ("BslExposureStartDelay",)


class Nodes(Protocol):
    """A camera's features."""

    def has(self, name: str) -> bool:
        """Whether it is there and can be used now."""
        ...

    def get(self, name: str) -> Value:
        """Its value."""
        ...

    def set(self, name: str, value: Value) -> None:
        """Set it."""
        ...

    def run(self, name: str) -> None:
        """Execute a command."""
        ...

    def bounds(self, name: str) -> Optional[tuple[float, float]]:  # noqa: UP045
        """Least and greatest value of a number."""
        ...

    def choices(self, name: str) -> Sequence[str]:
        """Values of an enumeration."""
        ...


def first(nodes: Nodes, names: Sequence[str]) -> str:
    """The first of these features that the camera has, or an empty string."""
    return next((name for name in names if nodes.has(name)), "")


def settable(nodes: Nodes) -> list[str]:
    """Fields of the settings that the camera obeys."""
    fields = {
        "exposure_us": first(nodes, EXPOSURE),
        "gain_db": first(nodes, GAIN),
        "pixel_format": first(nodes, ("PixelFormat",)),
    }
    return [field for field, name in fields.items() if name]


def configure(nodes: Nodes, wanted: Mapping[str, Any]) -> dict[str, Any]:
    """Set what is wanted and read everything back. InputError for what cannot be had."""
    for field in ("iso", "f_number"):
        if wanted.get(field) is not None:
            raise _cannot(field, "this camera has no such setting", "leave it out")
    _set_number(nodes, EXPOSURE, "exposure_us", wanted.get("exposure_us"), "ExposureAuto")
    _set_number(nodes, GAIN, "gain_db", wanted.get("gain_db"), "GainAuto")
    _set_choice(nodes, "PixelFormat", "pixel_format", wanted.get("pixel_format"))
    return read_settings(nodes)


def read_settings(nodes: Nodes) -> dict[str, Any]:
    """The settings as the camera has them now."""
    exposure, gain = first(nodes, EXPOSURE), first(nodes, GAIN)
    return {
        "exposure_us": float(nodes.get(exposure)) if exposure else None,
        "gain_db": float(nodes.get(gain)) if gain else None,
        "pixel_format": str(nodes.get("PixelFormat")) if nodes.has("PixelFormat") else None,
    }


def _set_number(
    nodes: Nodes,
    names: Sequence[str],
    field: str,
    value: Any,  # noqa: ANN401  as it came from the host
    auto: str,
) -> None:
    if value is None:
        return
    name = first(nodes, names)
    if not name:
        raise _cannot(field, "this camera has no such setting", "leave it out")
    # While an automatic holds it the feature is locked, and writing it is an error.
    if nodes.has(auto) and "Off" in nodes.choices(auto):
        nodes.set(auto, "Off")
    bounds = nodes.bounds(name)
    if bounds and not bounds[0] <= float(value) <= bounds[1]:
        raise _cannot(
            field,
            f"{value:g} is out of the camera's range",
            f"choose from {bounds[0]:g} to {bounds[1]:g}",
        )
    nodes.set(name, float(value))


def _set_choice(nodes: Nodes, name: str, field: str, value: Any) -> None:  # noqa: ANN401
    if value is None:
        return
    choices = nodes.choices(name) if nodes.has(name) else ()
    if value not in choices:
        listed = ", ".join(choices) or "nothing: the camera has no such setting"
        raise _cannot(field, f"the camera has no {value}", f"choose from {listed}")
    nodes.set(name, str(value))


def _cannot(field: str, problem: str, remedy: str) -> InputError:
    return InputError("camera-setting", f"{field}: {problem}", remedy)


def set_trigger(nodes: Nodes, kind: str, line: str) -> str:
    """Make an edge, a command or nothing start each frame; the kind the camera really has.

    A camera without triggering runs freely, ``none``. InputError when it can be triggered, but
    not from ``line`` or not by command.
    """
    if not nodes.has("TriggerMode"):
        return "none"
    if nodes.has("TriggerSelector") and "FrameStart" in nodes.choices("TriggerSelector"):
        nodes.set("TriggerSelector", "FrameStart")
    if kind == "none":
        nodes.set("TriggerMode", "Off")
        return "none"
    source = "Software" if kind == "software" else line
    sources = nodes.choices("TriggerSource")
    if source not in sources:
        raise InputError(
            "camera-trigger",
            f"the camera cannot be triggered by '{source}'",
            f"set the option 'trigger' or 'trigger_line'; it has {', '.join(sources)}",
        )
    nodes.set("TriggerSource", source)
    if kind == "edge" and nodes.has("TriggerActivation"):
        nodes.set("TriggerActivation", "RisingEdge")
    nodes.set("TriggerMode", "On")
    return kind


@contextlib.contextmanager
def untriggered(nodes: Nodes) -> Iterator[None]:
    """Inside, the camera exposes by itself; afterwards it waits for its trigger as before."""
    before = nodes.get("TriggerMode") if nodes.has("TriggerMode") else "Off"
    if before == "Off":
        yield
        return
    nodes.set("TriggerMode", "Off")
    try:
        yield
    finally:
        nodes.set("TriggerMode", str(before))


def set_rate(nodes: Nodes, rate_hz: Optional[float]) -> None:  # noqa: UP045
    """Frames per second of a camera that runs freely; None leaves it alone."""
    if rate_hz is None or not nodes.has("AcquisitionFrameRate"):
        return
    if nodes.has("AcquisitionFrameRateEnable"):
        nodes.set("AcquisitionFrameRateEnable", 1)
    nodes.set("AcquisitionFrameRate", float(rate_hz))


def enable_ptp(nodes: Nodes) -> None:
    """Switch the shared clock on where the camera has one; locking to it takes seconds."""
    switch = first(nodes, [name for name, _ in PTP])
    if switch:
        nodes.set(switch, 1)


def ptp_locked(nodes: Nodes) -> bool:
    """Whether the camera's clock follows, or is, the clock of the bus."""
    status = first(nodes, [name for _, name in PTP])
    return bool(status) and str(nodes.get(status)) in PTP_LOCKED


def await_ptp(nodes: Nodes, wait_s: float) -> bool:
    """Wait until the clock is locked, at most so long; whether it is."""
    deadline = time.monotonic() + wait_s
    while not ptp_locked(nodes):
        if time.monotonic() > deadline:
            return False
        time.sleep(0.2)
    return True


def latch(nodes: Nodes) -> Optional[tuple[int, int, int]]:  # noqa: UP045
    """One reading of the camera's clock: host before, device, host after, in ns.

    None where the camera has no clock to read, and where it stands still at zero.
    """
    for command, value, frequency in LATCHES:
        if nodes.has(command) and nodes.has(value):
            before = time.monotonic_ns()
            nodes.run(command)
            after = time.monotonic_ns()
            ticks = int(nodes.get(value))
            rate = int(nodes.get(frequency)) if frequency and nodes.has(frequency) else 10**9
            return (before, ticks * 10**9 // rate, after) if ticks and rate else None
    return None


def exposure_delay_us(nodes: Nodes) -> Optional[float]:  # noqa: UP045
    """From edge to exposure in microseconds, where the camera tells it."""
    name = first(nodes, EXPOSURE_DELAY)
    return float(nodes.get(name)) if name else None
