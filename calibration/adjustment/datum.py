"""The datum of a free network: inner constraints on the cameras.

Images alone leave the place and the turn of the whole rig open (and its size, when no length is
known). Instead of holding one camera fast, which would put all its uncertainty into the others,
the cameras as a whole neither move nor turn (nor grow) against their start: the trace of their
covariance is then the smallest of all choices.
"""

from __future__ import annotations

import numpy as np

from calibration.adjustment.camera import INTERIOR, PER_CAMERA
from calibration.adjustment.network import Network
from calibration.adjustment.rotations import cross_matrix
from calibration.adjustment.state import State
from geometry.arrays import Floats


def shift_space(state: State, scaled: bool) -> Floats:
    """How all camera parameters (19 n, 6 or 7) change as the rig shifts, turns (and grows)."""
    count = len(state.centre)
    arm = state.centre - state.centre.mean(axis=0)
    out = np.zeros((count, PER_CAMERA, 6 + scaled))
    out[:, INTERIOR : INTERIOR + 3, :3] = np.eye(3)
    out[:, INTERIOR : INTERIOR + 3, 3:6] = -cross_matrix(arm)
    out[:, INTERIOR + 3 :, 3:6] = -state.rotation
    if scaled:
        out[:, INTERIOR : INTERIOR + 3, 6] = arm
    return out.reshape(count * PER_CAMERA, 6 + scaled)


def reach_mm(state: State, network: Network) -> float:
    """Mean distance of the cameras from what they see: turns are weighed by it, mm."""
    points = state.points_rig_mm(network.observed.pose, network.observed.target)
    away = points - state.centre[network.observed.camera]
    return float(np.linalg.norm(away, axis=1).mean())


def inner_constraints(state: State, network: Network) -> Floats:
    """Rows B^T of the constraints ``B^T dx = 0`` on the core, as B (core_count, 6 or 7).

    Turns count by what they move at the subject, so that the datum does not depend on units.
    """
    space = shift_space(state, network.datum_scale)
    weight = np.ones(PER_CAMERA)
    weight[INTERIOR + 3 :] = reach_mm(state, network) ** 2
    constraint = space * np.tile(weight, len(state.centre))[:, None]
    constraint /= np.linalg.norm(constraint, axis=0)
    out = np.zeros((network.core_count, constraint.shape[1]))
    out[: len(constraint)] = constraint
    return out
