"""The nonlinear program of one working set: cost, rows, bounds, and what is free."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from geometry.arrays import Bools, Floats, Ints
from solver.constraints.base import Block
from solver.nlp.program import Cost
from solver.variables import NetworkState, Unknowns


@dataclass(frozen=True, eq=False)
class WorkingProgram:
    """Minimise ``cost + penalties . slack`` subject to rows and bounds.

    The variables are the free unknowns followed by the slack variables, zero or more: one for each
    of the ``soft`` families, by which all its rows may be broken, and one for each row of the
    families in ``each``, where a row that cannot be had must not excuse the others. ``lower``
    and ``upper`` (7 n,) bound all unknowns. ``frozen`` (7 n,) holds the unknowns that do not
    change.
    """

    unknowns: Unknowns
    cost: Cost
    blocks: tuple[Block, ...]
    lower: Floats
    upper: Floats
    frozen: Floats
    soft: tuple[str, ...] = ()
    each: tuple[str, ...] = ()
    soft_penalties: tuple[float, ...] = ()
    each_penalty: float = 1.0

    @property
    def free(self) -> Ints:
        """Indices of the free unknowns."""
        return self.unknowns.free

    @property
    def size(self) -> int:
        """Number of variables."""
        return len(self.free) + self.slack_count

    @cached_property
    def slack_count(self) -> int:
        """Number of slack variables."""
        rows = sum(b.rows for b in self.blocks if b.family in self.each)
        return len(self.soft) + rows

    @cached_property
    def penalties(self) -> Floats:
        """Penalty of each slack."""
        each = np.full(self.slack_count - len(self.soft), self.each_penalty)
        return np.concatenate([np.array(self.soft_penalties), each])

    @cached_property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper bounds of the variables."""
        none, many = np.zeros(self.slack_count), np.full(self.slack_count, np.inf)
        return np.r_[self.lower[self.free], none], np.r_[self.upper[self.free], many]

    @cached_property
    def _sides(self) -> list[tuple[Block, Ints, float, Ints]]:
        """Blocks with the rows used, the sign of their slack and its variables (or none)."""
        out = []
        none = np.zeros(0, dtype=np.int64)
        next_each = len(self.free) + len(self.soft)
        for block in self.blocks:
            every = np.arange(block.rows)
            if block.family in self.each:
                variables = next_each + every
                next_each += block.rows
            elif block.family in self.soft:
                variables = np.full(block.rows, len(self.free) + self.soft.index(block.family))
            else:
                out.append((block, every, 0.0, none))
                continue
            for bound_, sign in ((block.lower, 1.0), (block.upper, -1.0)):
                rows = every[np.isfinite(bound_)]
                if len(rows):
                    out.append((block, rows, sign, variables[rows]))
        return out

    @cached_property
    def row_bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper bounds of the rows."""
        low, high = [np.zeros(0)], [np.zeros(0)]
        for block, rows, sign, _ in self._sides:
            low.append(block.lower[rows] if sign >= 0.0 else np.full(len(rows), -np.inf))
            high.append(block.upper[rows] if sign <= 0.0 else np.full(len(rows), np.inf))
        return np.concatenate(low), np.concatenate(high)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.row_bounds[0])

    @cached_property
    def _column_of(self) -> Ints:
        """Variable of each unknown, -1 when it is not free."""
        column = np.full(len(self.frozen), -1, dtype=np.int64)
        column[self.free] = np.arange(len(self.free))
        return column

    @cached_property
    def _pattern(self) -> tuple[Ints, Ints, list[Bools]]:
        """Rows and columns of the Jacobian's entries, and per side which entries are used."""
        row_index, column_index, used = [], [], []
        first = 0
        for block, rows, _, variables in self._sides:
            columns = self._column_of[block.columns[rows]]
            keep = columns >= 0
            row_index.append(np.nonzero(keep)[0] + first)
            column_index.append(columns[keep])
            used.append(keep)
            if len(variables):
                row_index.append(np.arange(len(rows)) + first)
                column_index.append(variables)
            first += len(rows)
        if not row_index:
            return np.zeros(0, np.int64), np.zeros(0, np.int64), used
        return np.concatenate(row_index), np.concatenate(column_index), used

    @property
    def jacobian_pattern(self) -> tuple[Ints, Ints]:
        """Rows and columns of the entries of :meth:`jacobian`."""
        return self._pattern[0], self._pattern[1]

    @cached_property
    def hessian_pattern(self) -> tuple[Ints, Ints]:
        """Rows and columns of the entries of :meth:`hessian`: a lower triangle."""
        rows, columns = np.tril_indices(len(self.free))
        return rows, columns

    def pack(self, values: Floats) -> Floats:
        """Variables of all unknowns (7 n,), with no slack variables."""
        return np.concatenate([values[self.free], np.zeros(self.slack_count)])

    def all_unknowns(self, variables: Floats) -> Floats:
        """All unknowns (7 n,) of the variables."""
        full = self.frozen.copy()
        full[self.free] = variables[: len(self.free)]
        return full

    def state(self, variables: Floats) -> NetworkState:
        """The network at the variables, remembered for the calls that follow at the same point."""
        key = variables.tobytes()
        if self._memory.get("key") != key:
            self._memory["key"] = key
            self._memory["state"] = self.unknowns.state(self.all_unknowns(variables))
        return self._memory["state"]  # type: ignore[return-value]

    @cached_property
    def _memory(self) -> dict[str, object]:
        return {}

    def objective(self, variables: Floats) -> float:
        """Cost and penalty of the slack."""
        extra = float(self.penalties @ variables[len(self.free) :])
        return self.cost.value(self.state(variables)) + extra

    def gradient(self, variables: Floats) -> Floats:
        """Derivative of :meth:`objective`."""
        full = self.cost.gradient(self.state(variables))
        return np.concatenate([full[self.free], self.penalties])

    def values(self, variables: Floats) -> Floats:
        """Values of all rows."""
        state = self.state(variables)
        parts = [np.zeros(0)]
        known: dict[int, Floats] = {}
        for block, rows, sign, slack_columns in self._sides:
            if id(block) not in known:
                known[id(block)] = block.value(state)
            slack = sign * variables[slack_columns] if len(slack_columns) else 0.0
            parts.append(known[id(block)][rows] + slack)
        return np.concatenate(parts)

    def jacobian(self, variables: Floats) -> Floats:
        """Entries of the Jacobian in the order of :attr:`jacobian_pattern`."""
        state = self.state(variables)
        parts = [np.zeros(0)]
        known: dict[int, Floats] = {}
        for (block, rows, sign, slack_columns), keep in zip(
            self._sides, self._pattern[2], strict=True
        ):
            if id(block) not in known:
                known[id(block)] = block.jacobian(state)
            parts.append(known[id(block)][rows][keep])
            if len(slack_columns):
                parts.append(np.full(len(rows), sign))
        return np.concatenate(parts)

    def hessian(self, variables: Floats, multipliers: Floats, factor: float) -> Floats:
        """Entries of the Hessian of the Lagrangian in the order of :attr:`hessian_pattern`."""
        state = self.state(variables)
        size = len(self.frozen)
        full = factor * self.cost.hessian(state) if factor else np.zeros((size, size))
        for block, weights in zip(self.blocks, self.by_block(multipliers), strict=True):
            if weights.any():
                block.add_hessian(state, weights, full)
        rows, columns = self.hessian_pattern
        return np.asarray(full[self.free[rows], self.free[columns]])

    def hessian_matrix(self, variables: Floats, multipliers: Floats) -> Floats:
        """Hessian of the Lagrangian by the free unknowns, (free, free)."""
        entries = self.hessian(variables, multipliers, 1.0)
        full = np.zeros((len(self.free), len(self.free)))
        rows, columns = self.hessian_pattern
        full[rows, columns] = entries
        full[columns, rows] = entries
        return full

    def by_block(self, multipliers: Floats) -> list[Floats]:
        """Multipliers of the rows as one array per block; both sides of a soft row added up."""
        out = {id(b): np.zeros(b.rows) for b in self.blocks}
        first = 0
        for block, rows, _, _ in self._sides:
            out[id(block)][rows] += multipliers[first : first + len(rows)]
            first += len(rows)
        return [out[id(b)] for b in self.blocks]

    def from_blocks(self, multipliers: list[Floats]) -> Floats:
        """Inverse of :meth:`by_block`: a soft row's multiplier goes to the side of its sign."""
        known = {id(b): m for b, m in zip(self.blocks, multipliers, strict=True)}
        parts = [np.zeros(0)]
        for block, rows, sign, _ in self._sides:
            part = known[id(block)][rows]
            parts.append(part if sign == 0.0 else np.where(part * sign < 0.0, part, 0.0))
        return np.concatenate(parts)
