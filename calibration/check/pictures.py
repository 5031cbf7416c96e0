"""Pictures that are not what they are taken for: turned, mirrored, or of another frame.

Where the carriers stand is known from the other cameras; so is where this camera should see them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.adjustment.model import ObservationIndex, project
from calibration.adjustment.rotations import nearest_rotation
from calibration.check import messages
from calibration.check.consensus import Consensus, misfit_px
from calibration.check.epoch import Epoch
from calibration.check.verdicts import Finding, Kind
from geometry.arrays import Bools, Floats, Ints

STRANGE_PX = 8.0
LEAST_POINTS = 8
QUARTER_DEG = 90.0
NEAR_DEG = 15.0
"""A picture counts as turned by quarters when it is nearer than this to one."""

FLAT_SHARE = 0.08
"""What a turn of the picture may leave, as a share of what it extends over."""

AS_MANY = 0.9
"""An order explains a camera's pictures when it does so for this share of the points that fit
in any other frame; two that do cannot be told apart."""


@dataclass(frozen=True, eq=False)
class _Frames:
    """Where a camera's moving points would be seen if its pictures were of other frames."""

    rows: Ints
    misfit_px: Floats


def strange_pictures(epoch: Epoch, found: Consensus) -> tuple[tuple[Finding, ...], Bools]:
    """Findings about whole cameras, and the rows (n,) that are not of them."""
    out: list[Finding] = []
    keep = np.ones(len(epoch.camera), bool)
    misfit = misfit_px(epoch, found.state)
    sure = _sure_places(epoch, misfit)
    for k, name in enumerate(epoch.camera_names):
        own = np.flatnonzero(epoch.camera == k)
        if len(own) < LEAST_POINTS:
            continue
        one = _turned(epoch, found, own, name) if np.median(misfit[own]) > STRANGE_PX else None
        one = one or _other_frames(epoch, found, k, name, misfit, sure)
        if one is not None:
            out.append(one)
            keep[own] = False
    if len(np.unique(epoch.camera[keep])) < 2:
        return (), np.ones_like(keep)
    return tuple(out), keep


def _sure_places(epoch: Epoch, misfit: Floats) -> Bools:
    """Places (k,) that two cameras at least see where they stand."""
    seen = np.zeros(len(epoch.place_carrier), np.int64)
    for view, place in enumerate(epoch.view_place):
        own = epoch.view == view
        if own.any() and np.median(misfit[own]) < STRANGE_PX:
            seen[place] += 1
    return np.asarray(seen >= 2)


def _turned(epoch: Epoch, found: Consensus, own: Ints, name: str) -> Finding | None:
    """Whether the picture is turned by quarters, or mirrored, as a whole."""
    index = ObservationIndex(epoch.camera[own], epoch.view[own], epoch.target[own])
    expected, depth = project(found.state, index)
    good = depth > 0.0
    if good.sum() < LEAST_POINTS:
        return None
    a, b = expected[good], epoch.pixel[own][good]
    rotation, left = _planar(a, b)
    flip = np.array([-1.0, 1.0])
    _, left_mirrored = _planar(a * flip, b)
    extent = float(np.median(np.linalg.norm(a - np.median(a, axis=0), axis=1)))
    if min(left, left_mirrored) > FLAT_SHARE * extent:
        return None
    if left_mirrored < 0.3 * left:
        told = messages.mirrored(name)
        return Finding(Kind.LENS_CHANGED, (name,), told, value=-1.0, state="mirrored")
    angle = float(np.degrees(np.arctan2(rotation[1, 0], rotation[0, 0])))
    quarters = round(angle / QUARTER_DEG)
    if quarters % 4 == 0 or abs(angle - QUARTER_DEG * quarters) > NEAR_DEG:
        return None
    degrees = int(QUARTER_DEG) * (quarters % 4)
    told = messages.turned(name, degrees)
    return Finding(Kind.LENS_CHANGED, (name,), told, value=degrees, state="turned")


