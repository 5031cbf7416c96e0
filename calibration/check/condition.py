"""Whether pictures are fit to be checked: missing, of another size, soft, or half blind.

These come before any movement: of a camera that is out of focus nobody can say that it moved, and
dirt on a lens shifts image points as no movement does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from calibration.adjustment.camera import CalibratedCamera
from calibration.adjustment.finite import finite_rows
from calibration.adjustment.initialisation.views import Placements, spread_rank
from calibration.adjustment.result import Calibration
from calibration.check import messages
from calibration.check.verdicts import Finding, Kind
from calibration.detection.detections import PictureProblem
from calibration.detection.unseen import MIRRORED, UNPAIRED
from calibration.observations import Observations
from common.errors import InputError
from geometry.arrays import Bools, Floats, Ints

LEAST_POINTS = 8
LEAST_CAMERAS = 2
PLANE = 2
"""Directions that targets must spread over for one camera to tell how they stand."""

ADDED_PX = 1.0
"""Blur that is added to that of the reference, in squares: less is a day's light and distance."""

SOFT_POINTS = 0.05
"""Share of a camera's targets that are soft while the others are sharp, from which it is told."""

LOST = 0.4
ENOUGH = 20
"""A camera with this many points in the reference should see as many as the others do, or nearly;
a smaller share is told."""


ALONE = "shows nothing that another camera sees"


@dataclass(frozen=True, eq=False)
class Condition:
    """What is wrong with pictures, and which observations (n,) may take part in a check.

    ``checkable``: whether what may take part is a check at all. Otherwise all are kept, for their
    figures, and nothing else is to be said.
    """

    findings: tuple[Finding, ...]
    keep: Bools
    checkable: bool

    @property
    def cameras(self) -> frozenset[str]:
        """Cameras about which nothing else is to be said."""
        return frozenset(name for f in self.findings for name in f.subjects)


def condition_of(
    reference: Calibration,
    observations: Observations,
    problems: Mapping[str, PictureProblem] | None = None,
) -> Condition:
    """The state of each camera's pictures against the reference's.

    ``problems``: cameras whose pictures could not be used, and why.

    Raises :class:`InputError` when no two cameras see a carrier in one place.
    """
    told = dict(problems or {})
    found = [_unusable(c.name, told[c.name]) for c in reference.cameras if c.name in told]
    keep = np.ones(len(observations.pixel), bool)
    index = {name: k for k, name in enumerate(observations.cameras)}
    counts = np.bincount(observations.camera, minlength=len(observations.cameras))
    points = np.array([counts[index[c.name]] if c.name in index else 0 for c in reference.cameras])
    named = tuple(zip((c.name for c in reference.cameras), points, strict=True))
    gone = tuple(name for name, n in named if n == 0 and name not in told)
    if gone:
        found.append(Finding(Kind.CAMERA_MISSING, gone, messages.missing(gone)))
    few = tuple(name for name, n in named if 0 < n < LEAST_POINTS)
    if few:
        found.append(Finding(Kind.CANNOT_TELL, few, messages.few(few, LEAST_POINTS)))
        keep &= ~np.isin(observations.camera, [index[name] for name in few])
    resized = [f for c in reference.cameras if (f := _other_size(c, observations, index))]
    found += resized
    others = {name for f in resized for name in f.subjects}
    keep &= ~np.isin(observations.camera, [index[name] for name in others])
    for k, camera in enumerate(reference.cameras):
        if points[k] < LEAST_POINTS or camera.name in others:
            continue
        own = observations.camera == index[camera.name]
        soft, more = _softness(camera.name, float(reference.blur_px[k]), observations, own)
        if more is not None:
            found.append(more)
            keep &= ~soft
    blamed = {name for f in found for name in f.subjects}
    found += [f for f in _half_blind(reference, points) if not blamed & set(f.subjects)]
    return _tied(observations, found, keep)


def _unusable(camera: str, problem: PictureProblem) -> Finding:
    """What detection told of a camera, as a finding."""
    if problem.code == MIRRORED:
        return Finding(Kind.LENS_CHANGED, (camera,), messages.mirrored(camera), value=-1.0)
    if problem.code == UNPAIRED:
        sentence = messages.unpaired(problem.problem, problem.remedy)
        return Finding(Kind.UNSYNCHRONISED, (camera,), sentence)
    sentence = messages.unseeing(camera, problem.problem, problem.remedy)
    return Finding(Kind.CAMERA_MISSING, (camera,), sentence)


def _tied(observations: Observations, found: list[Finding], keep: Bools) -> Condition:
    """The condition without cameras that nothing ties to the others."""
    alone = _alone(observations, keep, LEAST_POINTS)
    kept = keep & ~np.isin(observations.camera, list(alone))
    # What is left must still be a check: two cameras at the least.
    checkable = len(np.unique(observations.camera[kept])) >= LEAST_CAMERAS
    if not checkable:
        alone = _alone(observations, np.ones_like(keep), 1)
        kept = ~np.isin(observations.camera, list(alone))
    if len(observations.pixel) and not kept.any() and len(alone) >= LEAST_CAMERAS:
        raise InputError(
            "check-alone",
            "no two cameras see a carrier at the same time",
            "give pictures of one instant one name, and show the targets to two cameras at once",
        )
    blamed = {name for f in found if f.kind is not Kind.TARGETS_LOST for name in f.subjects}
    names = tuple(observations.cameras[k] for k in sorted(alone))
    names = tuple(name for name in names if name not in blamed)
    if names:
        alone_found = Finding(Kind.CANNOT_TELL, names, messages.alone(names), state=ALONE)
        found = [alone_found, *found]
    return Condition(tuple(found), kept & ~_floating(observations, kept), checkable)


