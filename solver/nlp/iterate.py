"""The state of a solve: what is to be minimised, where it is, what a breach costs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from geometry.arrays import Floats, Ints
from solver.constraints.candidates import Candidates
from solver.nlp.program import Cost, Programme
from solver.variables import Unknowns

LEAST_PRICE = 0.1
LARGEST_PRICE = 1e6
FEASIBLE = 1e-8
REACH = 1.5
"""Rows change by at most about this much per unit of the trust radius."""

PATIENCE = 3
NOTHING_LEFT = 1e-9
"""A breach below this is a quadratic programme's rounding, not its choice."""


@dataclass(frozen=True, eq=False)
class Task:
    """What to minimise: cost, candidate rows, bounds of all unknowns (7 n,).

    Rows of the families in ``each`` are broken one by one at the fixed ``each_price``: one that
    costs more than that is given up. The other families are priced by their worst row, and the
    price rises until they hold. ``weights`` make a breach of some families dearer than of others.
    """

    unknowns: Unknowns
    cost: Cost
    rows: list[Candidates]
    bounds: tuple[Floats, Floats]
    each: tuple[str, ...] = ()
    each_price: float = 10.0
    weights: Mapping[str, float] = field(default_factory=dict)

    @property
    def families(self) -> tuple[str, ...]:
        """Names of the families priced by their worst row."""
        names = dict.fromkeys(r.block.family for r in self.rows)
        return tuple(n for n in names if n not in self.each)

    def breaches(self, values: Floats) -> dict[str, float]:
        """Breach of each family: its worst row, or the sum of its rows if each has its price."""
        state = self.unknowns.state(values)
        total: dict[str, float] = {}
        for r in self.rows:
            breach, name = r.block.violation(state), r.block.family
            if name in self.each:
                total[name] = total.get(name, 0.0) + float(breach.sum())
            else:
                total[name] = max(total.get(name, 0.0), float(breach.max(initial=0.0)))
        return total


class Run:
    """One solve: the place, the trust region, the price, the working set."""

    def __init__(
        self, task: Task, start: Floats, known: list[Floats] | None, price: float, radius: float
    ) -> None:
        self.task = task
        self.values = np.clip(start, *task.bounds)
        self.price = price
        self.radius = radius
        self.reach = np.inf
        self.held: list[Ints] = [np.zeros(0, np.int64) for _ in task.rows]
        sizes = [r.block.rows for r in task.rows]
        self.multipliers = [np.zeros(s) for s in sizes]
        for mine, before in zip(self.multipliers, known or [], strict=False):
            mine[: len(before)] = before
        self.breaches = task.breaches(self.values)
        self.gains: list[float] = []
        self.refused = 0
        self.cost = task.cost.value(task.unknowns.state(self.values))

    def programme(self) -> Programme:
        """The working set at the present place."""
        task = self.task
        state = task.unknowns.state(self.values)
        chosen = [
            r.choose(state, np.union1d(h, np.flatnonzero(m)), REACH * self.radius)
            for r, h, m in zip(task.rows, self.held, self.multipliers, strict=True)
        ]
        self.chosen = chosen
        blocks = tuple(r.block.take(c) for r, c in zip(task.rows, chosen, strict=True))
        return Programme(
            task.unknowns,
            task.cost,
            blocks,
            *task.bounds,
            self.values,
            task.families,
            task.each,
            tuple(self.price * task.weights.get(f, 1.0) for f in task.families),
            task.each_price,
        )

    @property
    def worst(self) -> float:
        """Breach of the worst family that has to hold."""
        return max(
            (b for name, b in self.breaches.items() if name not in self.task.each), default=0.0
        )

    @property
    def unpriced(self) -> bool:
        """Whether a row with a price of its own is broken but not yet paid for."""
        state = self.task.unknowns.state(self.values)
        return any(
            bool(
                (
                    (r.block.violation(state) > FEASIBLE) & (np.abs(m) < 0.5 * self.task.each_price)
                ).any()
            )
            for r, m in zip(self.task.rows, self.multipliers, strict=True)
            if r.block.family in self.task.each
        )

    def reprice(self, breach_before: float, left: float) -> None:
        """Keep the price of a breach above what breaking a limit is worth, but not far above.

        ``left`` is the breach that the last quadratic programme chose to leave. A price that is
        much too high makes every step creep along curved limits; one too low breaks them.
        """
        self.refused = (
            self.refused + 1 if breach_before > 1e-6 and left > 0.5 * breach_before else 0
        )
        if self.refused >= PATIENCE:
            self.price, self.refused = min(5.0 * self.price, LARGEST_PRICE), 0
        elif self.worst < 1e-5 or left < NOTHING_LEFT:
            worth: dict[str, float] = {}
            for r, m in zip(self.task.rows, self.multipliers, strict=True):
                worth[r.block.family] = worth.get(r.block.family, 0.0) + float(np.abs(m).sum())
            needed = max(
                (worth[f] / self.task.weights.get(f, 1.0) for f in self.task.families), default=0.0
            )
            if self.price > 4.0 * needed:
                self.price = max(2.0 * needed, LEAST_PRICE)

    def paid(self, breaches: dict[str, float]) -> float:
        """Price of the breaches."""
        task = self.task
        return sum(
            b * (task.each_price if n in task.each else self.price * task.weights.get(n, 1.0))
            for n, b in breaches.items()
        )

    def merit(self, cost: float, breaches: dict[str, float]) -> float:
        """What a step must lower: cost and price of the breaches."""
        return cost + self.paid(breaches)

    def hold_violated(self, values: Floats) -> None:
        """Work on what is violated at a place that was tried."""
        state = self.task.unknowns.state(values)
        self.held = [
            r.choose(state, h, REACH * self.radius)
            for r, h in zip(self.task.rows, self.held, strict=True)
        ]

    def remember(self, programme: Programme, multipliers: Floats) -> None:
        """Spread the multipliers of the working set over the candidate rows."""
        by_block = programme.by_block(multipliers)
        for known, chosen, part in zip(self.multipliers, self.chosen, by_block, strict=True):
            known[:] = 0.0
            known[chosen] = np.where(np.abs(part) > 1e-9, part, 0.0)
