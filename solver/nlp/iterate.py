"""Where the SQP method stands between two steps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import Floats, Ints
from solver.nlp.penalty import Penalty
from solver.nlp.program import NonlinearProgram
from solver.nlp.working_program import WorkingProgram

FEASIBLE = 1e-8
REACH = 1.5
"""Rows change by at most about this much per unit of the trust radius."""


@dataclass(frozen=True, eq=False)
class Point:
    """A value of all unknowns (7 n,) with its cost and the violation of each family."""

    values: Floats
    cost: float
    violations: Mapping[str, float]

    @classmethod
    def at(cls, program: NonlinearProgram, values: Floats) -> Point:
        """Evaluate cost and constraints."""
        cost = program.cost.value(program.unknowns.state(values))
        return cls(values, cost, program.violations(values))

    def merit(self, program: NonlinearProgram, penalty: Penalty) -> float:
        """What a step must lower: the cost and the penalty of the violations."""
        return self.cost + penalty.charge(program, self.violations)


@dataclass(frozen=True, eq=False)
class WorkingSet:
    """The rows ``chosen`` of each block of candidates, and the program of these rows."""

    chosen: tuple[Ints, ...]
    program: WorkingProgram

    def multipliers(self, found: Floats, known: tuple[Floats, ...]) -> tuple[Floats, ...]:
        """Multipliers of the working rows spread over all candidates, shaped as ``known``."""
        out = []
        parts = self.program.by_block(found)
        for before, chosen, part in zip(known, self.chosen, parts, strict=True):
            spread = np.zeros_like(before)
            spread[chosen] = np.where(np.abs(part) > 1e-9, part, 0.0)
            out.append(spread)
        return tuple(out)


@dataclass(frozen=True, eq=False)
class Iterate:
    """One iterate: the point, the trust region, the penalty, what is known of the constraints.

    ``multipliers`` and ``held`` have one array per block of candidates: a multiplier of each
    row, and the rows that an earlier trial violated. ``step_size`` is the largest entry of the
    last step, ``gains`` by how much each step so far lowered the merit.
    """

    program: NonlinearProgram
    point: Point
    radius: float
    penalty: Penalty
    multipliers: tuple[Floats, ...]
    held: tuple[Ints, ...]
    step_size: float = np.inf
    gains: tuple[float, ...] = ()

    @classmethod
    def first(
        cls,
        program: NonlinearProgram,
        start: Floats,
        known: list[Floats] | None,
        penalty: float,
        radius: float,
    ) -> Iterate:
        """The start (7 n,), moved inside its bounds, with multipliers known from elsewhere."""
        multipliers = tuple(np.zeros(r.block.rows) for r in program.rows)
        for mine, before in zip(multipliers, known or [], strict=False):
            mine[: len(before)] = before
        held = tuple(np.zeros(0, np.int64) for _ in program.rows)
        point = Point.at(program, np.clip(start, *program.bounds))
        return cls(program, point, radius, Penalty(penalty), multipliers, held)

    @property
    def worst(self) -> float:
        """Violation of the worst family that has to hold."""
        return self.program.worst(self.point.violations)

    @property
    def unpaid(self) -> bool:
        """Whether a row with a penalty of its own is violated but not yet paid for."""
        program = self.program
        state = program.unknowns.state(self.point.values)
        for r, m in zip(program.rows, self.multipliers, strict=True):
            if r.block.family in program.each:
                violated = r.block.violation(state) > FEASIBLE
                if (violated & (np.abs(m) < 0.5 * program.each_penalty)).any():
                    return True
        return False

    def working_set(self) -> WorkingSet:
        """The rows to work on at this point, and their program."""
        program = self.program
        state = program.unknowns.state(self.point.values)
        chosen = tuple(
            r.choose(state, np.union1d(h, np.flatnonzero(m)), REACH * self.radius)
            for r, h, m in zip(program.rows, self.held, self.multipliers, strict=True)
        )
        working = WorkingProgram(
            program.unknowns,
            program.cost,
            tuple(r.block.take(c) for r, c in zip(program.rows, chosen, strict=True)),
            *program.bounds,
            self.point.values,
            program.families,
            program.each,
            tuple(self.penalty.of_family(program, f) for f in program.families),
            program.each_penalty,
        )
        return WorkingSet(chosen, working)

    def holding_violated(self, values: Floats) -> Iterate:
        """Also work on what is violated at unknowns (7 n,) that were tried."""
        state = self.program.unknowns.state(values)
        held = tuple(
            r.choose(state, h, REACH * self.radius)
            for r, h in zip(self.program.rows, self.held, strict=True)
        )
        return replace(self, held=held)
