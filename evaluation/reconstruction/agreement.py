"""Whether every camera tells the same story: where the surface found is seen in each picture.

Matching moves patches along the epipolar lines only. When the surface is there, each patch may
shift freely in each other picture: a median shift that is not 0 says that a camera is not where its
calibration has it. The same patches tell a picture that is blurred, darker, or of something else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from evaluation.reconstruction.depthmaps import DepthMap, relations
from evaluation.reconstruction.views import Singles, View
from geometry.arrays import Floats

SHIFT_PX = 0.2
"""Cameras with known poses agree to 0.02 px, calibrated ones to 0.1 px."""
LEAST_ALIKE = 0.4
"""Share of the patches that look alike in two pictures of one instant: 0.8 and more as a rule."""
LEAST_CONTRAST = 0.75
LEAST_BRIGHTNESS = 0.65
"""Coded values: two stops less light leave 0.54 of them."""

_HALF = 7
_PATCHES = 400
_FEWEST = 50
_CORRELATION = 0.5
_BLUR_PX = 1.0
"""So that a shift of one pixel is still within reach of the grey values' slopes."""


@dataclass(frozen=True)
class PairAgreement:
    """How patches of ``reference`` look in ``other``.

    ``shift_px`` (x, y) median; ``alike`` share that correlates; ``contrast`` and ``brightness`` of
    the other's patches over the reference's, medians.
    """

    reference: int
    other: int
    shift_px: tuple[float, float]
    alike: float
    contrast: float
    brightness: float


@dataclass(frozen=True)
class Doubt:
    """What speaks against one camera: ``kind`` moved, foreign, blurred or dark, and in words."""

    camera: str
    kind: str
    words: str


def pair_agreement(
    maps: Sequence[DepthMap], reference: int, other: int, view: View
) -> PairAgreement | None:
    """How the surface of map ``reference`` looks in ``view``; None where it hardly shows."""
    map_ = maps[reference]
    rows, columns = np.nonzero(np.isfinite(map_.inverse_depth_per_mm))
    few = np.linspace(0, len(rows) - 1, min(_PATCHES, len(rows))).astype(np.int64)
    u, v = columns[few] * map_.stride_px, rows[few] * map_.stride_px
    height, width = map_.reference.grey.shape
    inner = (u >= _HALF) & (v >= _HALF) & (u < width - _HALF) & (v < height - _HALF)
    rows, columns, u, v = rows[few][inner], columns[few][inner], u[inner], v[inner]
    px, py = _places(map_, rows, columns, view)
    j, i = (g.ravel() for g in np.mgrid[-_HALF : _HALF + 1, -_HALF : _HALF + 1])
    mine = map_.reference.grey[v[:, None] + j, u[:, None] + i]
    border = 2.0
    shown = (px > border).all(axis=1) & (py > border).all(axis=1)
    shown &= (px < view.size_px[0] - border).all(axis=1)
    shown &= (py < view.size_px[1] - border).all(axis=1)
    if shown.sum() < _FEWEST:
        return None
    mine, px, py = mine[shown], px[shown], py[shown]
    theirs = _sampled(view.grey, px, py)
    correlation = _correlation(mine, theirs)
    alike = correlation > _CORRELATION
    bright = float(np.median(theirs.mean(axis=1) / np.maximum(mine.mean(axis=1), 1e-6)))
    shift, contrast = (0.0, 0.0), 1.0
    if alike.sum() >= _FEWEST:
        shift = _shift(map_.reference, view, (u[shown], v[shown], i, j), (px, py), alike)
        ratio = _waves(theirs) / np.maximum(_waves(mine), 1e-9)
        contrast = float(np.median(ratio[alike])) / max(bright, 1e-6)
    return PairAgreement(reference, other, shift, float(alike.mean()), contrast, bright)


def _places(
    map_: DepthMap, rows: np.ndarray, columns: np.ndarray, view: View
) -> tuple[Singles, Singles]:
    """Where the pixels of the patches are in ``view``, (N, P) each."""
    (matrix,), (shift,) = relations(map_.reference, [view])
    j, i = (g.ravel() for g in np.mgrid[-_HALF : _HALF + 1, -_HALF : _HALF + 1])
    slope = map_.slopes[rows, columns]
    rho = map_.inverse_depth_per_mm[rows, columns][:, None] + slope[:, :1] * i + slope[:, 1:] * j
    pixel = np.stack(
        [
            columns[:, None] * map_.stride_px + i,
            rows[:, None] * map_.stride_px + j,
            np.ones_like(rho),
        ],
        axis=-1,
    )
    image = pixel @ matrix.T + rho[..., None] * shift
    depth = image[..., 2]
    # Behind the camera nothing is seen: such a place lies outside of its picture.
    plain = (
        np.where((depth > 0.0)[..., None], image, -1.0)
        / np.where(depth > 0.0, depth, 1.0)[..., None]
    )
    return plain[..., 0].astype(np.float32), plain[..., 1].astype(np.float32)


def _sampled(grey: Singles, px: Singles, py: Singles) -> Singles:
    return np.asarray(cv2.remap(grey, px, py, cv2.INTER_LINEAR), dtype=np.float32)


def _centred(values: Singles) -> Singles:
    return np.asarray(values - values.mean(axis=1, keepdims=True))


def _correlation(a: Singles, b: Singles) -> Floats:
    a, b = _centred(a), _centred(b)
    both = np.sqrt((a**2).sum(axis=1) * (b**2).sum(axis=1))
    return np.asarray((a * b).sum(axis=1) / np.maximum(both, 1e-12))


