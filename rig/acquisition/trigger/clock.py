"""Where a device's clock stands against the host's monotonic clock.

Each reading says two things for certain: the device's instant lies after the host sent the
question and before the host had the answer. A clock that runs evenly is a straight line that
passes between all those bounds. The line taken is the one midway between the tightest of
them; the room left around it is the uncertainty. The bounds are tightest where one
direction's delay was smallest, each direction by itself: it is a minimum filter on both ways,
better than one on the round trip, which needs both ways to be quick at once. The derivation is
in ``docs/explanation/trigger.md``.

Works for any clock that can be asked: a trigger box's or a camera's.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.acquisition.cameras.base import ClockSample

Instants = NDArray[np.float64]  # Shape: (n_samples,), nanoseconds after the fit's origin

MAX_DRIFT_PPM = 10_000.0
"""A ceramic resonator is right to 5000 ppm; twice that is a broken clock."""
WINDOW_S = 120.0
"""Older readings are dropped: over this time a clock's rate may be taken as even."""
MAX_SAMPLES = 256
_ROUNDING_NS = 1000.0
"""A clock is read in steps; a box's are 500 ns, a camera's finer."""
_STEPS = 60


@dataclass(frozen=True, eq=False)
class ClockFit:
    """The line, valid around the readings it was made from.

    ``drift_ppm``: how much faster the device's clock runs than the host's. ``residual_us``: rms
    distance of the line from the middles of the quarter of readings with the shortest round
    trips. ``wire_ns`` is the part of each way that is known to be the same in both directions.
    """

    host_origin_ns: int
    device_origin_ns: int
    slope: float
    offset_ns: float
    residual_us: float
    samples: int
    wire_ns: float
    _device: Instants
    _before: Instants
    _after: Instants

    @property
    def drift_ppm(self) -> float:
        """Of the device's clock against the host's."""
        return (1.0 / self.slope - 1.0) * 1e6

    def host_ns(self, device_ns: int) -> int:
        """The host's instant of an instant of the device's."""
        elapsed = device_ns - self.device_origin_ns
        return self.host_origin_ns + round(self.offset_ns + self.slope * elapsed)

    def device_ns(self, host_ns: int) -> int:
        """The device's instant of an instant of the host's."""
        elapsed = host_ns - self.host_origin_ns - self.offset_ns
        return self.device_origin_ns + round(elapsed / self.slope)

    def uncertainty_us(self, device_ns: int) -> float:
        """Half the room that the readings leave at an instant of the device's.

        Certain as long as both clocks run evenly: every line between all bounds is counted. The
        part of the delays that is known to be symmetric does not move the middle, and is taken
        off.
        """
        at = float(device_ns - self.device_origin_ns)
        middle = self.offset_ns + self.slope * at
        low = self._reach(at, middle, -1.0)
        high = self._reach(at, middle, +1.0)
        # Off-centre room counts whole: the truth may be at its far side.
        half = max(high - middle, middle - low)
        return max(half - self.wire_ns, half * 0.1) / 1000.0

    def _reach(self, at: float, middle: float, sign: float) -> float:
        """The farthest value at ``at`` of a line between all bounds, to one side."""
        inside, outside = 0.0, 10.0 * float(np.max(self._after - self._before)) + 1e6
        for _ in range(_STEPS):
            step = 0.5 * (inside + outside)
            if self._feasible(at, middle + sign * step):
                inside = step
            else:
                outside = step
        return middle + sign * inside

    def _feasible(self, at: float, value: float) -> bool:
        away = self._device - at
        near = np.abs(away) < 1.0
        if np.any(near & ((self._before > value + 1.0) | (self._after < value - 1.0))):
            return False
        far = ~near
        one = (self._before[far] - value) / away[far]
        other = (self._after[far] - value) / away[far]
        steepest = np.min(np.maximum(one, other), initial=1.0 + MAX_DRIFT_PPM * 1e-6)
        flattest = np.max(np.minimum(one, other), initial=1.0 - MAX_DRIFT_PPM * 1e-6)
        return bool(flattest <= steepest + 1e-12)