def _floating(observations: Observations, keep: Bools) -> Bools:
    """Rows (n,) of bars where one camera alone sees them: nothing tells how they stand."""
    known = [c.nominal_mm[finite_rows(c.nominal_mm)] for c in observations.targets.carriers]
    bar = np.array([len(points) > 0 and spread_rank(points) < PLANE for points in known])
    place = Placements.of(observations).of_row
    return np.asarray(
        bar[observations.targets.carrier_of[observations.target]]
        & ~np.isin(place, _shared(place[keep], observations.camera[keep]))
    )


def _shared(place: Ints, camera: Ints) -> Ints:
    """The places that two cameras see at least."""
    seen = np.unique(np.stack([place, camera]), axis=1)
    return np.flatnonzero(np.bincount(seen[0]) >= LEAST_CAMERAS)


def _alone(observations: Observations, keep: Bools, least: int) -> set[int]:
    """Cameras that see less than ``least`` targets of carriers that another sees as they stand.

    Their places would follow them wherever they moved: no test could tell.
    """
    place, out = Placements.of(observations).of_row, set[int]()
    while True:
        rows = keep & ~np.isin(observations.camera, list(out))
        shared = np.isin(place, _shared(place[rows], observations.camera[rows])) & rows
        cameras = np.unique(observations.camera[rows])
        more = {int(k) for k in cameras if (observations.camera[shared] == k).sum() < least}
        if not more:
            return out
        out |= more


def unexplained(before: tuple[Finding, ...], pictures: tuple[Finding, ...]) -> tuple[Finding, ...]:
    """What was told before, without what follows from mirrored ``pictures``: targets not read."""
    flipped = {name for f in pictures if is_mirrored(f) for name in f.subjects}
    return tuple(
        f for f in before if f.kind is not Kind.TARGETS_LOST or not flipped & set(f.subjects)
    )


def is_mirrored(finding: Finding) -> bool:
    """Whether a finding says that pictures are mirrored."""
    return finding.kind is Kind.LENS_CHANGED and finding.value == -1.0


def _other_size(
    camera: CalibratedCamera, observations: Observations, index: Mapping[str, int]
) -> Finding | None:
    """What there is to say of a camera whose pictures have another size than in the reference."""
    if camera.name not in index:
        return None
    width, height = (int(v) for v in observations.image_size_px[index[camera.name]])
    if (width, height) == camera.image_size_px:
        return None
    if (height, width) == camera.image_size_px:
        sentence = messages.on_its_side(camera.name, (width, height), camera.image_size_px)
        state = "turned"
    else:
        sentence = messages.other_size(camera.name, (width, height), camera.image_size_px)
        state = "pictures of another size"
    ratio = width / camera.image_size_px[0]
    return Finding(Kind.LENS_CHANGED, (camera.name,), sentence, value=ratio, state=state)


def _softness(
    name: str, before_px: float, observations: Observations, own: Bools
) -> tuple[Bools, Finding | None]:
    """Rows (n,) of a camera that are soft, and what there is to say of them."""
    blur = np.where(own, observations.blur_px, np.nan)
    nothing = np.zeros(len(own), bool)
    if not np.isfinite(before_px) or not np.isfinite(blur).any():
        return nothing, None
    limit = float(np.hypot(before_px, ADDED_PX))
    middle = float(np.nanmedian(blur))
    if middle > limit:
        sentence = messages.blurred(name, middle, before_px)
        return own, Finding(Kind.BLURRED, (name,), sentence, value=middle / before_px)
    soft = np.nan_to_num(blur) > np.hypot(max(middle, before_px), 1.5 * ADDED_PX)
    share = float(soft.sum() / own.sum())
    if share < SOFT_POINTS or soft.sum() < 3:
        return nothing, None
    sentence = messages.partly_blurred(name, share)
    return soft, Finding(Kind.BLURRED, (name,), sentence, value=share)


def _half_blind(reference: Calibration, points: Floats) -> list[Finding]:
    """Cameras that lost most of their targets while the others did not."""
    before = np.array([c.points for c in reference.quality.cameras], np.float64)
    enough = (before >= ENOUGH) & (points > 0)
    if enough.sum() < LEAST_CAMERAS + 1:
        return []
    ratio = np.where(enough, points / np.maximum(before, 1.0), np.nan)
    share = ratio / np.nanmedian(ratio)
    return [
        Finding(
            Kind.TARGETS_LOST,
            (reference.cameras[k].name,),
            messages.lost(reference.cameras[k].name, float(share[k])),
            value=float(share[k]),
        )
        for k in np.flatnonzero(np.nan_to_num(share, nan=1.0) < LOST)
    ]
