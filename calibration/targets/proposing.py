"""Which targets a rig needs: sizes from the pictures, places from what each camera sees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.observations import Distance
from calibration.targets.kinds import (
    RING_QUIET,
    CarrierKind,
    CharucoPlate,
    RingCarrier,
    TargetPlace,
    TargetPlan,
)
from calibration.targets.ringcodes import RingCodeFamily
from calibration.targets.sheets import scale_bar
from common.errors import InputError
from geometry.arrays import Bools, Floats, Ints
from geometry.camera import RigCamera

DOT_RADIUS_PX, LARGEST_DOT_PX = 5.0, 30.0
"""A dot's smaller radius where it is smallest, and its larger one where it is largest."""

MODULE_PX = 4.0
LARGEST_INCIDENCE_DEG = 60.0
SMALLEST_PRINTED_RADIUS_MM = 1.5
"""Below this the printer's own pixels show."""

_BARS = 3
_CELLS = 3
_PLATE_DICTIONARY = "DICT_5X5_1000"


@dataclass(frozen=True)
class SeenByCamera:
    """What one camera sees of the stand: how many targets, in how many of nine picture cells.

    ``radius_px``: smallest and largest radius of their dots, as they appear slanted.
    """

    camera: str
    targets: int
    cells: int
    radius_px: tuple[float, float]


