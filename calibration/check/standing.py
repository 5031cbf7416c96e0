"""How each camera stands in the table: what the findings say of it, in the same figures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.adjustment.camera import INTERIOR, PER_CAMERA
from calibration.check.changes import by_camera, changes
from calibration.check.condition import LEAST_POINTS
from calibration.check.diagnosis import Diagnosis
from calibration.check.effects import Effects
from calibration.check.hypotheses import Cause
from calibration.check.scores import estimate
from calibration.check.verdicts import Finding, Kind, Sensitivity

UNSAID = "its pictures are not as in the reference"
LEFT_OUT = {
    Kind.BLURRED: "out of focus",
    Kind.CAMERA_MISSING: "no picture with a target",
    Kind.UNSYNCHRONISED: "pictures of other frames",
}
"""Why a camera is not checked, where its finding has no words of its own for it."""

OF_CAMERA = (Kind.CAMERA_MOVED, Kind.LENS_CHANGED, Kind.CANNOT_TELL)


@dataclass(frozen=True)
class Told:
    """What is said anyway: ``before`` the tests by the pictures' state, and ``alarms`` of tests.

    ``checkable``: whether enough pictures were left for tests.
    """

    alarms: tuple[Finding, ...]
    before: tuple[Finding, ...] = ()
    checkable: bool = True


@dataclass(frozen=True)
class Standing:
    """A camera's verdict, the reason where none can be given, and the effect at the subject."""

    verdict: Kind
    reason: str
    effect_px: float
    effect_mm: float


def standing(
    diagnosis: Diagnosis,
    found: Effects,
    camera: int,
    told: Told,
    sees: Sensitivity | None,
    hidden_limit_mm: float,
) -> Standing:
    """How a camera stands, by the findings first and then by what could hide."""
    name = diagnosis.epoch.camera_names[camera]
    points = int((diagnosis.epoch.camera == camera).sum())
    before = next((f for f in told.before if name in f.subjects and f.kind is not LOST), None)
    if before is not None and (points < LEAST_POINTS or not told.checkable):
        return _unchecked(before, points)
    if not told.checkable:
        return _untold("not checked: too few cameras are fit for it")
    px, mm = _effect(diagnosis, found, camera, told.alarms)
    if before is not None and before.kind is Kind.LENS_CHANGED:
        # Its pictures were turned back: what is left of them says nothing of what they were.
        return Standing(Kind.LENS_CHANGED, "", float("nan"), float("nan"))
    verdict, reason = _verdict(diagnosis, camera, points, sees, hidden_limit_mm)
    return Standing(verdict, reason, px, mm)


LOST = Kind.TARGETS_LOST
"""A camera that lost targets is checked by those that it sees."""


def _unchecked(before: Finding, points: int) -> Standing:
    if before.kind is Kind.CANNOT_TELL and not before.state:
        return _untold(_too_few(points))
    return _untold(f"not checked: {before.state or LEFT_OUT.get(before.kind, UNSAID)}")


def _untold(reason: str) -> Standing:
    return Standing(Kind.CANNOT_TELL, reason, float("nan"), float("nan"))


def _too_few(points: int) -> str:
    # What was left out before the tests is not counted here.
    return f"{points or 'too few'} targets, {LEAST_POINTS} are needed"


def _verdict(
    diagnosis: Diagnosis,
    camera: int,
    points: int,
    sees: Sensitivity | None,
    hidden_limit_mm: float,
) -> tuple[Kind, str]:
    if diagnosis.nobody_stands:
        return Kind.CANNOT_TELL, "most cameras changed"
    blamed = {c.cause.cause for c in changes(diagnosis) if camera in by_camera(c)}
    if Cause.POSE in blamed:
        return Kind.CAMERA_MOVED, ""
    if blamed:
        return Kind.LENS_CHANGED, ""
    if points < LEAST_POINTS or sees is None:
        return Kind.CANNOT_TELL, _too_few(points)
    if sees.hidden_mm > hidden_limit_mm:
        reason = f"movements that shift points by {sees.hidden_mm:.2g} mm could hide"
        return Kind.CANNOT_TELL, reason
    return Kind.FINE, ""


def _effect(
    diagnosis: Diagnosis, found: Effects, camera: int, alarms: tuple[Finding, ...]
) -> tuple[float, float]:
    """Effect of what was accepted of a camera, px and mm; else of the likeliest movement."""
    own = [by_camera(c)[camera] for c in changes(diagnosis) if camera in by_camera(c)]
    if own:
        px, mm = found.of(camera, np.sum(own, axis=0).reshape(PER_CAMERA), 0)
        name = diagnosis.epoch.camera_names[camera]
        said = [f.effect_mm for f in alarms if name in f.subjects and f.kind in OF_CAMERA]
        return px, max((v for v in said if np.isfinite(v)), default=mm)
    for h in diagnosis.tests.hypotheses:
        if h.cause is Cause.POSE and h.subject == camera:
            change, _ = estimate(h, diagnosis.last.linear, diagnosis.last.score)
            return found.of(camera, change, INTERIOR)
    return float("nan"), float("nan")
