"""From accepted causes to findings."""

from __future__ import annotations

from collections import defaultdict

import numpy as np

from calibration.adjustment.camera import INTERIOR
from calibration.check import messages as words
from calibration.check.changes import (
    LOG10,
    Change,
    by_camera,
    camera_change,
    changes,
    effect_of_mm,
)
from calibration.check.diagnosis import Diagnosis
from calibration.check.effects import Effects
from calibration.check.gross import Corrected
from calibration.check.groups import rigid_group
from calibration.check.hypotheses import ALL_LENSES, Cause, Hypothesis, log_tail
from calibration.check.scores import estimate
from calibration.check.subject import Subject
from calibration.check.verdicts import Finding, Kind

RIVAL = 10.0
"""Another camera whose statistic comes this near would explain the images almost as well."""

TIE = 0.01
FACE_MM = 200.0
MANY_TARGETS = 4
CROP_PX = 1.5
CROP_SHARE = 0.1
"""An image shifted by more than the first, and stretched by less than this share of it, was cut
out elsewhere: no lens does that."""

SYNC = (Cause.VIEW, Cause.CAMERA_SYNC, Cause.PLACE_SYNC)


def findings(
    corrected: Corrected, diagnosis: Diagnosis, found: Effects, subject: Subject
) -> list[Finding]:
    """All findings of alarming kinds, gross ones first."""
    out = _gross(corrected, diagnosis)
    done = changes(diagnosis)
    together = rigid_group(diagnosis)
    if together and not diagnosis.nobody_stands:
        out.append(_group(together, diagnosis, found, subject))
        done = tuple(c for c in done if c.cause not in together)
    if diagnosis.nobody_stands:
        out.append(_most_cameras(done, diagnosis))
        done = tuple(c for c in done if c.cause.cause not in (Cause.POSE, Cause.LENS))
    by_carrier: dict[int, list[Change]] = defaultdict(list)
    sync: list[Change] = []
    lenses: list[Change] = []
    for one in done:
        cause = one.cause.cause
        if cause is Cause.POSE:
            out.append(_camera(one, diagnosis, found, subject))
        elif cause is Cause.LENS:
            out.append(_lens(one, diagnosis, found, subject))
        elif cause in ALL_LENSES:
            lenses.append(one)
        elif cause is Cause.TARGET:
            by_carrier[int(diagnosis.epoch.target_carrier[one.cause.subject])].append(one)
        elif cause in (Cause.BEND, Cause.SHAPE):
            out.append(_bent(one, diagnosis, found))
        elif cause in (Cause.SCALE, Cause.ALL_SCALE):
            out.append(_scale(one, diagnosis, corrected, found))
        else:
            sync.append(one)
    if lenses:
        out.append(_all_lenses(lenses, diagnosis, subject))
    for carrier, group in by_carrier.items():
        out.append(_targets(carrier, group, diagnosis, found))
    if sync:
        out.append(_unsynchronised(sync, diagnosis))
    return out


def _most_cameras(done: tuple[Change, ...], diagnosis: Diagnosis) -> Finding:
    """Too few cameras agree for naming those that changed."""
    epoch = diagnosis.epoch
    names = tuple(epoch.camera_names[int(k)] for k in np.unique(epoch.camera))
    statistic = max(one.statistic for one in done)
    return Finding(Kind.UNEXPLAINED, names, words.most_cameras(names), statistic)


def _gross(corrected: Corrected, diagnosis: Diagnosis) -> list[Finding]:
    epoch = corrected.epoch
    out = []
    for cycle in corrected.cameras:
        names = tuple(epoch.camera_names[k] for k in cycle)
        out.append(Finding(Kind.CAMERAS_SWAPPED, names, words.cameras_swapped(names)))
    if corrected.ids:
        pairs = tuple((epoch.target_names[a], epoch.target_names[b]) for a, b in corrected.ids)
        out.append(Finding(Kind.IDS_SWAPPED, tuple(a for a, _ in pairs), words.ids(pairs)))
    free = {h.cause.subject: h for h in changes(diagnosis) if h.cause.cause is Cause.SCALE}
    for carrier, scale in corrected.scales:
        if carrier not in free:
            out.append(_printed(carrier, scale, 0.0, diagnosis))
    return out


def scale_estimate(diagnosis: Diagnosis, cause: Cause, subject: int) -> tuple[float, float]:
    """Relative size of a carrier (or of all) against the reference, less 1, and its sigma.

    Where cameras were found to have changed, with these changes accounted for: what they bend
    would be told of the carriers a second time.
    """
    of_cameras = all(h.cause in (Cause.POSE, Cause.LENS) for h in diagnosis.accepted)
    done = diagnosis.last if of_cameras else diagnosis.first
    for h in diagnosis.tests.hypotheses:
        if h.cause is cause and h.subject == subject:
            change, covariance = estimate(h, done.linear, done.score)
            return float(change[0]), float(np.sqrt(covariance[0, 0]))
    return float("nan"), float("nan")


