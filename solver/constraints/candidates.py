"""All rows that a working set may be chosen from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats, Ints
from solver.constraints.base import Block
from solver.variables import NetworkState

VIOLATED = 1e-7
"""A row further out than this (in the solver's units of order one) is taken into the set."""


@dataclass(frozen=True, eq=False)
class CandidateConstraints:
    """A block whose rows compete in groups; the tightest ``keep`` of each are worked on.

    ``group`` (rows,) names the group of each row, for example its camera and side of the frame.
    """

    block: Block
    group: Ints
    keep: int

    @classmethod
    def all_of(cls, block: Block) -> CandidateConstraints:
        """A block of which every row is always worked on."""
        return cls(block, np.zeros(block.rows, dtype=np.int64), block.rows)

    def choose(self, state: NetworkState, held: Ints, reach: float) -> Ints:
        """``held`` rows, with the tightest of each group and those that are violated added.

        Rows with a slack beyond ``reach`` are left out: no step of that length gets there.
        """
        if self.keep >= self.block.rows:
            return np.arange(self.block.rows)
        slack = self.block.slack(state)
        near = np.flatnonzero(slack < reach)
        order = near[np.lexsort((slack[near], self.group[near]))]
        chosen = np.zeros(len(slack), dtype=np.bool_)
        chosen[held] = True
        if len(order):
            group = self.group[order]
            first = np.flatnonzero(np.r_[True, group[1:] != group[:-1]])
            rank = np.arange(len(order)) - np.repeat(first, np.diff(np.r_[first, len(order)]))
            # Of many violated rows of a group the worst few stand for the rest in this step.
            taken = (rank < self.keep) | ((slack[order] < -VIOLATED) & (rank < 4 * self.keep))
            chosen[order[taken]] = True
        return np.flatnonzero(chosen)


def grouped(*keys: Ints | Floats) -> Ints:
    """One integer per distinct combination of the keys, (rows,)."""
    code = np.zeros(len(keys[0]), dtype=np.int64)
    for key in keys:
        found, place = np.unique(np.asarray(key), return_inverse=True)
        code = code * len(found) + place
    return np.asarray(np.unique(code, return_inverse=True)[1], dtype=np.int64)
