"""Candidate rows about roll: pictures that stand level or upright."""

from __future__ import annotations

import numpy as np

from geometry.frames import pan_tilt_roll_from_rotation
from solver.constraints.base import bound
from solver.constraints.candidates import CandidateConstraints
from solver.constraints.rays import LevelAxis
from solver.problem import Problem
from solver.variables import NetworkState


def roll_constraints(problem: Problem, state: NetworkState) -> list[CandidateConstraints]:
    """The axis of each free camera's image that is to lie level: that of the nearest allowed roll.

    Equalities, so that a design holds its rolls to the last digit. Which of several rolls a camera
    takes is decided anew at the start of every outer iteration, from how it then is turned.
    """
    roll = problem.limits.roll
    free = np.array([i for i, c in enumerate(problem.cameras) if not c.fixed], dtype=np.int64)
    if not roll.allowed_deg or len(free) == 0:
        return []
    turned = [float(pan_tilt_roll_from_rotation(state.rotation[i])[2]) for i in free]
    axis = np.array([0 if roll.nearest_deg(t) == 0.0 else 1 for t in turned], dtype=np.int64)
    zero = bound(0.0, free)
    block = LevelAxis("roll", "deg", 180.0 / np.pi, zero, zero, free, axis)
    return [CandidateConstraints.all_of(block)]