@dataclass(frozen=True)
class Proposal:
    """A target set for a rig, what each camera sees of it, and what could not be had."""

    plan: TargetPlan
    cameras: tuple[SeenByCamera, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Sights:
    """Candidates as cameras see them: ``seen`` (cameras, n), ``cell`` and slanted radii alike."""

    seen: Bools
    cell: Ints
    smaller_px: Floats
    larger_px: Floats


def propose_targets(
    cameras: Sequence[RigCamera],
    centre_rig_mm: Floats,
    size_mm: Floats,
    *,
    per_camera: int = 12,
    name: str = "targets",
) -> Proposal:
    """Targets for a rig and a subject that fills a box of ``size_mm`` (3,) about a centre (3,).

    Ring targets on a stand round the subject, each facing the cameras, so many that every camera
    sees ``per_camera`` of them past the subject, spread over its picture; three scale bars and a
    ChArUco plate to be held where the subject will be. Raises :class:`InputError` when there are
    no cameras or the subject has no size.
    """
    size, centre = np.asarray(size_mm, dtype=np.float64), np.asarray(centre_rig_mm)
    if not cameras or size.shape != (3,) or not (np.isfinite(size) & (size > 0.0)).all():
        raise InputError(
            "propose", "there are no cameras, or the subject has no size", "give a design of both"
        )
    pixel_mm = _pixel_sizes(cameras, centre)
    tilt = np.cos(np.radians(LARGEST_INCIDENCE_DEG))
    radius = max(DOT_RADIUS_PX * float(pixel_mm.max()) / tilt, SMALLEST_PRINTED_RADIUS_MM)
    radius = float(np.ceil(2.0 * radius) / 2.0)
    notes = []
    if radius / pixel_mm.min() > LARGEST_DOT_PX:
        notes.append(
            f"dots of {radius:g} mm are {radius / pixel_mm.min():.0f} px large in the nearest "
            f"camera, more than {LARGEST_DOT_PX:.0f}: the cameras differ much in scale"
        )
    places, normals = _candidates(cameras, centre, size, RING_QUIET * radius)
    sights = _sights(cameras, places, normals, radius, centre, size)
    chosen = _choose(sights, places, 2.1 * RING_QUIET * radius, per_camera)
    seen = _summary(cameras, sights, chosen)
    notes += [
        f"camera {s.camera} sees {s.targets} targets of the stand, fewer than {per_camera}"
        for s in seen
        if s.targets < per_camera
    ]
    plan, more = _plan(name, places[chosen], radius, size, float(pixel_mm.max()))
    return Proposal(plan, seen, (*notes, *more))


def _pixel_sizes(cameras: Sequence[RigCamera], centre: Floats) -> Floats:
    """Millimetres per pixel at the subject, (cameras,)."""
    depth = [float(c.pose.to_camera(centre[None])[0, 2]) for c in cameras]
    for camera, z in zip(cameras, depth, strict=True):
        if z <= 0.0:
            raise InputError(
                "propose-behind",
                f"the subject is behind camera {camera.name}",
                "give the place of the subject that the design is for",
            )
    return np.array([z / c.camera.focal_length_px for c, z in zip(cameras, depth, strict=True)])


def _candidates(
    cameras: Sequence[RigCamera], centre: Floats, size: Floats, paper_mm: float
) -> tuple[Floats, Floats]:
    """Places (n, 3) on frames round the subject, and unit normals (n, 3) towards the cameras."""
    turn = 2.0 * np.pi * (np.arange(28) + 0.5) / 28.0
    square = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    square = square / np.abs(square).max(axis=1, keepdims=True)
    out = []
    for scale in (1.0, 1.25, 1.6, 2.2, 3.2):
        for depth in (-0.1, 0.2, 0.5):
            half = size[[0, 2]] / 2.0 * scale + paper_mm
            frame = square * half
            layer = np.column_stack(
                [frame[:, 0], np.full(len(frame), depth * size[1]), frame[:, 1]]
            )
            out.append(layer)
    places = centre + np.concatenate(out)
    middle = np.mean([c.pose.position_rig_mm for c in cameras], axis=0)
    normals = middle - places
    return places, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _sights(
    cameras: Sequence[RigCamera],
    places: Floats,
    normals: Floats,
    radius_mm: float,
    centre: Floats,
    size: Floats,
) -> _Sights:
    rows = [_sight(c, places, normals, radius_mm, centre, size) for c in cameras]
    seen, cell, smaller, larger = (np.array([r[k] for r in rows]) for k in range(4))
    return _Sights(seen, cell, smaller, larger)


def _sight(
    camera: RigCamera,
    places: Floats,
    normals: Floats,
    radius_mm: float,
    centre: Floats,
    size: Floats,
) -> tuple[Bools, Ints, Floats, Floats]:
    """Of one camera: which places it sees, in which cell, and the slanted radii."""
    pixels, depth = camera.camera.project(camera.pose, places)
    width, height = camera.camera.image_size_px
    larger = radius_mm * camera.camera.focal_length_px / np.maximum(depth, 1.0)
    away = camera.pose.position_rig_mm - places
    cos = np.einsum("ni,ni->n", normals, away) / np.linalg.norm(away, axis=1)
    margin = (RING_QUIET * larger + 5.0)[:, None]
    whole = np.nan_to_num(pixels, nan=-1e9)
    seen = ((whole > margin) & (whole < np.array([width, height]) - margin)).all(axis=1)
    seen &= (cos > np.cos(np.radians(LARGEST_INCIDENCE_DEG))) & (depth > 0.0)
    seen &= ~_hidden(camera.pose.position_rig_mm, places, centre, size)
    share = np.clip(whole / np.array([width, height]), 0.0, 1.0 - 1e-9)
    cell = (share * _CELLS).astype(np.int64)
    return np.asarray(seen), cell[:, 1] * _CELLS + cell[:, 0], larger * np.maximum(cos, 0.0), larger


def _hidden(eye: Floats, places: Floats, centre: Floats, size: Floats) -> Bools:
    """Whether the subject, an ellipsoid that fills its box, stands in the way, (n,)."""
    start = (eye - centre) / (size / 2.0)
    way = (places - eye) / (size / 2.0)
    along = np.einsum("ni,ni->n", way, way)
    nearest = np.clip(-(way @ start) / along, 0.0, 1.0)
    return np.asarray(np.linalg.norm(start + nearest[:, None] * way, axis=1) < 1.0)


def _choose(sights: _Sights, places: Floats, apart_mm: float, per_camera: int) -> Ints:
    """Places so that each camera sees enough, most wanted first; each is seen by two or more."""
    usable = sights.seen.sum(axis=0) >= min(2, len(sights.seen))
    chosen: list[int] = []
    cells = np.zeros((len(sights.seen), _CELLS**2), dtype=bool)
    while True:
        lacking = sights.seen[:, chosen].sum(axis=1) < per_camera
        rows = np.arange(len(sights.seen))[:, None]
        fresh = ~cells[rows, sights.cell]
        gain = (sights.seen & lacking[:, None]) * (1.0 + fresh)
        worth = np.where(usable, gain.sum(axis=0), 0.0)
        best = int(np.argmax(worth))
        if worth[best] <= 0.0:
            return np.array(sorted(chosen), dtype=np.int64)
        chosen.append(best)
        mine = sights.seen[:, best]
        cells[np.flatnonzero(mine), sights.cell[mine, best]] = True
        usable &= np.linalg.norm(places - places[best], axis=1) >= apart_mm


def _summary(
    cameras: Sequence[RigCamera], sights: _Sights, chosen: Ints
) -> tuple[SeenByCamera, ...]:
    out = []
    for k, camera in enumerate(cameras):
        mine = chosen[sights.seen[k, chosen]]
        radii = (
            (float(sights.smaller_px[k, mine].min()), float(sights.larger_px[k, mine].max()))
            if len(mine)
            else (0.0, 0.0)
        )
        cells = len(set(sights.cell[k, mine].tolist()))
        out.append(SeenByCamera(camera.name, len(mine), cells, radii))
    return tuple(out)


def _plan(
    name: str, places: Floats, radius_mm: float, size: Floats, pixel_mm: float
) -> tuple[TargetPlan, list[str]]:
    count = len(places) + 2 * _BARS
    bits = 12 if count <= len(RingCodeFamily(12).words) else 14
    plate, notes = _plate(size, pixel_mm)
    carriers: list[CarrierKind] = [*plate]
    if len(places):
        spots = tuple(
            TargetPlace(k, (float(p[0]), float(p[1]), float(p[2]))) for k, p in enumerate(places, 1)
        )
        carriers.append(RingCarrier("stand", radius_mm, spots, RingCodeFamily(bits), fixed=True))
    length = float(np.floor(np.sort(size)[-2:].mean() / 10.0) * 10.0)
    length = max(length, 4.0 * RING_QUIET * radius_mm)
    distances: list[Distance] = []
    for k in range(_BARS):
        first = len(places) + 1 + 2 * k
        bar, known = scale_bar(f"bar{k + 1}", (first, first + 1), (length,), radius_mm, bits)
        carriers.append(bar)
        distances += known
    return TargetPlan(name, tuple(carriers), tuple(distances)), notes


def _plate(size: Floats, pixel_mm: float) -> tuple[list[CharucoPlate], list[str]]:
    """A plate as large as fits the subject's place, its markers read when seen at a slant."""
    tilt = np.cos(np.radians(LARGEST_INCIDENCE_DEG))
    smallest = 7.0 * MODULE_PX * pixel_mm / tilt / 0.75
    wide, high = 0.8 * float(size[0]), 0.8 * float(size[2])
    square = float(np.ceil(2.0 * max(smallest, min(wide, high) / 9.0)) / 2.0)
    columns, rows = int(wide / square), int(high / square)
    if min(columns, rows) < 3:
        return [], [
            f"a ChArUco plate would need squares of {square:g} mm, of which the subject's "
            f"{size[0]:.0f} x {size[2]:.0f} mm hold fewer than three each way"
        ]
    return [CharucoPlate("plate", columns, rows, square, 0.75 * square, _PLATE_DICTIONARY)], []
