"""The middle of a target carrier in a picture: what is put where a camera is to look."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from calibration.detection.detections import Detections
from calibration.detection.gates import Rule
from calibration.detection.opencv import homography
from calibration.observations import Carrier
from calibration.targets.kinds import TargetPlan
from geometry.arrays import Floats

FEWEST = 4
"""Points of a plane that say where all others are in a picture of it."""

FLAT_MM = 0.5
"""Targets of one side lie in a plane to this."""


WITHIN_PX = 3.0
"""Points that lie farther from where the others of their plane say are left out."""

ON_A_LINE = 0.02
"""Places whose spread across is a smaller share of that along count as on one line."""


_TOO_COARSE = (Rule.FIT, Rule.BLUR, Rule.CONTRAST, Rule.SATURATION)
"""Known for what they are, and to about a pixel: enough to aim by, when a lens is not in focus."""


@dataclass(frozen=True)
class Middle:
    """Where the middle of a carrier's targets is in a picture."""

    carrier: str
    pixel: tuple[float, float]


def middle_of(detections: Detections, plan: TargetPlan) -> Middle | None:
    """The middle of the carrier that most of is seen; None where no carrier's can be told.

    Of a flat carrier four targets are enough, of a carrier with one target that one.
    """
    places = {r.target: r.pixel for r in detections.rejections if r.rule in _TOO_COARSE}
    places |= dict(zip(detections.ids, map(tuple, detections.pixel), strict=True))
    found = []
    for carrier in plan.target_set().carriers:
        seen = {name: places[name] for name in carrier.ids if name in places}
        pixel = _middle(seen, carrier)
        if pixel is not None:
            found.append((len(seen), Middle(carrier.name, (float(pixel[0]), float(pixel[1])))))
    return max(found, key=lambda one: one[0])[1] if found else None


def _middle(pixels: Mapping[str, tuple[float, ...]], carrier: Carrier) -> Floats | None:
    if not pixels:
        return None
    if len(carrier.ids) == 1:
        return np.array(pixels[carrier.ids[0]])
    places = carrier.nominal_mm
    if not np.isfinite(places).all():
        return None
    seen = places[[carrier.ids.index(name) for name in pixels]]
    side = np.abs(places[:, 2] - seen[0, 2]) < FLAT_MM
    if len(pixels) < FEWEST or np.ptp(seen[:, 2]) > FLAT_MM or not _spread(seen[:, :2]):
        return None
    fitted = homography(seen[:, :2], np.array(list(pixels.values())), WITHIN_PX)
    if fitted is None:
        return None
    middle = np.append(places[side, :2].mean(axis=0), 1.0)
    x, y, scale = fitted[0] @ middle
    return np.array([x / scale, y / scale])


def _spread(places_mm: Floats) -> bool:
    """Whether no line holds all but one of the places (n, 2): those say nothing of the rest."""
    for k in range(len(places_mm)):
        rest = np.delete(places_mm, k, axis=0)
        sizes = np.linalg.svd(rest - rest.mean(axis=0), compute_uv=False)
        if sizes[1] < ON_A_LINE * sizes[0]:
            return False
    return True
