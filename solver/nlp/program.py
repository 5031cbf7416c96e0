"""What is to be minimised: a cost, all candidate constraints, bounds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

from geometry.arrays import Floats
from solver.constraints.candidates import CandidateConstraints
from solver.variables import NetworkState, Unknowns


class Cost(Protocol):
    """A function of the network to be made small."""

    def value(self, state: NetworkState) -> float:
        """The cost."""

    def gradient(self, state: NetworkState) -> Floats:
        """Its derivative by all unknowns, (7 n,)."""

    def hessian(self, state: NetworkState) -> Floats:
        """Its second derivative, (7 n, 7 n)."""


@dataclass(frozen=True, eq=False)
class NonlinearProgram:
    """Cost, candidate constraints, bounds of all unknowns (7 n,).

    Rows of the families in ``each`` are relaxed one by one at the fixed ``each_penalty``: one
    that costs more than that is given up. The other families are penalised by their worst row,
    and the penalty rises until they hold. ``weights`` make a violation of some families dearer
    than of others.
    """

    unknowns: Unknowns
    cost: Cost
    rows: list[CandidateConstraints]
    bounds: tuple[Floats, Floats]
    each: tuple[str, ...] = ()
    each_penalty: float = 10.0
    weights: Mapping[str, float] = field(default_factory=dict)

    @property
    def families(self) -> tuple[str, ...]:
        """Names of the families penalised by their worst row."""
        names = dict.fromkeys(r.block.family for r in self.rows)
        return tuple(n for n in names if n not in self.each)

    def violations(self, values: Floats) -> dict[str, float]:
        """Violation of each family: its worst row, or the sum of its rows if each is penalised."""
        state = self.unknowns.state(values)
        total: dict[str, float] = {}
        for r in self.rows:
            violation, name = r.block.violation(state), r.block.family
            if name in self.each:
                total[name] = total.get(name, 0.0) + float(violation.sum())
            else:
                total[name] = max(total.get(name, 0.0), float(violation.max(initial=0.0)))
        return total

    def worst(self, violations: Mapping[str, float]) -> float:
        """The largest violation of a family that has to hold."""
        return max((v for name, v in violations.items() if name not in self.each), default=0.0)