def _planar(source: Floats, target: Floats) -> tuple[Floats, float]:
    """Rotation (2, 2) of a plane from points to points (n, 2), and the median of what it leaves."""
    p, q = source - np.median(source, axis=0), target - np.median(target, axis=0)
    cross = np.eye(3)
    cross[:2, :2] = q.T @ p / max(float(np.sum(p * p)), 1e-9)
    rotation = nearest_rotation(cross)[:2, :2]
    rest = q - p @ rotation.T
    rest -= np.median(rest, axis=0)
    return rotation, float(np.median(np.linalg.norm(rest, axis=1)))


def _other_frames(
    epoch: Epoch, found: Consensus, camera: int, name: str, misfit: Floats, sure: Bools
) -> Finding | None:
    """Whether the pictures belong to earlier or later frames, run backwards, or are mixed up."""
    moving = np.flatnonzero((epoch.camera == camera) & epoch.moving[epoch.place])
    if len(moving) < LEAST_POINTS or np.median(misfit[moving]) < STRANGE_PX:
        return None
    fits, points = _matches(epoch, found, moving, sure)
    # A picture that fits where it is tells nothing: so does one that was taken twice.
    points[fits.diagonal()] = 0
    matched = int(points[fits.any(axis=1)].sum())
    if matched < max(LEAST_POINTS, len(moving) // 4):
        return None
    frame = np.arange(len(fits))
    most = AS_MANY * matched
    shifts = [d for d in sorted(_steps(len(fits)), key=abs) if _explained(fits, points, d) >= most]
    if points[fits[frame, frame[::-1]]].sum() >= most:
        sentence = messages.reversed_frames(name, shifts[0] if shifts else None)
        return Finding(Kind.UNSYNCHRONISED, (name,), sentence, value=float("nan"))
    if shifts:
        late = messages.out_of_step(name, shifts[0])
        return Finding(Kind.UNSYNCHRONISED, (name,), late, value=shifts[0])
    pairs = [
        (epoch.frame_names[f], epoch.frame_names[int(fits[f].argmax())])
        for f in np.flatnonzero(fits.any(axis=1) & (points > 0))
    ]
    mixed = messages.mixed_frames(name, pairs)
    return Finding(Kind.UNSYNCHRONISED, (name,), mixed, value=float("nan"))


def _steps(frames: int) -> list[int]:
    return [d for d in range(1 - frames, frames) if d]


def _explained(fits: Bools, points: Ints, step: int) -> int:
    """Points (frames,) of pictures that belong ``step`` frames earlier."""
    frame = np.arange(len(fits))
    there = (frame - step >= 0) & (frame - step < len(fits))
    good = fits[frame[there], frame[there] - step]
    return int(points[there][good].sum())


def _matches(epoch: Epoch, found: Consensus, rows: Ints, sure: Bools) -> tuple[Bools, Ints]:
    """Which pictures of a camera fit in which frames, (frames, frames), and points (frames,)."""
    frame = epoch.place_frame[epoch.place[rows]]
    count = int(epoch.place_frame.max()) + 1
    fits = np.zeros((count, count), bool)
    for step in range(1 - count, count):
        there = _seen_in(epoch, found, rows, frame - step, sure)
        of = epoch.place_frame[epoch.place[there.rows]]
        for f in np.unique(of):
            fits[f, f - step] = np.median(there.misfit_px[of == f]) < STRANGE_PX
    return fits, np.bincount(frame, minlength=count)


def _seen_in(epoch: Epoch, found: Consensus, rows: Ints, frame: Ints, sure: Bools) -> _Frames:
    """The rows for which another frame is known, and how far from there they are."""
    places = {
        (int(c), int(f)): k
        for k, (c, f) in enumerate(zip(epoch.place_carrier, epoch.place_frame, strict=True))
        if sure[k]
    }
    carrier = epoch.place_carrier[epoch.place[rows]]
    place = np.array(
        [places.get((int(c), int(f)), -1) for c, f in zip(carrier, frame, strict=True)],
        dtype=np.int64,
    )
    known = place >= 0
    view_of = np.zeros(len(epoch.place_carrier), np.int64)
    view_of[epoch.view_place] = np.arange(len(epoch.view_place))
    kept = rows[known]
    index = ObservationIndex(epoch.camera[kept], view_of[place[known]], epoch.target[kept])
    expected, _ = project(found.state, index)
    return _Frames(kept, np.linalg.norm(expected - epoch.pixel[kept], axis=1))