class ClockModel:
    """Readings of the last two minutes and the line through them. Used by one thread.

    ``wire_ns``: how long a line is on the wire, where that is known and the same both ways.
    """

    def __init__(self, wire_ns: float = 0.0) -> None:
        self._wire_ns = wire_ns
        self._samples: deque[ClockSample] = deque(maxlen=MAX_SAMPLES)
        self.dropped = 0
        """Readings thrown away because no even clock could have given them and later ones."""

    def __len__(self) -> int:
        return len(self._samples)

    def add(self, sample: ClockSample) -> None:
        """One more reading; those beyond the window go."""
        self._samples.append(sample)
        while sample.host_after_ns - self._samples[0].host_after_ns > WINDOW_S * 1e9:
            self._samples.popleft()

    def clear(self) -> None:
        """Forget all: the device's clock has begun anew."""
        self._samples.clear()

    def fit(self) -> ClockFit | None:
        """The line; None below two readings.

        Readings that contradict later ones are dropped, oldest first: the device's clock has
        jumped, or changed its rate.
        """
        fit = line_through(self._samples, self._wire_ns)
        kept = fit.samples if fit is not None else min(1, len(self._samples))
        while len(self._samples) > kept:
            self._samples.popleft()
            self.dropped += 1
        return fit


def line_through(samples: Iterable[ClockSample], wire_ns: float = 0.0) -> ClockFit | None:
    """The line through readings in the order of their time; None below two.

    Readings that contradict later ones are left out, oldest first.
    """
    rest = list(samples)
    while len(rest) >= 2:
        fit = _fit(rest, wire_ns)
        if fit is not None:
            return fit
        rest.pop(0)
    return None


def _fit(samples: list[ClockSample], wire_ns: float) -> ClockFit | None:
    host0, device0 = samples[-1].host_before_ns, samples[-1].device_ns
    device = np.array([float(s.device_ns - device0) for s in samples])
    before = np.array([float(s.host_before_ns - host0) for s in samples]) - _ROUNDING_NS
    after = np.array([float(s.host_after_ns - host0) for s in samples]) + _ROUNDING_NS
    slope = _tightest_slope(device, before, after)
    low = float(np.max(before - slope * device))
    high = float(np.min(after - slope * device))
    if low > high:
        return None
    offset = 0.5 * (low + high)
    quick = np.argsort(after - before, kind="stable")[: max(2, len(samples) // 4)]
    middles = 0.5 * (before + after)[quick]
    rest = middles - offset - slope * device[quick]
    residual_us = float(np.sqrt(np.mean(rest**2))) / 1000.0
    wire_ns = wire_ns if 2.0 * wire_ns <= high - low else 0.0
    return ClockFit(
        host0, device0, slope, offset, residual_us, len(samples), wire_ns, device, before, after
    )


def _tightest_slope(device: Instants, before: Instants, after: Instants) -> float:
    """The slope with the widest room between the bounds, by golden section.

    The room ``min(after - slope device) - max(before - slope device)`` is concave in the slope:
    a minimum of straight lines less a maximum of straight lines.
    """

    def room(slope: float) -> float:
        return float(np.min(after - slope * device) - np.max(before - slope * device))

    low, high = 1.0 - MAX_DRIFT_PPM * 1e-6, 1.0 + MAX_DRIFT_PPM * 1e-6
    ratio = (5.0**0.5 - 1.0) / 2.0
    inner, outer = high - ratio * (high - low), low + ratio * (high - low)
    room_inner, room_outer = room(inner), room(outer)
    for _ in range(_STEPS):
        if room_inner < room_outer:
            low, inner, room_inner = inner, outer, room_outer
            outer = low + ratio * (high - low)
            room_outer = room(outer)
        else:
            high, outer, room_outer = outer, inner, room_inner
            inner = high - ratio * (high - low)
            room_inner = room(inner)
    return 0.5 * (low + high)
