"""From pictures of one capture to a cloud, in named steps with a cancel between.

1. Coarse depth of each camera from its best pairs (:mod:`.stereo`), on quarter-size pictures.
2. Patches over all near views on half-size pictures; gaps are grown into from their rims.
3. Which cameras see each piece of surface best; only those measure it in full size.
4. Patches on full-size pictures (:mod:`.depthmaps`).
5. Fusion: agreement between cameras, mean along the normal (:mod:`.fusion`).
6. More patches where points lie thin (:mod:`.between`), fused with the maps of 4.
7. Points that stand off their neighbours' surface go (:mod:`.neighbours`).
8. Each picture is asked whether it shows the surface where it should (:mod:`.agreement`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from common.errors import CancelledError, InputError
from common.progress import (
    CancelToken,
    NeverCancelled,
    Progress,
    ProgressCallback,
    ignore_progress,
)
from evaluation.reconstruction.agreement import Doubt, doubts, pair_agreement
from evaluation.reconstruction.between import filled, gaps, guesses
from evaluation.reconstruction.cloud import Cloud
from evaluation.reconstruction.depthmaps import (
    DepthMap,
    Matching,
    bent,
    coarse_start,
    facing,
    first_slopes,
    grown_start,
    masked,
    merged,
    refined,
    steady,
    upsampled,
)
from evaluation.reconstruction.fusion import FusedPoints, best_references, boldness, fused, joined
from evaluation.reconstruction.neighbours import on_surface
from evaluation.reconstruction.pairs import companions, partners, pixel_ratios, ray_angles_deg
from evaluation.reconstruction.views import View, memory_told
from evaluation.reconstruction.volume import Volume, common_volume
from geometry.arrays import Bools, Floats
from solver.matching import Matching as CanMatch

SHARES = {"coarse": 0.1, "half": 0.35, "full": 0.85, "fusion": 0.95, "surface": 1.0}
"""How far the work has come at the end of each step, measured on seven cameras."""

THIN = 0.8
"""Of the usual density: where points are denser, their grids leave no gaps to speak of."""

LEAST_HELD = 0.05
"""Share of the patches tried that become points: half and more in pictures of one instant, 0.6 %
where three of seven cameras photographed another."""

GAP_STEPS = 2
"""Steps of a patch that begins on the plane of its neighbour: half a pixel and less to go."""

SURE_TIMES, SURE_SIGMAS = 1.5, 4.0
"""Gaps lie beside creases too, where patches err: one in a gap counts when its sigma is at most so
many times the usual one, and the next reference's surface at most so many sigmas off."""


@dataclass(frozen=True)
class ReconstructionOptions:
    """How a reconstruction is made; the defaults suit faces.

    ``references`` cameras measure each piece of surface; ``stride_px`` between the patches of
    the full-size pictures; ``partners`` pairs a camera for coarse depth; ``companions`` views
    beside the reference in a patch. ``stray_mm``: points farther off their neighbours go. A
    place that is farther from all points than ``gap_ratio`` times their usual spacing gets one
    more. Cameras whose rays to the subject meet at more than ``farthest_deg`` are not matched: skin
    looks too different for one patch model; nor are those of which one has pixels more than
    ``largest_ratio`` times as large on the subject. What a camera sees at more than
    ``steepest_deg`` from its normal it does not measure. ``keep_maps`` keeps all depth maps.
    """

    references: int = 3
    partners: int = 2
    companions: int = 4
    stride_px: int = 2
    growth: int = 3
    stray_mm: float = 0.05
    gap_ratio: float = 0.85
    farthest_deg: float = CanMatch().max_angle_deg
    steepest_deg: float = CanMatch().max_incidence_deg
    largest_ratio: float = np.inf
    half: Matching = field(default_factory=lambda: Matching(half_width_samples=4, steps=6))
    full: Matching = field(default_factory=lambda: Matching(half_width_samples=4, steps=5))
    workers: int = 2
    keep_maps: bool = False