def _printed(carrier: int, scale: float, more: float, diagnosis: Diagnosis) -> Finding:
    name = diagnosis.epoch.carrier_names[carrier]
    rest, sigma = scale_estimate(diagnosis, Cause.SCALE, carrier)
    value = scale * (1.0 + (more or rest))
    statistic = ((value - 1.0) / sigma) ** 2
    return Finding(
        Kind.PRINT_SCALE,
        (name,),
        words.printed(name, value),
        statistic,
        1,
        log_tail(statistic, 1) / LOG10,
        value=value,
        sigma=sigma,
    )


def _scale(one: Change, diagnosis: Diagnosis, corrected: Corrected, found: Effects) -> Finding:
    if one.cause.cause is Cause.SCALE:
        before = dict(corrected.scales).get(one.cause.subject, 1.0)
        return _printed(one.cause.subject, before, float(one.change[0]), diagnosis)
    value, (_, sigma) = float(one.change[0]), scale_estimate(diagnosis, Cause.ALL_SCALE, 0)
    # What a face's width gets wrong by it.
    effect_mm = abs(value) * FACE_MM
    return Finding(
        Kind.SCALE_CHANGED,
        diagnosis.epoch.carrier_names,
        words.scale(1e6 * value),
        one.statistic,
        one.dof,
        one.log10_p,
        effect_mm / found.gsd_mm,
        effect_mm,
        value=1.0 + value,
        sigma=sigma,
    )


def _group(
    together: tuple[Hypothesis, ...], diagnosis: Diagnosis, found: Effects, subject: Subject
) -> Finding:
    """Cameras that moved as one; or all the others did, which looks the same."""
    epoch = diagnosis.epoch
    own = [c for c in changes(diagnosis) if c.cause in together]
    which = {c.cause.subject for c in own}
    names = tuple(epoch.camera_names[k] for k in sorted(which))
    seeing = [int(k) for k in np.unique(epoch.camera)]
    others = tuple(epoch.camera_names[k] for k in seeing if k not in which)
    px = max(found.of(c.cause.subject, c.change, INTERIOR)[0] for c in own)
    mm = subject.effect_mm({c.cause.subject: camera_change(c) for c in own})
    worst = max(own, key=lambda c: c.statistic)
    return Finding(
        Kind.CAMERA_MOVED,
        names,
        words.group(names, others, px, mm),
        worst.statistic,
        worst.dof,
        worst.log10_p,
        px,
        mm,
        candidates=others,
    )


def _at_subject(one: Change, found: Effects, subject: Subject) -> tuple[float, float]:
    """Effect of a camera's change in its image, px, and at its worst place of the subject, mm."""
    camera = one.cause.subject
    first = INTERIOR if one.cause.cause is Cause.POSE else 0
    px, everywhere_mm = found.of(camera, one.change, first)
    mm = subject.effect_mm({camera: camera_change(one)})
    return px, max(everywhere_mm, mm) if np.isfinite(mm) else everywhere_mm


def _camera(one: Change, diagnosis: Diagnosis, found: Effects, subject: Subject) -> Finding:
    camera = one.cause.subject
    names = diagnosis.epoch.camera_names
    px, mm = _at_subject(one, found, subject)
    rivals, tied = _rivals(one, diagnosis)
    kind, sentence = Kind.CAMERA_MOVED, words.moved(names[camera], px, mm)
    subjects: tuple[str, ...] = (names[camera],)
    if tied:
        subjects = (names[camera], *tied)
        kind, sentence = Kind.CANNOT_TELL, words.either(subjects)
    return Finding(
        kind, subjects, sentence, one.statistic, one.dof, one.log10_p, px, mm, candidates=rivals
    )


