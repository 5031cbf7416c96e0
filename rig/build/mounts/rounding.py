"""Settings rounded to what exists, and the remaining freedoms used to pay for it.

1. Every angle is rounded to its step; slides move the camera so that it keeps its aim.
2. The slides are solved for together: as little as possible away from the design, with every
   limit drawn in by what settings that are half a step off can do to it (to first order).
3. The slides are rounded.
4. Neighbouring steps of every setting are tried, camera by camera; a step is taken when it
   breaks less, leaves more of that room, or costs less, in this order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from common.errors import CancelledError, InputError
from common.progress import CancelToken
from geometry.camera import RigCamera
from geometry.subject import Subject
from rig.build.mounts.kinematics import keeping_aim, reach, rotation_at
from rig.build.mounts.linear import LinearLimits, LinearModel
from rig.build.mounts.network import MountNetwork, Score
from rig.build.mounts.settings import CameraMount, Setting
from solver.limits import Limits

PROBE_MM = 0.5
"""How far a slide is moved to see what it does to the limits."""

PROBE_DEG = 0.05

SHARES = (1.0, 0.85, 0.7, 0.5, 0.3, 0.15, 0.0)
"""How much of the room for settings that are half a step off is tried, the most first."""

SWEEPS = 3


def _slides(mount: CameraMount) -> list[Setting]:
    return [s for s in mount.settings if s.unit == "mm"]


def nearest(mount: CameraMount) -> CameraMount:
    """Every setting rounded by itself."""
    return mount.moved({s.name: s.rounded().value for s in mount.settings})


def needs_rounding(mounts: tuple[CameraMount, ...]) -> bool:
    """Whether any setting has steps."""
    return any(s.step > 0.0 for m in mounts for s in m.settings)


class Rounder:
    """Rounds the mounts of one network; ``numbers`` are their cameras' places in it."""

    def __init__(
        self,
        subject: Subject,
        limits: Limits,
        cameras: tuple[RigCamera, ...],
        mounts: tuple[CameraMount, ...],
        *,
        spare: float,
        tell: Callable[[float], None],
        cancel: CancelToken,
    ) -> None:
        self._target = subject.design_points.centroid_mm
        self._network = MountNetwork(subject, limits, cameras)
        names = [c.name for c in cameras]
        self._number = {m.name: names.index(m.name) for m in mounts}
        self._tell, self._cancel, self._spare = tell, cancel, spare
        self.mounts = list(mounts)

    def relax(self, loss: Callable[[tuple[RigCamera, ...]], float], most: float) -> float:
        """Draw the limits in as far as costs at most ``most`` of ``loss``; the share drawn in."""
        for k, mount in enumerate(self.mounts):
            self._set(k, mount)
        at = tuple(self.mounts)
        linear = self._linear(margins=True)
        for share in SHARES:
            for k, mount in enumerate(at):
                self._set(k, mount)
            margins = linear.margins(share * self._spare)
            self._draw_in(linear, margins)
            if loss(tuple(self._network.cameras)) <= most:
                break
        self._draw_in(self._linear(margins=False), margins)
        return share * self._spare

    def run(self) -> tuple[CameraMount, ...]:
        """Round all settings and make the best of it."""
        for k, mount in enumerate(self.mounts):
            self._set(k, self._turned(mount, {}))
        linear = self._linear(margins=True)
        margins = linear.margins(self._spare)
        self._draw_in(linear, margins)
        self._draw_in(self._linear(margins=False), margins)
        self._network.margins = margins
        for k, mount in enumerate(self.mounts):
            self._set(k, nearest(mount))
        self._tell(0.5)
        for sweep in range(SWEEPS):
            if not self._sweep(sweep):
                break
        return tuple(self.mounts)

    def _check(self) -> None:
        if self._cancel.is_set():
            raise CancelledError

    def _camera(self, mount: CameraMount) -> RigCamera:
        return self._network.focused(self._number[mount.name], mount.camera)

    def _set(self, k: int, mount: CameraMount) -> None:
        camera = self._camera(mount)
        self._network.move(self._number[mount.name], camera)
        self.mounts[k] = replace(mount, camera=camera)

    def _turned(self, mount: CameraMount, angles: dict[str, float]) -> CameraMount:
        """Angles rounded, or set as given; the slides keep the camera's aim."""
        values = mount.values()
        new = {s.name: s.rounded().value for s in mount.settings if s.unit == "deg"} | angles
        slides = [s.name for s in _slides(mount)]
        at = values | new
        wanted = keeping_aim(mount.camera.pose, rotation_at(mount.chain, at), self._target)
        return mount.moved(reach(mount.chain, at, slides, wanted, with_rotation=False))

    def _draw_in(self, linear: LinearLimits, margins: Mapping[str, float]) -> None:
        """Move the slides of all cameras so that no limit comes nearer than its margin."""
        move = linear.least_move(margins)
        done = 0
        for k, mount in enumerate(self.mounts):
            slides = _slides(mount)
            values = {
                s.name: float(np.clip(s.value + d, s.low, s.high))
                for s, d in zip(slides, move[done : done + len(slides)], strict=True)
            }
            done += len(slides)
            self._set(k, mount.moved(values))

    def _linear(self, *, margins: bool) -> LinearLimits:
        """How the slack of all rows follows the slides and, for margins, all settings."""
        model = LinearModel()
        for k, mount in enumerate(self.mounts):
            self._check()
            number = self._number[mount.name]
            here = self._network.rows(number, self._camera(mount))
            model.rows(here)
            for setting in mount.settings:
                probe = PROBE_MM if setting.unit == "mm" else PROBE_DEG
                moved = mount.moved({setting.name: setting.value + probe})
                if margins:
                    # A setting that comes out wrong is not followed by the focus.
                    there = self._network.rows(number, moved.camera)
                    model.error(here, there, probe, setting.step / 2.0)
                if setting.unit == "mm":
                    model.move(here, self._network.rows(number, self._camera(moved)), probe)
            self._tell(0.25 * (k + 1) / len(self.mounts))
        return model.made()

    def _sweep(self, sweep: int) -> bool:
        """Try the neighbouring steps of every setting; whether anything got better."""
        better = False
        for k in range(len(self.mounts)):
            self._check()
            number = self._number[self.mounts[k].name]
            best = self._network.score(number, self.mounts[k].camera)
            for trial in self._neighbours(self.mounts[k], best.breach > 0.0):
                camera = self._camera(trial)
                score = self._network.score(number, camera)
                if _is_better(score, best):
                    best, better = score, True
                    self._set(k, trial)
            share = (sweep + (k + 1) / len(self.mounts)) / SWEEPS
            self._tell(0.5 + 0.5 * share)
        return better

    def _neighbours(self, mount: CameraMount, broken: bool) -> Iterator[CameraMount]:
        for setting in mount.settings:
            if setting.step <= 0.0:
                continue
            for stride in (1, -1):
                value = setting.value + stride * setting.step
                if not setting.low <= value <= setting.high:
                    continue
                if setting.unit == "mm":
                    yield mount.moved({setting.name: value})
                elif broken:
                    try:
                        yield nearest(self._turned(mount, {setting.name: value}))
                    except InputError:
                        # Its slides cannot follow that turn: no neighbour on this side.
                        continue


def _is_better(one: Score, other: Score) -> bool:
    """Breaks less; or as little, with more room; or with as much, at less cost."""
    if abs(one.breach - other.breach) > 1e-9:
        return one.breach < other.breach
    if abs(one.lack - other.lack) > 1e-3:
        return one.lack < other.lack
    return one.cost_mm2 < other.cost_mm2 * (1.0 - 1e-6)