@dataclass(frozen=True)
class CameraShare:
    """What one camera contributed: patches tried, measured, and points left after fusion."""

    name: str
    tried: int
    measured: int
    points: int


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """A cloud, the volume it was looked for in, and what each camera gave to it.

    ``doubts``: the cameras whose picture the others speak against. ``maps``: what each camera
    measured before the others were heard, where they were to be kept.
    """

    cloud: Cloud
    volume: Volume
    cameras: tuple[CameraShare, ...]
    doubts: tuple[Doubt, ...] = ()
    maps: tuple[DepthMap, ...] = ()


@dataclass(frozen=True, eq=False)
class _Network:
    """All cameras at three sizes, and who works with whom."""

    full: tuple[View, ...]
    half: tuple[View, ...]
    quarter: tuple[View, ...]
    volume: Volume
    partners: tuple[tuple[int, ...], ...]
    companions: tuple[tuple[int, ...], ...]

    def scale_px_mm(self, number: int, views: Sequence[View]) -> float:
        """Focal length times the longest base to a companion: inverse depth to pixels."""
        here = views[number].pose.position_rig_mm
        bases = [
            np.linalg.norm(views[k].pose.position_rig_mm - here) for k in self.companions[number]
        ]
        return float(views[number].matrix[0, 0] * max(bases))


def reconstruct(
    views: Sequence[View],
    volume: Volume | None = None,
    options: ReconstructionOptions = ReconstructionOptions(),
    progress: ProgressCallback = ignore_progress,
    cancel: CancelToken | None = None,
) -> Reconstruction:
    """The surface that the pictures show, in the rig frame.

    ``volume`` where the subject is; without it the cameras' axes tell. Raises
    :class:`InputError` where fewer than two cameras can work together, or nothing matches;
    :class:`CancelledError` when told to stop.
    """
    with memory_told():
        return _reconstructed(
            _network(views, volume or common_volume(views), options),
            options,
            _Reporter(progress, cancel or NeverCancelled()),
        )


def _reconstructed(
    network: _Network, options: ReconstructionOptions, report: _Reporter
) -> Reconstruction:
    count = len(network.full)
    halves = [_half_map(network, k, options, report) for k in range(count)]
    best = best_references(halves, options.references)
    fulls, tried = [], []
    for k in range(count):
        report.step("full", k, count)
        map_, number = _full_map(network, k, halves[k], best[k], options)
        fulls.append(map_)
        tried.append(number)
    parts = []
    for k in range(count):
        report.step("fusion", k, 2 * count)
        parts.append(_inside(fused(fulls, k), network.volume))
    for k, more in _more(network, fulls, parts, options, report):
        parts[k] = joined([parts[k], more])
    report.step("surface", 0, 1)
    return replace(
        _result(network, fulls, parts, tried, options),
        doubts=_doubts(network, fulls),
        maps=tuple(fulls) if options.keep_maps else (),
    )


def _more(
    network: _Network,
    maps: Sequence[DepthMap],
    parts: Sequence[FusedPoints],
    options: ReconstructionOptions,
    report: _Reporter,
) -> list[tuple[int, FusedPoints]]:
    """Cameras and their points where those that are there, ``parts``, leave gaps."""
    points = joined(parts)
    if len(points.points_mm) == 0:
        return []
    usual = float(np.median(points.per_mm2))
    least_mm = options.gap_ratio / usual**0.5
    how = replace(options.full, steps=GAP_STEPS)
    places, planes = [], []
    for map_, part in zip(maps, parts, strict=True):
        thin = np.zeros(map_.inverse_depth_per_mm.shape, dtype=bool)
        columns, rows = part.pixels[part.per_mm2 < THIN * usual].T // map_.stride_px
        thin[rows, columns] = True
        place, plane = guesses(map_, thin, least_mm)
        places.append(place)
        planes.append(plane)
    found = []
    for k, take in enumerate(gaps(places, points.points_mm, least_mm)):
        report.step("fusion", len(maps) + k, 2 * len(maps))
        if not take.any():
            continue
        others = [network.full[n] for n in network.companions[k]]
        scale = network.scale_px_mm(k, network.full)
        at, plane = places[k].pixels[take], planes[k][take]
        more = filled(maps[k], others, at, plane, how, scale, options.steepest_deg)
        made = _inside(fused(maps, k, more), network.volume)
        sure = made.sigma_mm <= SURE_TIMES * float(np.median(points.sigma_mm))
        found.append((k, made.subset(sure & (np.abs(made.apart) <= SURE_SIGMAS))))
    return found