def _waves(values: Singles) -> Floats:
    """What changes within three pixels, rms per patch (N,): what a blur takes first."""
    side = 2 * _HALF + 1
    square = values.reshape(-1, side, side)
    local = (square[:, 1:-1, 1:-1] * 2 - square[:, :-2, 1:-1] - square[:, 2:, 1:-1]) ** 2
    local = local + (square[:, 1:-1, 1:-1] * 2 - square[:, 1:-1, :-2] - square[:, 1:-1, 2:]) ** 2
    return np.asarray(np.sqrt(local.mean(axis=(1, 2))))


def _shift(
    reference: View,
    view: View,
    patch: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    at: tuple[Singles, Singles],
    alike: np.ndarray,
) -> tuple[float, float]:
    """The median shift of the patches that look alike: one step of least squares each."""
    u, v, i, j = patch
    smooth, other = (
        np.asarray(cv2.GaussianBlur(picture.grey, (0, 0), _BLUR_PX), np.float32)
        for picture in (reference, view)
    )
    dy, dx = np.gradient(other)
    mine = _centred(smooth[v[alike][:, None] + j, u[alike][:, None] + i])
    px, py = at[0][alike], at[1][alike]
    theirs = _centred(_sampled(other, px, py))
    gain = (mine * theirs).sum(axis=1) / np.maximum((theirs**2).sum(axis=1), 1e-12)
    gx, gy = (
        _centred(_sampled(np.asarray(g, np.float32), px, py)) * gain[:, None] for g in (dx, dy)
    )
    off = mine - gain[:, None] * theirs
    xx, yy, xy = (gx**2).sum(axis=1), (gy**2).sum(axis=1), (gx * gy).sum(axis=1)
    bx, by = (gx * off).sum(axis=1), (gy * off).sum(axis=1)
    det = np.maximum(xx * yy - xy**2, 1e-18)
    return (
        float(np.median((yy * bx - xy * by) / det)),
        float(np.median((xx * by - xy * bx) / det)),
    )


def doubts(pairs: Sequence[PairAgreement], names: Sequence[str]) -> tuple[Doubt, ...]:
    """The cameras that the others speak against, the worst first; each named once.

    A camera is judged by the median over all pairs it is part of, and then left out of the
    judgement of the others: in a pair of two, one of them is to blame.
    """
    left, found = list(pairs), []
    for words in (_foreign, _moved, _blurred, _dark):
        while True:
            told = words(left, names)
            if told is None:
                break
            number, doubt = told
            found.append(doubt)
            left = [p for p in left if number not in (p.reference, p.other)]
    return tuple(found)


def _worst(
    pairs: Sequence[PairAgreement], values: Sequence[tuple[float, float]]
) -> tuple[int, float] | None:
    """The camera whose median is lowest; ``values`` of each pair for its reference and other."""
    by: dict[int, list[float]] = {}
    for pair, (reference, other) in zip(pairs, values, strict=True):
        by.setdefault(pair.reference, []).append(reference)
        by.setdefault(pair.other, []).append(other)
    # With one pair nobody can say which of the two it is.
    scores = {k: float(np.median(v)) for k, v in by.items() if len(v) >= 2}
    if not scores:
        return None
    number = min(scores, key=lambda k: scores[k])
    return number, scores[number]


Found = tuple[int, Doubt] | None


def _foreign(pairs: Sequence[PairAgreement], names: Sequence[str]) -> Found:
    worst = _worst(pairs, [(p.alike, p.alike) for p in pairs])
    if worst is None or worst[1] >= LEAST_ALIKE:
        return None
    return worst[0], Doubt(
        names[worst[0]],
        "foreign",
        f"{names[worst[0]]} shows something else than the others: {100 * worst[1]:.0f} % of its "
        "patches look alike. Is its picture of the same instant, sharp, and not black?",
    )


def _moved(pairs: Sequence[PairAgreement], names: Sequence[str]) -> Found:
    off = [-float(np.hypot(*p.shift_px)) for p in pairs]
    worst = _worst(pairs, [(o, o) for o in off])
    if worst is None or -worst[1] <= SHIFT_PX:
        return None
    return worst[0], Doubt(
        names[worst[0]],
        "moved",
        f"{names[worst[0]]} disagrees with the others by {-worst[1]:.1f} px: it has moved since it "
        "was calibrated. Check the rig, or leave its picture out.",
    )


def _blurred(pairs: Sequence[PairAgreement], names: Sequence[str]) -> Found:
    # Reading between pixels takes fine contrast from every pair's other: the same of each.
    usual = float(np.median([p.contrast for p in pairs])) if pairs else 1.0
    ratio = [max(p.contrast / usual, 1e-6) for p in pairs]
    worst = _worst(pairs, [(1.0 / r, r) for r in ratio])
    if worst is None or worst[1] >= LEAST_CONTRAST:
        return None
    return worst[0], Doubt(
        names[worst[0]],
        "blurred",
        f"{names[worst[0]]} is less sharp than the others: its fine contrast is "
        f"{100 * worst[1]:.0f} % of theirs.",
    )


def _dark(pairs: Sequence[PairAgreement], names: Sequence[str]) -> Found:
    worst = _worst(pairs, [(1.0 / max(p.brightness, 1e-6), p.brightness) for p in pairs])
    if worst is None or worst[1] >= LEAST_BRIGHTNESS:
        return None
    return worst[0], Doubt(
        names[worst[0]],
        "dark",
        f"{names[worst[0]]} is darker than the others: it has {100 * worst[1]:.0f} % of their grey "
        "values.",
    )
