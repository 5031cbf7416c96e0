"""What a simulated camera does at each exposure, drawn from its seed; and the clock it has.

Draws depend on the seed, the camera's name and the number of the exposure only, so a run can be
repeated whatever the threads do.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np

from rig.simulation.faults import CameraFaults

_LARGEST_CLOCK_START_NS = 3_600_000_000_000


@dataclass(frozen=True)
class Draw:
    """One exposure: its lag, and which of the faults of single frames it has."""

    lag_us: float
    faults: frozenset[str]


def camera_key(name: str) -> int:
    """A number that stands for a camera's name in seeds."""
    return zlib.crc32(name.encode())


def draw(faults: CameraFaults, seed: tuple[int, ...], number: int) -> Draw:
    """What happens at exposure ``number`` (1 for the first) of a camera of this seed."""
    rng = np.random.default_rng([*seed, number])
    # Always the same draws in the same order: switching a fault on leaves the others as they were.
    jitter = float(rng.standard_normal()) * faults.lag_jitter_us
    lag = faults.lag_mean_us + jitter + faults.lag_drift_us_per_shot * (number - 1)
    chances = faults.chances
    lots = rng.random(len(chances))
    concerned = not faults.only_shots or number in faults.only_shots
    hit = {name for (name, chance), lot in zip(chances.items(), lots, strict=True) if lot < chance}
    return Draw(max(lag, 0.0), frozenset(hit if concerned else ()))


@dataclass(frozen=True)
class CameraClock:
    """A camera's own clock: ``zero_ns`` of it was at ``since_host_ns`` of the host's."""

    since_host_ns: int
    zero_ns: int
    drift_ppm: float

    @classmethod
    def drawn(cls, seed: tuple[int, ...], host_ns: int, drift_ppm: float) -> CameraClock:
        """A clock that started at some time in the last hour and runs a little fast or slow."""
        rng = np.random.default_rng([*seed, 0])
        start = int(rng.integers(0, _LARGEST_CLOCK_START_NS))
        return cls(host_ns, start, float(rng.uniform(-drift_ppm, drift_ppm)))

    def at(self, host_ns: int) -> int:
        """The clock's reading at an instant of the host's clock."""
        passed = host_ns - self.since_host_ns
        # Whole nanoseconds stay whole: a float of some hours would lose them.
        return self.zero_ns + passed + round(passed * self.drift_ppm * 1e-6)

    def reset_at(self, host_ns: int) -> CameraClock:
        """The same clock, 0 at an instant: the camera started anew."""
        return CameraClock(host_ns, 0, self.drift_ppm)
