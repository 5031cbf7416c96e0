"""The limits to first order about the present settings, and the least move that meets them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats
from rig.build.mounts.network import size_of
from solver.result import ConstraintRow, Sense

Rows = Mapping[str, ConstraintRow]

STEP_SCALE_MM = 3.0
HARD = 300.0
"""Weight of a limit against moving: a breach of 0.1 % weighs as much as 1 mm."""

MOST_STEPS = 100
GAIN, LEAST_SHARE = 1e-4, 1e-9
"""Of a Newton step: what must come of the gain that its slope promises, and its shortest part."""

CENTRED = 0.9
"""Largest margin in an equality, as a share of its tolerance: beyond it lies the other side."""


@dataclass(frozen=True, eq=False)
class LinearLimits:
    """Rows of the limits about the present settings.

    ``jacobian`` (r, m) of the ``slack`` (r,) by the slides; ``size`` (r,) as in
    :func:`rig.build.mounts.network.size_of`; ``spread`` (r,) what settings that are half a step off
    can take away; ``most`` (r,) the tolerance of an equality, which its slack cannot exceed,
    infinite for others.
    """

    names: tuple[str, ...]
    jacobian: Floats
    slack: Floats
    size: Floats
    spread: Floats
    most: Floats

    def margins(self, share: float) -> dict[str, float]:
        """By how much each limit is drawn in to leave this share of the spread."""
        wanted = np.minimum(share * self.spread, CENTRED * self.most)
        return dict(zip(self.names, wanted.tolist(), strict=True))

    def least_move(self, margins: Mapping[str, float]) -> Floats:
        """The least move (m,) of the slides that keeps all margins, as nearly as can be."""
        margin = np.array([margins.get(name, 0.0) for name in self.names])
        jacobian = self.jacobian / self.size[:, None]
        lack = (margin - self.slack) / self.size
        # The far side of a tolerance: what is gained on this side is lost on that.
        two = np.isfinite(self.most)
        far = (margin - (2.0 * self.most - self.slack))[two] / self.size[two]
        return _least_move(np.concatenate([lack, far]), np.vstack([jacobian, -jacobian[two]]))


class LinearModel:
    """Gathers what each camera's slides and errors do to the rows."""

    def __init__(self) -> None:
        self._rows: dict[str, ConstraintRow] = {}
        self._entries: list[dict[str, float]] = []
        self._worst: dict[str, float] = {}
        self._square: dict[str, float] = {}

    def rows(self, here: Rows) -> None:
        """Rows as they are now."""
        self._rows = dict(here) | self._rows

    def move(self, here: Rows, there: Rows, step: float) -> None:
        """A further slide: the rows before and after it was moved by ``step``."""
        common = here.keys() & there.keys()
        self._entries.append({n: (there[n].slack - here[n].slack) / step for n in common})

    def error(self, here: Rows, there: Rows, step: float, half_step: float) -> None:
        """A setting that may come out ``half_step`` off."""
        for name in here.keys() & there.keys():
            effect = abs(there[name].slack - here[name].slack) / step * half_step
            self._worst[name] = self._worst.get(name, 0.0) + effect
            self._square[name] = self._square.get(name, 0.0) + effect**2

    def made(self) -> LinearLimits:
        """The model."""
        names, table = list(self._rows), list(self._rows.values())
        index = {name: i for i, name in enumerate(names)}
        jacobian = np.zeros((len(names), len(self._entries)))
        for column, entries in enumerate(self._entries):
            for name, value in entries.items():
                jacobian[index[name], column] = value
        return LinearLimits(
            tuple(names),
            jacobian,
            np.array([row.slack for row in table]),
            np.array([size_of(row) for row in table]),
            np.array([self._spread(name) for name in names]),
            np.array([size_of(row) if row.sense is Sense.EQUAL else np.inf for row in table]),
        )

    def _spread(self, name: str) -> float:
        """The sum of all effects, or 2.5 standard deviations of their sum where that is less."""
        deviation = np.sqrt(self._square.get(name, 0.0) / 3.0)
        return float(min(self._worst.get(name, 0.0), 2.5 * deviation))


def _least_move(lack: Floats, jacobian: Floats) -> Floats:
    """The least move (m,) that gains ``lack`` (r,) where it is positive, in least squares.

    Minimises |move / scale|^2 + HARD^2 |max(0, lack - J move)|^2 by Newton steps on the set of
    rows that still lack something; the objective is convex and piecewise quadratic. Steps are
    shortened until they gain: whole ones can go round in a circle.
    """
    count = jacobian.shape[1]
    move: Floats = np.zeros(count)
    inertia = np.eye(count) / STEP_SCALE_MM**2

    def price(tried: Floats) -> float:
        short = np.maximum(0.0, lack - jacobian @ tried)
        return float(tried @ inertia @ tried + HARD**2 * short @ short)

    for _ in range(MOST_STEPS):
        active = lack - jacobian @ move > 0.0
        rows = HARD * jacobian[active]
        system = inertia + rows.T @ rows
        step = np.linalg.solve(system, HARD * rows.T @ lack[active]) - move
        # Half of the slope along a Newton step is minus its own length in the system's norm.
        slope, share, here = float(step @ system @ step), 1.0, price(move)
        while price(move + share * step) > here - GAIN * share * slope and share > LEAST_SHARE:
            share /= 2.0
        move = np.asarray(move + share * step)
        if share == 1.0 and ((lack - jacobian @ move > 0.0) == active).all():
            break
    return move
