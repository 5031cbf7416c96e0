"""Cameras that moved as one: those of a rail or a plate that was bumped."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from calibration.adjustment.camera import INTERIOR, PER_CAMERA
from calibration.adjustment.rotations import cross_matrix
from calibration.adjustment.state import State
from calibration.check.diagnosis import Diagnosis
from calibration.check.hypotheses import ALPHA, Cause, Hypothesis
from calibration.check.linear import Columns
from calibration.check.suspects import fit_with
from geometry.arrays import Floats


def rigid_ways(state: State, cameras: list[int]) -> Floats:
    """Motions of cameras as one body, (6 c, 6): shift along and turn about the rig's axes.

    Of each camera its centre and its turn about its own axes, one after the other.
    """
    middle = state.centre[cameras].mean(axis=0)
    out = np.zeros((6 * len(cameras), 6))
    for k, camera in enumerate(cameras):
        rows = out[6 * k : 6 * k + 6]
        rows[:3, :3] = np.eye(3)
        rows[:3, 3:] = -cross_matrix(state.centre[camera] - middle)
        rows[3:, 3:] = -state.rotation[camera]
    return out


def rigid_group(diagnosis: Diagnosis) -> tuple[Hypothesis, ...]:
    """The accepted movements of cameras, when one movement of them all explains as much."""
    poses = tuple(h for h in diagnosis.accepted if h.cause is Cause.POSE)
    if len(poses) < 2:
        return ()
    epoch, last = diagnosis.epoch, diagnosis.last
    columns = Columns.of(epoch)
    cameras = [h.subject for h in poses]
    places = [columns.camera(k, INTERIOR, PER_CAMERA) for k in cameras]
    ways = rigid_ways(diagnosis.start, cameras)
    one = replace(poses[0], columns=np.concatenate(places), ways=ways)
    others = [h for h in diagnosis.accepted if h.cause is not Cause.POSE]
    # From the first fit's state it would not start: that is bent to what it did not know of.
    lost = fit_with(epoch, diagnosis.start, [*others, one]).chi2 - last.chi2
    return poses if lost < chdtri(6 * (len(poses) - 1), ALPHA) else ()
