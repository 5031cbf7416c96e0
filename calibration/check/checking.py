"""The check: new images against a stored calibration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from calibration.adjustment.result import Calibration
from calibration.check import messages as words
from calibration.check.changes import changes, effect_of_mm
from calibration.check.condition import (
    LEAST_POINTS,
    condition_of,
    is_mirrored,
    unexplained,
)
from calibration.check.diagnosis import Diagnosis, diagnose
from calibration.check.effects import effects
from calibration.check.epoch import Epoch, epoch_of, require_known
from calibration.check.findings import findings, scale_estimate
from calibration.check.gross import Corrected, corrected_epoch
from calibration.check.hypotheses import ALPHA, Cause
from calibration.check.standing import Told
from calibration.check.subject import subject_of
from calibration.check.tables import (
    Noise,
    camera_checks,
    carrier_checks,
    length_checks,
    noise_of,
    power95_factor,
)
from calibration.check.verdicts import STOPPING, CameraCheck, CheckResult, Finding, Kind, Light
from calibration.defaults import HIDDEN_LIMIT_MM, TOLERANCE_MM
from calibration.detection.detections import PictureProblem
from calibration.observations import Observations
from common.errors import InputError
from common.progress import (
    CancelToken,
    NeverCancelled,
    Progress,
    ProgressCallback,
    go_on,
    ignore_progress,
)

UNEXPLAINED = 2.0
"""What is left may not be more than this many times the expected misfit."""

SHIFT_NOTE_MM = 0.05


@dataclass(frozen=True)
class CheckOptions:
    """What matters at the subject.

    ``hidden_limit_mm``: a camera of which larger effects could hide is not called fine.
    ``tolerance_mm``: smaller effects are told, but do not turn the light red.
    """

    hidden_limit_mm: float = HIDDEN_LIMIT_MM
    tolerance_mm: float = TOLERANCE_MM

    def __post_init__(self) -> None:
        if not (self.hidden_limit_mm > 0.0 and self.tolerance_mm >= 0.0):
            raise InputError(
                "check-limit",
                "hidden_limit_mm must be positive and tolerance_mm not negative",
                "give lengths in millimetres",
            )


def check(
    reference: Calibration,
    observations: Observations,
    options: CheckOptions | None = None,
    progress: ProgressCallback = ignore_progress,
    cancel: CancelToken | None = None,
    problems: Mapping[str, PictureProblem] | None = None,
) -> CheckResult:
    """What changed since the reference was made: which camera, lens, target; or nothing.

    ``problems``: cameras whose pictures could not be used, and why, as detection told.

    Raises :class:`InputError` when the observations are not of the reference's rig and targets,
    and :class:`CancelledError`.
    """
    cancel = cancel or NeverCancelled()
    progress(Progress("reading", 0.0))
    problems = problems or {}
    require_known(reference, (*observations.cameras, *problems))
    condition = condition_of(reference, observations, problems)
    if not condition.keep.all():
        observations = observations.subset(np.flatnonzero(condition.keep))
    epoch = epoch_of(reference, observations)
    go_on(cancel)
    progress(Progress("gross faults", 0.2))
    corrected = corrected_epoch(epoch)
    go_on(cancel)
    progress(Progress("tests", 0.4))
    diagnosis = diagnose(corrected.epoch, corrected.start.state, corrected.suspects)
    go_on(cancel)
    progress(Progress("verdict", 0.9))
    # Codes that are read in a mirror are read by chance: nothing else follows from them.
    seen = {epoch.camera_names[int(k)] for k in np.unique(epoch.camera)}
    readable = not any(is_mirrored(f) and seen <= set(f.subjects) for f in corrected.pictures)
    return judge(
        reference,
        observations,
        epoch,
        corrected,
        diagnosis,
        options or CheckOptions(),
        (*unexplained(condition.findings, corrected.pictures), *corrected.pictures),
        condition.checkable and readable,
    )


def judge(
    reference: Calibration,
    observations: Observations,
    epoch: Epoch,
    corrected: Corrected,
    diagnosis: Diagnosis,
    options: CheckOptions,
    before: tuple[Finding, ...] = (),
    checkable: bool = True,
) -> CheckResult:
    """All tables and findings of a finished diagnosis.

    ``before``: what the state of the pictures told already; of these cameras nothing else is told,
    and nothing at all where too little is left to be ``checkable``.
    """
    found = effects(diagnosis.epoch, diagnosis.first.state)
    noise = noise_of(diagnosis)
    subject = subject_of(diagnosis.epoch, diagnosis.first.state)
    alarms = _weighed(
        findings(corrected, diagnosis, found, subject),
        effect_of_mm(changes(diagnosis), subject),
        options,
    )
    told = Told(tuple(alarms), before, checkable)
    cameras = camera_checks(diagnosis, found, noise, options.hidden_limit_mm, told)
    reported = before
    if checkable or not before:
        reported = _after(before, verdicts(alarms, cameras, noise, diagnosis))
    scale, scale_sigma = _scale(diagnosis)
    distances = reference.targets.distances or observations.targets.distances
    residual = diagnosis.first.v * _sigmas(diagnosis)
    return CheckResult(
        _light(reported),
        reported,
        cameras,
        carrier_checks(diagnosis, reference, reported),
        length_checks(diagnosis, corrected.start, distances, scale_sigma),
        diagnosis.first.chi2,
        2 * len(diagnosis.first.v) - 6 * len(epoch.place_carrier),
        float(np.sqrt(np.mean(residual**2))),
        1e6 * scale,
        1e6 * scale_sigma,
        power95_factor(diagnosis),
        ALPHA,
        len(epoch.pixel),
        len(np.unique(epoch.place_frame[epoch.moving])) or 1,
        diagnosis.outliers,
        _notes(epoch, diagnosis, reference),
    )


def _after(before: tuple[Finding, ...], reported: tuple[Finding, ...]) -> tuple[Finding, ...]:
    """What the pictures' state told first, then what does not follow from it."""
    blamed = {name for f in before for name in f.subjects}
    if not blamed:
        return reported
    rest = [
        f
        for f in reported
        if f.kind is not Kind.FINE and not (f.kind in FOLLOWS and set(f.subjects) <= blamed)
    ]
    return (*before, *rest)


