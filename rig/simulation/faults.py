"""How a simulated camera misbehaves: each fault of real rigs, seeded, off unless switched on."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from common.errors import InputError

Triple = tuple[float, float, float]

_CHANCES = (
    "drop",
    "miss",
    "duplicate",
    "late",
    "black",
    "incomplete",
    "wrong_size",
)


@dataclass(frozen=True)
class CameraFaults:
    """Lag and faults of one camera. The first seven faults are chances for each exposure, 0 to 1.

    ``drop`` loses the frame on its way (the counter shows a gap), ``miss`` does not expose at all
    (the counter shows nothing), ``duplicate`` sends the frame twice with the same counter,
    ``late`` holds it back for ``late_ms``, ``black`` has no light in it (a flash that failed),
    ``incomplete`` has only its upper part, ``wrong_size`` half the width and height.
    ``only_shots`` limits these seven to the exposures of these numbers (1 for the camera's first),
    so ``drop=1.0, only_shots=(3,)`` loses just the third.

    ``lag_mean_us`` from edge to start of exposure, ``lag_jitter_us`` its standard deviation,
    ``lag_drift_us_per_shot`` added with each exposure. ``extra_frame_at_start`` sends a frame
    when armed, before any edge. ``free_running`` exposes every ``free_run_interval_ms`` from the
    moment of arming, whatever the trigger does (its cable is off). ``swapped_to_output`` is the
    output it really hangs on. ``timestamp_reset_at_shot`` begins the camera's clock at 0 again
    just before that exposure; ``unplug_at_shot`` takes the camera away instead of exposing.

    From exposure ``knocked_at_shot`` on the camera stands ``moved_mm`` from where the design has
    it and is turned by ``turned_deg``, both about the camera's own axes (x right, y down, z
    forward): somebody has knocked against it.
    Raises :class:`InputError` for impossible values.
    """

    lag_mean_us: float = 0.0
    lag_jitter_us: float = 0.0
    lag_drift_us_per_shot: float = 0.0
    drop: float = 0.0
    miss: float = 0.0
    duplicate: float = 0.0
    late: float = 0.0
    black: float = 0.0
    incomplete: float = 0.0
    wrong_size: float = 0.0
    only_shots: tuple[int, ...] = ()
    late_ms: float = 5000.0
    extra_frame_at_start: bool = False
    free_running: bool = False
    free_run_interval_ms: float = 250.0
    swapped_to_output: int | None = None
    timestamp_reset_at_shot: int | None = None
    unplug_at_shot: int | None = None
    moved_mm: Triple = (0.0, 0.0, 0.0)
    turned_deg: Triple = (0.0, 0.0, 0.0)
    knocked_at_shot: int = 1

    def __post_init__(self) -> None:
        for entry in fields(self):
            value = getattr(self, entry.name)
            if isinstance(value, float) and not math.isfinite(value):
                self._refuse(entry.name, value, "give a finite number")
        for name in _CHANCES:
            if not 0.0 <= getattr(self, name) <= 1.0:
                self._refuse(name, getattr(self, name), "give a chance from 0 to 1")
        for name in ("lag_mean_us", "lag_jitter_us", "late_ms"):
            if getattr(self, name) < 0.0:
                self._refuse(name, getattr(self, name), "give 0 or more")
        if self.free_run_interval_ms < 1.0:
            self._refuse("free_run_interval_ms", self.free_run_interval_ms, "give 1 ms or more")
        for name in ("moved_mm", "turned_deg"):
            for value in getattr(self, name):
                if not math.isfinite(value) or abs(value) > 1e4:
                    self._refuse(name, value, "give three small numbers")
        numbers = (
            *(self.swapped_to_output, self.timestamp_reset_at_shot, self.unplug_at_shot),
            self.knocked_at_shot,
        )
        if any(n is not None and n < 1 for n in numbers) or any(n < 1 for n in self.only_shots):
            self._refuse("a shot or output", 0, "count shots and outputs from 1")

    @staticmethod
    def _refuse(name: str, value: float, remedy: str) -> None:
        raise InputError("camera-faults", f"{name} of a simulated camera is {value:g}", remedy)

    def knocked(self, shot: int) -> bool:
        """Whether the camera stands elsewhere at an exposure than its design says."""
        return shot >= self.knocked_at_shot and any((*self.moved_mm, *self.turned_deg))

    @property
    def chances(self) -> dict[str, float]:
        """The chance of each of the seven faults of single frames, in a fixed order."""
        return {name: getattr(self, name) for name in _CHANCES}
