"""What accepted causes changed, and by how much."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from calibration.adjustment.camera import INTERIOR, PER_CAMERA
from calibration.check.diagnosis import Diagnosis
from calibration.check.hypotheses import ALL_LENSES, Cause, Hypothesis, log_tail
from calibration.check.scores import ScoreTests
from calibration.check.subject import Subject
from geometry.arrays import Floats

LOG10 = float(np.log(10.0))


@dataclass(frozen=True, eq=False)
class Change:
    """An accepted cause, the change (d,) along its directions, and its test."""

    cause: Hypothesis
    change: Floats
    statistic: float
    dof: int

    @property
    def log10_p(self) -> float:
        """Decimal logarithm of the chance of such a statistic when nothing happened."""
        return log_tail(self.statistic, self.dof) / LOG10


def changes(diagnosis: Diagnosis) -> tuple[Change, ...]:
    """The accepted causes with their sizes, from the fit in which all are free."""
    out = []
    first = len(diagnosis.last.unknowns) - diagnosis.last.linear.freed.shape[1]
    for cause in diagnosis.accepted:
        size = cause.ways.shape[1]
        statistic, dof = _tested(diagnosis, cause)
        change = diagnosis.last.unknowns[first : first + size]
        out.append(Change(cause, change, statistic, dof))
        first += size
    return tuple(out)


def _tested(diagnosis: Diagnosis, cause: Hypothesis) -> tuple[float, int]:
    """Statistic and degrees of freedom of a cause when nothing is accounted for."""
    for k, h in enumerate(diagnosis.tests.hypotheses):
        if h is cause:
            return float(diagnosis.outcomes.statistic[k]), int(diagnosis.tests.dof[k])
    # Causes that some cameras share are none of those that every check tests.
    alone = ScoreTests((cause,), diagnosis.first.linear)
    return float(alone.run(diagnosis.first.score).statistic[0]), int(alone.dof[0])


def camera_change(one: Change) -> Floats:
    """A change of a camera or its lens as one of all its parameters (19,)."""
    out = np.zeros(PER_CAMERA)
    first = INTERIOR if one.cause.cause is Cause.POSE else 0
    out[first : first + len(one.change)] = one.change
    return out


def effect_of_mm(group: Iterable[Change], subject: Subject) -> float:
    """What changes of cameras do together at the subject; NaN when there are none."""
    done: dict[int, Floats] = {}
    for one in group:
        for camera, change in by_camera(one).items():
            done[camera] = done.get(camera, np.zeros(PER_CAMERA)) + change
    return subject.effect_mm(done) if done else float("nan")


def by_camera(one: Change) -> Mapping[int, Floats]:
    """A change's share in each camera's parameters (19,); empty for those of targets."""
    if one.cause.cause in (Cause.POSE, Cause.LENS):
        return {one.cause.subject: camera_change(one)}
    if one.cause.cause not in ALL_LENSES:
        return {}
    out: dict[int, Floats] = defaultdict(lambda: np.zeros(PER_CAMERA))
    pixels = one.cause.ways @ one.change
    for column, px in zip(one.cause.columns.tolist(), pixels, strict=True):
        out[column // PER_CAMERA][column % PER_CAMERA] += px
    return out
