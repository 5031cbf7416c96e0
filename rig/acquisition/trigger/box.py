"""What every trigger box offers, whoever made it.

Outputs are numbered from 1 as on the box. Times within a shot are microseconds from the shot's
start. Instants are nanoseconds of the host's monotonic clock (``time.monotonic_ns``): the box's
own clock never leaves its driver.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

from common.errors import InputError

DEAD_MAN_S = 3.0


class TriggerState(StrEnum):
    """Where a box is, as its driver knows it."""

    DISCONNECTED = "disconnected"
    OPENING = "opening"
    PROBING = "probing"
    READY = "ready"
    ARMED = "armed"
    FIRING = "firing"
    FAULT = "fault"
    """The box has stopped for safety and wants a reset."""


class FireOutcome(StrEnum):
    """What became of a capture at the box."""

    FIRED = "fired"
    """Every pulse was made, and the box says so."""
    PARTIAL = "partial"
    """Stopped on the way: some pulses were made."""
    NOT_FIRED = "not-fired"
    """No pulse was made, and the box says so."""
    UNKNOWN = "unknown"
    """Nobody can tell: the box was lost, or has forgotten, or never answers."""


@dataclass(frozen=True)
class Pulse:
    """One output's pulse in each shot. A width of 0 means none."""

    delay_us: float
    width_us: float

    def __post_init__(self) -> None:
        if not (0.0 <= self.delay_us <= 1e9 and 0.0 <= self.width_us <= 1e9):
            raise InputError(
                "pulse",
                f"a pulse of {self.width_us:g} us after {self.delay_us:g} us cannot be made",
                "give a delay and a width of 0 us or more",
            )


@dataclass(frozen=True)
class ArmRequest:
    """One capture to be armed. ``capture_id`` is the host's and is never used twice.

    ``pulses`` by output; ``shots`` in a burst, ``interval_us`` from start to start; ``lead_us``
    from FIRE to the first shot's start; ``expires_s`` until the box disarms itself.
    ``dead_man_s``: how long a box that can goes on firing without a sign of life of this computer;
    0 lets it fire to the end, whoever is there.
    """

    capture_id: str
    pulses: Mapping[int, Pulse]
    shots: int = 1
    interval_us: float = 0.0
    lead_us: float = 2000.0
    expires_s: float = 30.0
    dead_man_s: float = DEAD_MAN_S


@dataclass(frozen=True)
class Edge:
    """One change of one output in one shot, as the box's own log has it.

    ``at_host_ns`` is on the host's monotonic clock; ``late_us`` how much later than programmed.
    """

    shot: int
    output: int
    rising: bool
    at_us: float
    at_host_ns: int
    late_us: float


@dataclass(frozen=True)
class WireLine:
    """One line as it went over the wire between host and box."""

    host_ns: int
    sent: bool
    text: str


@dataclass(frozen=True)
class FireReport:
    """What the box says of a capture: the first of three levels of evidence.

    ``clock_uncertainty_us`` is the half width within which ``at_host_ns`` of the edges is known
    (differences between edges do not suffer from it). ``edges`` is empty for a box without a log.
    ``why`` says how the outcome was found where it was not plainly acknowledged. ``wire`` is what
    host and box said to each other from ARM on.
    """

    capture_id: str
    outcome: FireOutcome
    shots_done: int
    shots_wanted: int
    edges: tuple[Edge, ...] = ()
    clock_uncertainty_us: float = float("nan")
    acknowledged: bool = True
    why: str = ""
    wire: tuple[WireLine, ...] = ()

    def rising_edges(self, output: int) -> tuple[Edge, ...]:
        """The rising edges of one output, shot by shot."""
        return tuple(edge for edge in self.edges if edge.output == output and edge.rising)


@dataclass(frozen=True)
class TriggerCapabilities:
    """What a kind of box can do."""

    outputs: int
    tick_us: float
    max_delay_us: float
    max_width_us: float
    max_shots: int
    acknowledges_fire: bool
    edge_log: bool
    clock: bool
    dead_man: bool = False
    """Whether it stops a burst by itself when this computer falls silent."""


@dataclass(frozen=True)
class TriggerHealth:
    """How a box and its line are. ``clock_residual_us`` is the rms of the clock fit."""

    state: TriggerState
    identity: str = ""
    serial_number: str = ""
    firmware: str = ""
    boots: int | None = None
    interlock_closed: bool | None = None
    armed_capture: str | None = None
    clock_residual_us: float | None = None
    round_trip_p50_ms: float | None = None
    round_trip_p99_ms: float | None = None
    counters: Mapping[str, int] = field(default_factory=dict)
    last_problem: str = ""


class ReportSource(Protocol):
    """Whoever tells what a box did."""

    def subscribe(self, listener: Callable[[FireReport], None]) -> Callable[[], None]:
        """Hear every report; returns what ends the subscription."""
        ...


class TriggerBox(Protocol):
    """A box that fires cameras.

    All methods may be called from any thread; all but :meth:`open` return or raise within two
    seconds, :meth:`wait_done` within its own limit.

    Errors: :class:`~common.errors.DeviceError` ``device/trigger-gone`` when the box does not
    answer, :class:`~common.errors.InterlockError`, :class:`~common.errors.ConflictError`
    in the wrong state, :class:`~common.errors.InputError` for pulses the box cannot make.
    """

    @property
    def capabilities(self) -> TriggerCapabilities:
        """What this box can do; known once it has been opened."""
        ...

    def open(self) -> None:
        """Connect and probe; from then on lost connections are made again by themselves."""
        ...

    def close(self) -> None:
        """Disarm if armed, and let go of the port. Closing twice changes nothing."""
        ...

    def health(self) -> TriggerHealth:
        """The present state; asks nothing of the box and never raises."""
        ...

    def arm(self, request: ArmRequest) -> None:
        """Load the pulses and arm. The box is ARMED when this returns."""
        ...

    def fire(self, capture_id: str) -> None:
        """Fire the armed capture, at most once for ever.

        Returns when the box has acknowledged. Where the acknowledgement is lost, the box is
        asked what it did; nothing is sent again that could make a second pulse.
        """
        ...

    def wait_done(self, capture_id: str, timeout_s: float) -> FireReport:
        """What became of a capture, when its last edge is made, or the box lost and resolved.

        Never raises for a lost box: the report then says ``UNKNOWN`` and why.
        """
        ...

    def disarm(self, capture_id: str) -> None:
        """Leave ARMED without a pulse. Nothing happens when it is not armed any more."""
        ...

    def abort(self) -> None:
        """All outputs low, now; allowed in every state."""
        ...

    def reset(self) -> None:
        """Leave FAULT, with all outputs low; nothing but that where there is no fault.

        Raises :class:`~common.errors.InterlockError` while the interlock is open.
        """
        ...

    def subscribe(self, listener: Callable[[FireReport], None]) -> Callable[[], None]:
        """Hear every report that :meth:`wait_done` resolves, before it returns.

        The listener is called on the thread of :meth:`wait_done`. Returns what ends the
        subscription.
        """
        ...
