"""What a violation costs in the merit of a step, and how that penalty follows the multipliers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import Floats
from solver.nlp.program import NonlinearProgram

LEAST_PENALTY = 0.1
LARGEST_PENALTY = 1e6
PATIENCE = 3
NOTHING_LEFT = 1e-9
"""A violation below this is a quadratic program's rounding, not its choice."""


@dataclass(frozen=True)
class Penalty:
    """The weight of a family's worst violation.

    ``refused`` counts the steps in a row in which the quadratic program left most of it standing.
    """

    weight: float
    refused: int = 0

    def of_family(self, program: NonlinearProgram, family: str) -> float:
        """Weight of one family, its own factor included."""
        if family in program.each:
            return program.each_penalty
        return self.weight * program.weights.get(family, 1.0)

    def charge(self, program: NonlinearProgram, violations: Mapping[str, float]) -> float:
        """What the violations cost together."""
        return sum(v * self.of_family(program, name) for name, v in violations.items())

    def raised(self) -> Penalty:
        """Ten times as heavy, as far as that goes."""
        return replace(self, weight=min(self.weight * 10.0, LARGEST_PENALTY))

    def after_step(
        self,
        program: NonlinearProgram,
        multipliers: Sequence[Floats],
        before: float,
        left: float,
        worst: float,
    ) -> Penalty:
        """Keep the penalty above what violating a limit is worth, but not far above.

        ``before`` and ``worst`` are the worst violation before and after the step, ``left`` the
        one that its quadratic program chose to leave. A penalty that is much too high makes every
        step creep along curved limits; one too low breaks them.
        """
        refused = self.refused + 1 if before > 1e-6 and left > 0.5 * before else 0
        if refused >= PATIENCE:
            return Penalty(min(5.0 * self.weight, LARGEST_PENALTY))
        if worst < 1e-5 or left < NOTHING_LEFT:
            needed = _worth(program, multipliers)
            if self.weight > 4.0 * needed:
                return Penalty(max(2.0 * needed, LEAST_PENALTY), refused)
        return Penalty(self.weight, refused)


def _worth(program: NonlinearProgram, multipliers: Sequence[Floats]) -> float:
    """The least weight at which no family is worth violating: the sum of its multipliers."""
    worth: dict[str, float] = {}
    for r, m in zip(program.rows, multipliers, strict=True):
        worth[r.block.family] = worth.get(r.block.family, 0.0) + float(np.abs(m).sum())
    return max((worth[f] / program.weights.get(f, 1.0) for f in program.families), default=0.0)
