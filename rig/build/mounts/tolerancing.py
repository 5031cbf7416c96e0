"""How far settings may be off: each alone, and all together."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from common.errors import CancelledError
from common.progress import CancelToken
from geometry.camera import RigCamera
from geometry.subject import Subject
from rig.build.mounts.network import MountNetwork
from rig.build.mounts.plan import Tolerance
from rig.build.mounts.rounding import PROBE_DEG, PROBE_MM
from rig.build.mounts.settings import CameraMount, Setting
from solver.limits import Limits
from solver.result import ConstraintRow

WIDEST_MM = 20.0
WIDEST_DEG = 5.0
"""No setting is tried farther off than this."""

NEAR = 0.05
"""A tolerance is known to this share of itself, rounded down."""

MOST_TRIALS, LEAST_TRIALS, WORK = 100, 10, 1000
"""Trials of a rig with so many cameras that trials times cameras is the work, within bounds."""

MADE_MM = 0.2
MADE_DEG = 0.1
"""How far off a drilled hole or a printed angle may come out: settings without steps."""


def half_step(setting: Setting) -> float:
    """How far off a setting may stand without anybody's fault."""
    if setting.step > 0.0:
        return setting.step / 2.0
    return MADE_MM if setting.unit == "mm" else MADE_DEG


class Tolerancer:
    """Tolerances and yield of a finished rig."""

    def __init__(
        self,
        subject: Subject,
        limits: Limits,
        cameras: tuple[RigCamera, ...],
        mounts: tuple[CameraMount, ...],
        *,
        tell: Callable[[float], None],
        cancel: CancelToken,
    ) -> None:
        self._network = MountNetwork(subject, limits, cameras)
        names = [camera.name for camera in cameras]
        self._number = {mount.name: names.index(mount.name) for mount in mounts}
        self._mounts, self._tell, self._cancel = mounts, tell, cancel

    def each(self) -> tuple[Tolerance, ...]:
        """The tolerance of every setting alone."""
        out: list[Tolerance] = []
        for k, mount in enumerate(self._mounts):
            if self._cancel.is_set():
                raise CancelledError
            out += self._of(mount)
            self._tell((k + 1) / len(self._mounts))
        return tuple(out)

    def _of(self, mount: CameraMount) -> Iterator[Tolerance]:
        number = self._number[mount.name]
        here, now = (
            self._network.rows(number, mount.camera),
            self._network.broken(number, mount.camera),
        )
        for setting in mount.settings:
            ends = [(0.0, now), (0.0, now)]
            if not now:
                guesses = self._guesses(mount, setting, here)
                ends = [
                    self._reach(mount, setting, sign, guess)
                    for sign, guess in zip((1.0, -1.0), guesses, strict=True)
                ]
            (plus, limit), (minus, other) = ends
            named = limit if plus <= minus else other
            yield Tolerance(mount.name, setting.name, setting.unit, plus, minus, named)

    def _broken(self, mount: CameraMount, setting: Setting, off: float) -> str:
        moved = mount.moved({setting.name: setting.value + off})
        # The focus is set on the camera where it stands and stays as it is.
        return self._network.broken(self._number[mount.name], moved.camera)

    def _guesses(
        self, mount: CameraMount, setting: Setting, here: Mapping[str, ConstraintRow]
    ) -> tuple[float, float]:
        """Where the first limit breaks on either side, if all went on in proportion."""
        probe = PROBE_MM if setting.unit == "mm" else PROBE_DEG
        moved = mount.moved({setting.name: setting.value + probe})
        there = self._network.rows(self._number[mount.name], moved.camera)
        plus = minus = np.inf
        for name in here.keys() & there.keys():
            slack, rate = max(here[name].slack, 0.0), (there[name].slack - here[name].slack) / probe
            if rate < 0.0:
                plus = min(plus, -slack / rate)
            elif rate > 0.0:
                minus = min(minus, slack / rate)
        return float(plus), float(minus)

    def _reach(
        self, mount: CameraMount, setting: Setting, sign: float, guess: float
    ) -> tuple[float, str]:
        """How far the setting may go one way, and what breaks there."""
        widest = WIDEST_MM if setting.unit == "mm" else WIDEST_DEG
        low, high, limit = 0.0, widest, ""
        for trial in (guess * (1.0 - NEAR / 2.0), guess * (1.0 + NEAR / 2.0)):
            if low < trial < high:
                found = self._broken(mount, setting, sign * trial)
                low, high, limit = (low, trial, found) if found else (trial, high, limit)
        if not limit:
            limit = self._broken(mount, setting, sign * high)
            if not limit:
                return float("inf"), ""
        # Ends closer than a tenth of what can be set are as good as equal.
        while high - low > max(1.01 * NEAR * high, 0.1 * half_step(setting)):
            middle = 0.5 * (low + high)
            found = self._broken(mount, setting, sign * middle)
            low, high, limit = (low, middle, found) if found else (middle, high, limit)
        return float(low), limit


def trials_for(cameras: int) -> int:
    """How many trial rigs are worth their time."""
    return int(np.clip(WORK // cameras, LEAST_TRIALS, MOST_TRIALS))


def yield_share(
    judge: Callable[[tuple[RigCamera, ...]], bool],
    cameras: tuple[RigCamera, ...],
    mounts: tuple[CameraMount, ...],
    *,
    seed: int,
    trials: int,
    cancel: CancelToken,
) -> float:
    """Share of ``trials`` rigs, every setting off by a uniform error of half a step, that hold.

    ``judge`` tells of cameras whether they keep all limits. The focus stays as it was set.
    """
    rng = np.random.default_rng([seed, len(mounts)])
    by_name = {mount.name: mount for mount in mounts}
    kept = 0
    for _ in range(trials):
        if cancel.is_set():
            raise CancelledError
        off = {
            name: {
                s.name: s.value + half_step(s) * float(rng.uniform(-1.0, 1.0))
                for s in mount.settings
            }
            for name, mount in by_name.items()
        }
        tried = tuple(
            replace(c, pose=by_name[c.name].pose(off[c.name])) if c.name in by_name else c
            for c in cameras
        )
        kept += judge(tried)
    return kept / trials if trials else float("nan")