FOLLOWS = (
    Kind.CAMERA_MOVED,
    Kind.LENS_CHANGED,
    Kind.UNSYNCHRONISED,
    Kind.NOISE_RAISED,
    Kind.CANNOT_TELL,
)
CAMERA_KINDS = (Kind.CAMERA_MOVED, Kind.LENS_CHANGED)


def _weighed(found: list[Finding], joint_mm: float, options: CheckOptions) -> list[Finding]:
    """The findings, marked as tolerable where their effect at the subject is.

    ``joint_mm``: what all changes of cameras do together. Where that matters, none of them is
    tolerable, however little it does by itself.
    """
    small = [f.kind in STOPPING and f.effect_mm < options.tolerance_mm for f in found]
    out = []
    for finding, tolerable in zip(found, small, strict=True):
        more = f" That is less than the {words.length(options.tolerance_mm)} that matter."
        if tolerable and finding.kind in CAMERA_KINDS and joint_mm >= options.tolerance_mm:
            tolerable, more = False, " " + words.together(joint_mm)
            finding = replace(finding, sentence=finding.sentence + more)
        if tolerable:
            finding = replace(finding, tolerable=True, sentence=finding.sentence + more)
        out.append(finding)
    return out


def _sigmas(diagnosis: Diagnosis) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    return diagnosis.first.linear.epoch.sigma_px


def _light(reported: tuple[Finding, ...]) -> Light:
    lights = {f.light for f in reported}
    for light in (Light.RED, Light.YELLOW):
        if light in lights:
            return light
    return Light.GREEN


def _scale(diagnosis: Diagnosis) -> tuple[float, float]:
    together = scale_estimate(diagnosis, Cause.ALL_SCALE, 0)
    if np.isfinite(together[0]):
        return together
    carrier = int(diagnosis.epoch.place_carrier[0])
    return scale_estimate(diagnosis, Cause.SCALE, carrier)


def verdicts(
    alarms: list[Finding],
    cameras: tuple[CameraCheck, ...],
    noise: Noise,
    diagnosis: Diagnosis,
) -> tuple[Finding, ...]:
    """Alarms, then doubts; or that all is fine."""
    reported = list(alarms)
    names = diagnosis.epoch.camera_names
    freedom = 2 * len(diagnosis.last.v)
    ratio = float(np.sqrt(diagnosis.last.chi2 / max(freedom, 1)))
    if ratio > UNEXPLAINED and not diagnosis.nobody_stands:
        reported.insert(0, Finding(Kind.UNEXPLAINED, names, words.unexplained(ratio), value=ratio))
    else:
        for k in np.flatnonzero(noise.raised()):
            factor = float(noise.factor[k])
            reported.append(
                Finding(
                    Kind.NOISE_RAISED,
                    (names[k],),
                    words.noise(names[k], factor),
                    log10_p=float(np.log10(max(noise.p[k], 1e-300))),
                    value=factor,
                )
            )
    if not diagnosis.nobody_stands:
        reported += _doubts(cameras)
    if not reported:
        hidden = max(c.sensitivity.hidden_mm for c in cameras if c.sensitivity)
        hidden *= power95_factor(diagnosis)
        reported.append(Finding(Kind.FINE, names, words.fine(len(names), hidden), effect_mm=hidden))
    return tuple(reported)


def _doubts(cameras: tuple[CameraCheck, ...]) -> list[Finding]:
    out = []
    unsure = [c for c in cameras if c.verdict is Kind.CANNOT_TELL]
    few = tuple(c.name for c in unsure if c.points < LEAST_POINTS or c.sensitivity is None)
    weak = [c for c in unsure if c.name not in few]
    if few:
        out.append(Finding(Kind.CANNOT_TELL, few, words.few(few, LEAST_POINTS)))
    if weak:
        names = tuple(c.name for c in weak)
        hidden = max(c.sensitivity.hidden_mm for c in weak if c.sensitivity)
        out.append(Finding(Kind.CANNOT_TELL, names, words.weak(names, hidden), effect_mm=hidden))
    return out


def _notes(epoch: Epoch, diagnosis: Diagnosis, reference: Calibration) -> tuple[str, ...]:
    out = []
    if diagnosis.outliers:
        out.append(f"{diagnosis.outliers} image points were left out as single blunders.")
    if epoch.unknown_rows:
        out.append(
            f"{epoch.unknown_rows} image points of targets unknown to the reference were left out."
        )
    out += [
        f"{row.name} is {words.length(row.shift_mm)} from where it was before the same cameras; "
        "that does no harm."
        for row in carrier_checks(diagnosis, reference, ())
        if row.shift_mm > SHIFT_NOTE_MM and not diagnosis.accepted
    ]
    return tuple(out)
