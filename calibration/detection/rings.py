"""Ring-coded targets: dots found, codes read, the whole target fitted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calibration.detection import localmap
from calibration.detection.detections import Point
from calibration.detection.fitting import Fitted, fit_target, point_of, rejected
from calibration.detection.gates import Gates, Rejection, Rule
from calibration.detection.images import Picture
from calibration.detection.ringreading import (
    LARGEST_DOUBT,
    Dots,
    Reading,
    find_dots,
    read_codes,
    ringed,
    sure,
)
from calibration.targets.kinds import RING_QUIET, RingCarrier
from calibration.targets.patterns import RingPattern
from geometry.arrays import Floats

_MISFIT_SHARE = 0.5
"""A code that is wrong by half a sector changes little of the whole picture: less is allowed."""

_LARGEST_PATCH = 0.1
"""Of the contrast, by which 3 x 3 pixels may differ from what was printed. White paper over a part
of a ring makes one code of another; mostly its edge shows there, by 0.14 and more in the simulated
studio, where 200 targets that nothing hides stay below 0.08."""

_NOISE_PATCHES = 2.0
"""Nor is it a flaw up to so many times the misfit: the mean of 9 pixels of noise, a third of the
misfit, reaches 1.2 times that once among the 400 patches of a target."""


def ring_dots(picture: Picture, gates: Gates) -> Dots:
    """All dots with rings round them in a picture with black targets on white."""
    return ringed(picture.grey, find_dots(picture.grey, gates.smallest_dot_px))


def ring_points(
    picture: Picture, dots: Dots, carriers: Sequence[RingCarrier], gates: Gates
) -> tuple[list[Point], list[Rejection]]:
    """Targets of the carriers among the dots of a picture."""
    points: list[Point] = []
    rejections: list[Rejection] = []
    rejected_dots: list[int] = []
    accepted: list[int] = []
    read = {bits: read_codes(picture.grey, dots, bits) for bits in _families(carriers)}
    for k in range(len(dots)):
        choices = [
            (carrier, number, read[carrier.family.bits][k])
            for carrier in carriers
            if (number := _number(carrier, read[carrier.family.bits][k])) is not None
        ]
        where = dots.centres_px[k]
        if not choices:
            best = min((readings[k] for readings in read.values()), key=lambda r: r.doubt)
            rejections.append(
                rejected("ring target", (Rule.CODE, best.doubt, LARGEST_DOUBT), where)
            )
            rejected_dots.append(k)
            continue
        tried = [
            (
                carrier.id_of(number),
                _target(picture, carrier, reading, where, dots.axes_px[k], gates),
            )
            for carrier, number, reading in choices
        ]
        # Of two families' codes that can be read, the one that looks more alike is meant.
        name, found = min(tried, key=lambda t: t[1].misfit if isinstance(t[1], Fitted) else 9.0)
        found = _alike(found, gates) if isinstance(found, Fitted) else found
        if isinstance(found, Fitted):
            points.append(point_of(name, found, np.zeros(2)))
            accepted.append(k)
        else:
            rejections.append(rejected(name, found, where))
            rejected_dots.append(k)
    parts = _parts_of(dots, rejected_dots, accepted)
    return points, [r for r, part in zip(rejections, parts, strict=True) if not part]


def _alike(found: Fitted, gates: Gates) -> Fitted | tuple[Rule, float, float]:
    """The target, or the rule that it breaks where the picture shows another code or a flaw."""
    most = _MISFIT_SHARE * gates.misfit
    if found.misfit > most:
        return Rule.CODE, found.misfit, most
    limit = max(_LARGEST_PATCH, _NOISE_PATCHES * found.misfit)
    return (Rule.FIT, found.patch, limit) if found.patch > limit else found


def _parts_of(dots: Dots, rows: Sequence[int], targets: Sequence[int]) -> list[bool]:
    """Which of some dots are marks on the ring of a target, not targets of their own."""
    if not targets:
        return [False] * len(rows)
    own = np.linalg.inv(dots.axes_px[targets])
    away = [own @ (dots.centres_px[k] - dots.centres_px[targets])[..., None] for k in rows]
    return [bool((np.linalg.norm(a[..., 0], axis=1) < RING_QUIET).any()) for a in away]


def mirrored_codes(picture: Picture, dots: Dots, carriers: Sequence[RingCarrier]) -> int:
    """How many dots show the mirror image of a target of the carriers."""
    count = 0
    for bits, carrier in {c.family.bits: c for c in carriers}.items():
        for reading in read_codes(picture.grey, dots, bits):
            count += sure(reading) and carrier.family.mirror_number(reading.word) is not None
    return count


def _families(carriers: Sequence[RingCarrier]) -> set[int]:
    return {c.family.bits for c in carriers}


def _number(carrier: RingCarrier, reading: Reading) -> int | None:
    """The carrier's own target that a reading shows."""
    if not sure(reading):
        return None
    number = carrier.family.number(reading.word)
    return number if number in {p.number for p in carrier.places} else None


def _target(
    picture: Picture,
    carrier: RingCarrier,
    reading: Reading,
    centre_px: Floats,
    axes_px: Floats,
    gates: Gates,
) -> Fitted | tuple[Rule, float, float]:
    radius = float(np.linalg.norm(axes_px, axis=0).min())
    if radius < gates.smallest_dot_px:
        return Rule.SIZE, radius, gates.smallest_dot_px
    bits = carrier.family.bits
    turn = 2.0 * np.pi * reading.phase / bits
    cos, sin = np.cos(turn), np.sin(turn)
    axes = axes_px @ np.array([[cos, -sin], [sin, cos]]) / carrier.dot_radius_mm
    pattern = RingPattern(reading.word, bits, carrier.dot_radius_mm)
    start = localmap.affine_start(centre_px, axes)
    return fit_target(picture, pattern, start, radius, gates)