def _rivals(one: Change, diagnosis: Diagnosis) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Cameras that would explain the images almost as well, and those that do exactly so."""
    rivals, tied = [], []
    for k, h in enumerate(diagnosis.tests.hypotheses):
        if (
            h.cause is not Cause.POSE
            or h.subject == one.cause.subject
            or len(diagnosis.accepted) > 1
        ):
            continue
        short = one.statistic - float(diagnosis.outcomes.statistic[k])
        name = diagnosis.epoch.camera_names[h.subject]
        if abs(short) < TIE * one.statistic:
            tied.append(name)
        elif short < RIVAL:
            rivals.append(name)
    return tuple(rivals), tuple(tied)


def _lens(one: Change, diagnosis: Diagnosis, found: Effects, subject: Subject) -> Finding:
    camera = one.cause.subject
    name = diagnosis.epoch.camera_names[camera]
    px, mm = _at_subject(one, found, subject)
    focal_px, *_ = diagnosis.epoch.reference.interior[camera]
    share = float(one.change[0] / focal_px)
    shift = (float(one.change[1]), float(one.change[2]))
    # What the focal length does at the image's border, against the shift of all of it.
    border_px = abs(share) * max(diagnosis.epoch.image_size_px[camera]) / 2.0
    whole = float(np.hypot(*shift))
    cropped = whole > CROP_PX and border_px < CROP_SHARE * whole
    return Finding(
        Kind.LENS_CHANGED,
        (name,),
        words.cropped(name, shift, mm) if cropped else words.lens(name, px, mm, share),
        one.statistic,
        one.dof,
        one.log10_p,
        px,
        mm,
        value=share,
    )


def _all_lenses(group: list[Change], diagnosis: Diagnosis, subject: Subject) -> Finding:
    """Lenses of all or some cameras changed alike, or pictures were cut or resized otherwise."""
    epoch = diagnosis.epoch
    names = tuple(epoch.camera_names[k] for k in sorted(by_camera(group[0])))
    mm = effect_of_mm(group, subject)
    size = {one.cause.cause: one.change for one in group}
    share = float(size.get(Cause.ALL_FOCAL, np.zeros(1))[0])
    shift = tuple(float(v) for v in size.get(Cause.ALL_SHIFT, np.zeros(2)))
    some = names if len(names) < len(np.unique(epoch.camera)) else ()
    sentence = words.all_lenses(1e6 * share, (shift[0], shift[1]), mm, some)
    worst = max(group, key=lambda one: one.statistic)
    return Finding(
        Kind.LENS_CHANGED,
        names,
        sentence,
        worst.statistic,
        worst.dof,
        worst.log10_p,
        effect_mm=mm,
        value=share,
    )


def _displacement_mm(one: Change) -> float:
    """Largest displacement of a target by a change of its carrier's shape."""
    moves = (one.cause.ways @ one.change).reshape(-1, 3)
    # A bend has its rigid part and its size in common with the carrier's place.
    moves = moves - moves.mean(axis=0) if len(moves) > 1 else moves
    return float(np.linalg.norm(moves, axis=1).max())


def _bent(one: Change, diagnosis: Diagnosis, found: Effects) -> Finding:
    name = diagnosis.epoch.carrier_names[one.cause.subject]
    mm = _displacement_mm(one)
    return Finding(
        Kind.CARRIER_BENT,
        (name,),
        words.bent(name, mm),
        one.statistic,
        one.dof,
        one.log10_p,
        mm / found.gsd_mm,
        mm,
    )


def _targets(carrier: int, group: list[Change], diagnosis: Diagnosis, found: Effects) -> Finding:
    epoch = diagnosis.epoch
    worst = max(group, key=lambda one: one.statistic)
    mm = max(_displacement_mm(one) for one in group)
    name = epoch.carrier_names[carrier]
    targets = tuple(epoch.target_names[one.cause.subject] for one in group)
    kind, subjects = Kind.TARGET_MOVED, targets
    sentence = words.target_moved(targets, name, mm)
    if len(group) > max(MANY_TARGETS, int(0.2 * np.sum(epoch.target_carrier == carrier))):
        kind, subjects, sentence = Kind.CARRIER_BENT, (name,), words.bent(name, mm)
    return Finding(
        kind,
        subjects,
        sentence,
        worst.statistic,
        worst.dof,
        worst.log10_p,
        mm / found.gsd_mm,
        mm,
    )


def _unsynchronised(group: list[Change], diagnosis: Diagnosis) -> Finding:
    epoch, base = diagnosis.epoch, diagnosis.last.linear.columns
    cameras: set[int] = set()
    frames: set[int] = set()
    largest = 0.0
    for one in group:
        views = np.unique((one.cause.columns - base.reference) // 6)
        if one.cause.cause is not Cause.PLACE_SYNC:
            cameras |= {int(c) for c in epoch.view_camera[views]}
        if one.cause.cause is not Cause.CAMERA_SYNC:
            frames |= {int(f) for f in epoch.place_frame[epoch.view_place[views]]}
        translation = diagnosis.last.linear.design @ (one.cause.directions(base.count) @ one.change)
        translations = np.linalg.norm(
            np.asarray(translation).reshape(-1, 2) * epoch.sigma_px, axis=1
        )
        largest = max(largest, float(translations.max()))
    named = tuple(epoch.camera_names[c] for c in sorted(cameras))
    when = tuple(epoch.frame_names[f] for f in sorted(frames))
    worst = max(group, key=lambda one: one.statistic)
    sentence = words.unsynchronised(named or ("the cameras",), when, largest)
    return Finding(
        Kind.UNSYNCHRONISED,
        named or when,
        sentence,
        worst.statistic,
        worst.dof,
        worst.log10_p,
        largest,
    )
