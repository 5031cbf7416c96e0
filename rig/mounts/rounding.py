"""Settings rounded to what exists, and the remaining freedoms used to pay for it.

1. Every angle is rounded to its step; slides move the camera so that it keeps its aim.
2. The slides are solved for together: as little as possible away from the design, with every
   limit drawn in by what settings that are half a step off can do to it (to first order).
3. The slides are rounded.
4. Neighbouring steps of every setting are tried, camera by camera; a step is taken when it
   breaks less, leaves more of that room, or costs less, in this order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import Floats
from geometry.camera import RigCamera
from geometry.errors import CancelledError, InputError
from geometry.subject import Subject
from rig.mounts.kinematics import keeping_aim, reach, rotation_at
from rig.mounts.network import Network, Score, size_of
from rig.mounts.settings import CameraMount, Setting
from solver.limits import Limits
from solver.progress import CancelToken
from solver.result import ConstraintRow

PROBE_MM = 0.5
"""How far a slide is moved to see what it does to the limits."""

PROBE_DEG = 0.05

STEP_SCALE_MM = 3.0
HARD = 300.0
"""Weight of a limit against moving: a breach of 0.1 % weighs as much as 1 mm."""

SWEEPS = 4
STRIDES = (1, -1, 3, -3)


@dataclass(frozen=True, eq=False)
class Linear:
    """Rows of the limits about the present settings (m).

    ``jacobian`` (r, m) of the ``slack`` (r,); ``size`` (r,) as in :func:`size_of`; ``margin``
    (r,) what settings that are half a step off can take away.
    """

    names: tuple[str, ...]
    jacobian: Floats
    slack: Floats
    size: Floats
    margin: Floats


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
        self._network = Network(subject, limits, cameras)
        names = [c.name for c in cameras]
        self._number = {m.name: names.index(m.name) for m in mounts}
        self._tell, self._cancel, self._spare = tell, cancel, spare
        self.mounts = list(mounts)

    def run(self) -> tuple[CameraMount, ...]:
        """All steps."""
        for k, mount in enumerate(self.mounts):
            self._set(k, self._turned(mount, {}))
        for _ in range(2):
            linear = self._linear()
            self._network.margins = dict(zip(linear.names, linear.margin.tolist(), strict=True))
            self._draw_in(linear)
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

    def _draw_in(self, linear: Linear) -> None:
        """Move the slides of all cameras so that no limit comes nearer than its margin."""
        free = np.array([s.unit == "mm" for m in self.mounts for s in m.settings])
        jacobian = linear.jacobian[:, free] / linear.size[:, None]
        move = _least_move((linear.margin - linear.slack) / linear.size, jacobian)
        done = 0
        for k, mount in enumerate(self.mounts):
            slides = _slides(mount)
            values = {
                s.name: float(np.clip(s.value + d, s.low, s.high))
                for s, d in zip(slides, move[done : done + len(slides)], strict=True)
            }
            done += len(slides)
            self._set(k, mount.moved(values))

    def _linear(self) -> Linear:
        """How the slack of all rows follows all settings, at the present ones."""
        rows: dict[str, ConstraintRow] = {}
        entries: dict[tuple[str, int], float] = {}
        column = 0
        for k, mount in enumerate(self.mounts):
            self._check()
            number = self._number[mount.name]
            here = self._network.rows(number, self._camera(mount))
            rows = here | rows
            for setting in mount.settings:
                probe = PROBE_MM if setting.unit == "mm" else PROBE_DEG
                moved = mount.moved({setting.name: setting.value + probe})
                there = self._network.rows(number, self._camera(moved))
                for name in here.keys() & there.keys():
                    entries[name, column] = (there[name].slack - here[name].slack) / probe
                column += 1
            self._tell(0.25 * (k + 1) / len(self.mounts))
        index = {name: i for i, name in enumerate(rows)}
        jacobian = np.zeros((len(rows), column))
        for (name, at), value in entries.items():
            jacobian[index[name], at] = value
        half = np.array([s.step / 2.0 for m in self.mounts for s in m.settings])
        slack = np.array([row.slack for row in rows.values()])
        size = np.array([size_of(row) for row in rows.values()])
        return Linear(tuple(rows), jacobian, slack, size, self._spare * _spread(jacobian, half))

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
            for stride in STRIDES if setting.unit == "mm" else STRIDES[:2]:
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


def _spread(jacobian: Floats, half_step: Floats) -> Floats:
    """How far settings that are up to half a step off can take each row (r,), to first order.

    The sum of all effects, or 2.5 standard deviations of their sum where that is less.
    """
    effects = np.abs(jacobian) * half_step
    deviation = np.sqrt((effects**2).sum(axis=1) / 3.0)
    return np.asarray(np.minimum(effects.sum(axis=1), 2.5 * deviation))


def _is_better(one: Score, other: Score) -> bool:
    """Breaks less; or as little, with more room; or with as much, at less cost."""
    if abs(one.breach - other.breach) > 1e-9:
        return one.breach < other.breach
    if abs(one.lack - other.lack) > 1e-3:
        return one.lack < other.lack
    return one.cost_mm2 < other.cost_mm2 * (1.0 - 1e-6)


def _least_move(lack: Floats, jacobian: Floats) -> Floats:
    """The least move (m,) that gains ``lack`` (r,) where it is positive, in least squares.

    Minimises |move / scale|^2 + HARD^2 |max(0, lack - J move)|^2 by Newton steps on the set of
    rows that still lack something; the objective is convex and piecewise quadratic.
    """
    count = jacobian.shape[1]
    move: Floats = np.zeros(count)
    inertia = np.eye(count) / STEP_SCALE_MM**2
    active = lack > 0.0
    for _ in range(50):
        rows = HARD * jacobian[active]
        move = np.asarray(np.linalg.solve(inertia + rows.T @ rows, HARD * rows.T @ lack[active]))
        now = lack - jacobian @ move > 0.0
        if (now == active).all():
            break
        active = now
    return np.asarray(move)