def _doubts(network: _Network, maps: Sequence[DepthMap]) -> tuple[Doubt, ...]:
    pairs = [
        pair_agreement(maps, k, other, network.full[other])
        for k in range(len(maps))
        for other in network.companions[k]
    ]
    return doubts([p for p in pairs if p is not None], [v.name for v in network.full])


class _Reporter:
    """Tells how far the work is, and stops it when told to."""

    def __init__(self, progress: ProgressCallback, cancel: CancelToken) -> None:
        self._progress, self._cancel = progress, cancel
        self._names = tuple(SHARES)

    def step(self, name: str, number: int, count: int) -> None:
        """Step ``name`` begins its part ``number`` of ``count``."""
        if self._cancel.is_set():
            raise CancelledError
        index = self._names.index(name)
        begin = SHARES[self._names[index - 1]] if index else 0.0
        fraction = begin + (SHARES[name] - begin) * number / count
        self._progress(Progress(name, fraction))


def _network(views: Sequence[View], volume: Volume, options: ReconstructionOptions) -> _Network:
    alike = pixel_ratios(views, volume) <= options.largest_ratio
    angles = np.where(alike, ray_angles_deg(views, volume), np.inf)
    count = len(views)
    pairs = tuple(partners(angles, k, options.partners, options.farthest_deg) for k in range(count))
    near = tuple(
        companions(angles, k, options.companions, options.farthest_deg) for k in range(count)
    )
    if not any(pairs):
        ratio = options.largest_ratio
        like = f", with pixels at most {ratio:g} times as large" if np.isfinite(ratio) else ""
        raise InputError(
            "cameras-apart",
            "no two cameras see the subject from directions less than "
            f"{options.farthest_deg:g} degrees apart{like}",
            "give more cameras, or cameras that stand nearer to one another",
        )
    half = tuple(v.reduced() for v in views)
    return _Network(tuple(views), half, tuple(v.reduced() for v in half), volume, pairs, near)


def _half_map(
    network: _Network, k: int, options: ReconstructionOptions, report: _Reporter
) -> DepthMap:
    """The map of one camera on half-size pictures."""
    count = len(network.full)
    report.step("coarse", k, count)
    view, others = network.half[k], [network.half[n] for n in network.companions[k]]
    quarter = network.quarter[k]
    coarse = coarse_start(
        quarter, [network.quarter[n] for n in network.partners[k]], network.volume
    )
    smooth, slopes = first_slopes(coarse.astype(np.float64), 1.0)
    start, slope = _doubled(smooth, slopes, view, options.half.stride_px)
    if not others:
        return refined_none(view, start.shape, options.half.stride_px)
    scale = network.scale_px_mm(k, network.half)
    report.step("half", k, count)
    found = refined(view, others, start, slope, options.half.stride_px, options.half)
    found = masked(found, steady(found, 2.0, scale))
    for _ in range(2):
        gaps, slope = grown_start(found, options.growth)
        more = refined(view, others, gaps, slope, options.half.stride_px, options.half)
        found = merged(found, more)
        found = masked(found, steady(found, 2.0, scale))
    return found


