"""What all blocks of constraint rows have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np

from geometry.arrays import Floats, Ints
from solver.variables import PER_CAMERA, NetworkState


def camera_columns(cameras: Ints, width: int) -> Ints:
    """Columns (m, width) of the first ``width`` unknowns of each row's camera."""
    return np.asarray(PER_CAMERA * np.asarray(cameras)[:, None] + np.arange(width))


def bound(values: Floats | float, like: Ints | Floats) -> Floats:
    """``values`` repeated for every row of ``like``."""
    return np.array(np.broadcast_to(values, (len(like),)), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Block(ABC):
    """Rows ``lower <= value <= upper`` of one family.

    ``family`` names the limit; ``unit`` and ``natural`` turn a row's number into the unit that
    a user knows (``natural * value``). Arrays of subclasses have one entry per row.
    """

    family: str
    unit: str
    natural: float
    lower: Floats
    upper: Floats

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.lower)

    @property
    @abstractmethod
    def columns(self) -> Ints:
        """Indices (rows, width) of the unknowns that each row touches."""

    @abstractmethod
    def value(self, state: NetworkState) -> Floats:
        """Values (rows,)."""

    @abstractmethod
    def jacobian(self, state: NetworkState) -> Floats:
        """Derivatives (rows, width) by the unknowns in :attr:`columns`."""

    @abstractmethod
    def add_hessian(self, state: NetworkState, multipliers: Floats, out: Floats) -> None:
        """Add ``sum multipliers[r] * second derivative of row r`` to ``out`` (7 n, 7 n)."""

    def violation(self, state: NetworkState) -> Floats:
        """How far each row is outside its bounds, (rows,), zero when inside."""
        value = self.value(state)
        return np.asarray(np.maximum(0.0, np.maximum(self.lower - value, value - self.upper)))

    def slack(self, state: NetworkState) -> Floats:
        """Distance of each row to its nearest bound, (rows,), negative outside."""
        value = self.value(state)
        return np.asarray(np.minimum(value - self.lower, self.upper - value))

    def take(self, rows: Ints) -> Self:
        """A block of some of the rows."""
        chosen = {
            f.name: getattr(self, f.name)[rows]
            for f in fields(self)
            if isinstance(getattr(self, f.name), np.ndarray)
        }
        return replace(self, **chosen)


@dataclass(frozen=True, eq=False)
class WeightedSum(Block):
    """Weighted sums of the rows of another block: means over pairs, for instance.

    ``weights`` (rows, inner rows). Touches all unknowns.
    """

    inner: Block
    weights: Floats
    unknowns: int

    @property
    def columns(self) -> Ints:
        return np.tile(np.arange(self.unknowns), (self.rows, 1))

    def value(self, state: NetworkState) -> Floats:
        return np.asarray(self.weights @ self.inner.value(state))

    def jacobian(self, state: NetworkState) -> Floats:
        dense = np.zeros((self.inner.rows, self.unknowns))
        np.put_along_axis(dense, self.inner.columns, self.inner.jacobian(state), axis=1)
        return np.asarray(self.weights @ dense)

    def add_hessian(self, state: NetworkState, multipliers: Floats, out: Floats) -> None:
        self.inner.add_hessian(state, multipliers @ self.weights, out)


def scatter(out: Floats, columns: Ints, blocks: Floats) -> None:
    """Add square blocks (m, w, w) to ``out`` at the rows and columns ``columns`` (m, w)."""
    np.add.at(out, (columns[:, :, None], columns[:, None, :]), blocks)