def _doubled(value: Floats, slopes: Floats, view: View, stride_px: int) -> tuple[Floats, Floats]:
    """Values and slopes of half-size pixels at the grid of the next size up."""
    h, w = -(-view.grey.shape[0] // stride_px), -(-view.grey.shape[1] // stride_px)
    rows, columns = np.mgrid[0:h, 0:w] * float(stride_px)
    y = np.clip(np.rint((rows - 0.5) / 2.0), 0, value.shape[0] - 1).astype(np.int64)
    x = np.clip(np.rint((columns - 0.5) / 2.0), 0, value.shape[1] - 1).astype(np.int64)
    return value[y, x], slopes[y, x] / 2.0


def refined_none(view: View, shape: tuple[int, ...], stride_px: int) -> DepthMap:
    """The map of a camera that nobody can be matched with: nothing anywhere."""
    nothing = np.full(shape, np.nan)
    return DepthMap(
        view,
        stride_px,
        nothing,
        np.full((*shape, 2), np.nan),
        nothing,
        nothing.astype(np.float32),
        np.zeros(shape, dtype=np.int8),
    )


def _full_map(
    network: _Network, k: int, half: DepthMap, best: Bools, options: ReconstructionOptions
) -> tuple[DepthMap, int]:
    """The map of one camera on full-size pictures, and how many patches were tried."""
    view, others = network.full[k], [network.full[n] for n in network.companions[k]]
    stride = options.stride_px
    shape = (-(-view.grey.shape[0] // stride), -(-view.grey.shape[1] // stride))
    if not others or not best.any():
        return refined_none(view, shape, stride), 0
    start, slopes = upsampled(half, best, shape, stride)
    found = refined(view, others, start, slopes, stride, options.full)
    keep = steady(found, 2.0, network.scale_px_mm(k, network.full))
    keep &= facing(found, options.steepest_deg)
    found = bent(masked(found, keep), options.full.half_width_samples)
    return found, int(np.isfinite(start).sum())


def _inside(points: FusedPoints, volume: Volume) -> FusedPoints:
    """Without what is outside the volume: the backdrop matches as well as skin does."""
    offset = points.points_mm - volume.centre_rig_mm
    return points.subset(np.linalg.norm(offset, axis=1) <= volume.radius_mm)


def require_agreement(points: int, tried: int) -> None:
    """Raises :class:`InputError` where too few of the patches tried became points."""
    if points == 0:
        raise InputError(
            "nothing-matched",
            "no surface could be matched in these pictures",
            "check that they are of one capture, sharp, not black, and of these cameras",
        )
    if points < LEAST_HELD * tried:
        raise InputError(
            "pictures-contradict",
            f"the pictures contradict one another: of {tried:,} places {points:,} hold in others",
            "check that all are of one capture, and that the cameras stand as calibrated",
        )


def _result(
    network: _Network,
    maps: Sequence[DepthMap],
    parts: Sequence[FusedPoints],
    tried: Sequence[int],
    options: ReconstructionOptions,
) -> Reconstruction:
    points = np.concatenate([p.points_mm for p in parts])
    require_agreement(len(points), sum(tried))
    normals = np.concatenate([p.normals for p in parts])
    sigma = np.concatenate([p.sigma_mm for p in parts])
    # What the normal equations cannot know shows in how far the cameras' surfaces lie apart.
    sigma *= boldness(points, np.concatenate([p.apart for p in parts]))
    owner = np.repeat(np.arange(len(parts)), [len(p.points_mm) for p in parts])
    keep = on_surface(points, normals, sigma, options.stray_mm, options.workers)
    colours = np.concatenate([p.colours for p in parts])
    cloud = Cloud(
        points[keep],
        normals[keep],
        colours[keep],
        sigma[keep],
        np.concatenate([p.views for p in parts])[keep].astype(np.uint8),
    )
    left = np.bincount(owner[keep], minlength=len(parts))
    cameras = tuple(
        CameraShare(
            v.name, tried[k], int(np.isfinite(maps[k].inverse_depth_per_mm).sum()), int(left[k])
        )
        for k, v in enumerate(network.full)
    )
    return Reconstruction(cloud, network.volume, cameras)
