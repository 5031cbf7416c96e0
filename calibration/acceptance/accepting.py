"""An acceptance test in the style of VDI/VDE 2634 part 1, at the scale of a face.

One calibrated bar with six targets or more is shown along seven lines through the volume. Each
line gives the lengths from its first target to the others, measured by intersection in the
calibrated cameras, which are not changed. It claims no conformity with the guideline: volume,
artefact and environment are the user's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.acceptance.lines import (
    LEAST_LENGTHS,
    LEAST_LINES,
    Acceptance,
    LengthLimit,
    MeasuredLength,
    Outcome,
    Volume,
)
from calibration.adjustment.camera import PER_CAMERA
from calibration.adjustment.finite import finite_rows
from calibration.adjustment.forward import Points, intersected
from calibration.adjustment.result import Calibration
from calibration.observations import Carrier, Observations
from common.errors import InputError
from common.progress import (
    CancelToken,
    NeverCancelled,
    Progress,
    ProgressCallback,
    go_on,
    ignore_progress,
)
from geometry.arrays import Floats, Ints

ARTEFACT_SHARE = 0.2
"""An artefact less certain than this share of the limit decides nothing."""

OFF_LINE_SHARE = 0.02
"""A carrier whose targets lie farther off their line, as a share of its length, is no bar."""

DIAGONAL_SHARE = 2.0 / 3.0
SAME_LINE_DEG = 10.0


@dataclass(frozen=True, eq=False)
class _Line:
    """One placed bar: name, its targets' indices in their order along it, points' indices."""

    name: str
    targets: Ints
    points: Ints


def accept(
    calibration: Calibration,
    observations: Observations,
    limit: LengthLimit,
    volume: Volume | None = None,
    progress: ProgressCallback = ignore_progress,
    cancel: CancelToken | None = None,
) -> Acceptance:
    """Lengths of a calibrated bar along several lines against a maximum permissible error.

    ``observations`` show moving carriers whose nominal coordinates are the bar's calibrated ones
    (finite sigmas); each carrier in each frame is one line. Raises :class:`InputError`.
    """
    cancel, volume = cancel or NeverCancelled(), volume or Volume()
    progress(Progress("intersection", 0.0))
    cameras = _camera_index(calibration, observations)
    count = len(observations.targets.ids)
    point = observations.frame * count + observations.target
    points = intersected(
        calibration.cameras,
        cameras[observations.camera],
        point,
        observations.pixel,
        calibration.noise.sigmas_px(observations.sigma_px, cameras[observations.camera]),
        count * len(observations.frames),
    )
    go_on(cancel)
    progress(Progress("lengths", 0.7))
    bars = bars_among(observations.targets.carriers)
    lines = _lines(observations, bars, points)
    lengths = [
        m for line in lines for m in _lengths(line, observations, points, calibration, limit)
    ]
    if not lengths:
        raise InputError(
            "acceptance-no-lengths",
            "no two targets of a bar with known coordinates were seen together",
            "show a calibrated bar to two cameras or more, along seven lines",
        )
    return _judged(tuple(lengths), lines, points, limit, volume, observations)


def _camera_index(calibration: Calibration, observations: Observations) -> Ints:
    known = {c.name: k for k, c in enumerate(calibration.cameras)}
    strange = [name for name in observations.cameras if name not in known]
    if strange:
        raise InputError(
            "acceptance-camera-unknown",
            f"camera {strange[0]!r} is not in the calibration",
            f"use the cameras {', '.join(known)}",
        )
    index = np.array([known[name] for name in observations.cameras], dtype=np.int64)
    for name, k, size in zip(
        observations.cameras, index, observations.image_size_px.tolist(), strict=True
    ):
        calibrated = calibration.cameras[k].image_size_px
        if tuple(size) != calibrated:
            raise InputError(
                "acceptance-image-size",
                f"camera {name!r} has images of {size[0]} x {size[1]} px, in the calibration "
                f"{calibrated[0]} x {calibrated[1]}",
                "use the same image size and crop as for the calibration",
            )
    return index


def bars_among(carriers: Sequence[Carrier]) -> tuple[Carrier, ...]:
    """The carriers whose known targets lie on one line; :class:`InputError` where none does."""
    bars = tuple(carrier for carrier in carriers if _on_a_line(carrier))
    if not bars:
        names = ", ".join(repr(carrier.name) for carrier in carriers)
        raise InputError(
            "acceptance-no-bar",
            f"the target set has no bar: the targets of {names} do not lie on one line at known "
            "places",
            "give the target file of a calibrated bar with six targets on one line",
        )
    return bars


def _on_a_line(carrier: Carrier) -> bool:
    places = carrier.nominal_mm[finite_rows(carrier.sigma_mm)]
    if len(places) < 2:
        return False
    along, off = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)[:2]
    return bool(off <= OFF_LINE_SHARE * along)


def _lines(
    observations: Observations, bars: tuple[Carrier, ...], points: Points
) -> tuple[_Line, ...]:
    """Each bar wherever it was seen, targets in order along it."""
    out, first = [], 0
    count = len(observations.targets.ids)
    for carrier in observations.targets.carriers:
        own = np.arange(first, first + len(carrier.ids))
        first += len(carrier.ids)
        if carrier not in bars:
            continue
        known = finite_rows(carrier.sigma_mm)
        way = np.linalg.svd(carrier.nominal_mm[known] - carrier.nominal_mm[known].mean(axis=0))[2][
            0
        ]
        order = own[known][np.argsort(carrier.nominal_mm[known] @ way, kind="stable")]
        for frame, name in enumerate(observations.frames):
            index = frame * count + order
            seen = finite_rows(points.position_rig_mm[index])
            if seen.sum() >= 2:
                out.append(_Line(f"{carrier.name} in {name}", order[seen], index[seen]))
            if carrier.fixed:
                break
    return tuple(out)


def _lengths(
    line: _Line,
    observations: Observations,
    points: Points,
    calibration: Calibration,
    limit: LengthLimit,
) -> list[MeasuredLength]:
    """Lengths from the first target of a line to all others."""
    nominal = np.concatenate([c.nominal_mm for c in observations.targets.carriers])
    sigma = np.concatenate([c.sigma_mm for c in observations.targets.carriers])
    ids, out = observations.targets.ids, []
    a = int(line.points[0])
    for target, point in zip(line.targets[1:], line.points[1:], strict=True):
        b, first = int(point), int(line.targets[0])
        way = points.position_rig_mm[b] - points.position_rig_mm[a]
        measured = float(np.linalg.norm(way))
        unit = way / measured
        along = nominal[target] - nominal[first]
        calibrated = float(np.linalg.norm(along))
        own = along / calibrated
        variance = float(unit @ (points.covariance_mm2[a] + points.covariance_mm2[b]) @ unit)
        by_cameras = unit @ (points.by_cameras[b] - points.by_cameras[a])
        variance += _inherited(by_cameras, calibration)
        variance += float(np.sum((own * sigma[target]) ** 2) + np.sum((own * sigma[first]) ** 2))
        error = 1e3 * (measured - calibrated)
        out.append(
            MeasuredLength(
                line.name,
                ids[first],
                ids[int(target)],
                calibrated,
                measured,
                error,
                1e3 * float(np.sqrt(variance)),
                limit.at(calibrated),
            )
        )
    return out


def _inherited(by_cameras: Floats, calibration: Calibration) -> float:
    """Variance of a length from the calibration's own uncertainty, mm^2."""
    size = PER_CAMERA * len(calibration.cameras)
    return float(by_cameras @ calibration.covariance.cameras[:size, :size] @ by_cameras)


def _judged(
    lengths: tuple[MeasuredLength, ...],
    lines: tuple[_Line, ...],
    points: Points,
    limit: LengthLimit,
    volume: Volume,
    observations: Observations,
) -> Acceptance:
    calibrated = np.array([m.calibrated_mm for m in lengths])
    error = np.array([m.error_um for m in lengths])
    slope = float(calibrated @ error / (calibrated @ calibrated))
    left = error - slope * calibrated
    spread = float(np.sqrt(np.sum(left**2) / max(len(left) - 1, 1) / (calibrated @ calibrated)))
    missing = _missing(lengths, lines, points, volume)
    outcome = Outcome.INCOMPLETE if missing else Outcome.PASSED
    if not all(m.within for m in lengths):
        outcome = Outcome.FAILED
    return Acceptance(
        outcome,
        limit,
        volume,
        lengths,
        len(lines),
        float(np.abs(error).max()),
        float(np.sqrt(np.mean(error**2))),
        1e3 * slope,
        1e3 * spread,
        float(np.sqrt(np.mean(left**2))),
        missing,
        _notes(lengths, observations),
    )


def _missing(
    lengths: tuple[MeasuredLength, ...], lines: tuple[_Line, ...], points: Points, volume: Volume
) -> tuple[str, ...]:
    """What a whole test would have had."""
    out = []
    per_line: dict[str, int] = {}
    for m in lengths:
        per_line[m.line] = per_line.get(m.line, 0) + 1
    whole = [name for name, count in per_line.items() if count >= LEAST_LENGTHS]
    if len(whole) < LEAST_LINES:
        out.append(
            f"{len(whole)} lines have {LEAST_LENGTHS} lengths or more, {LEAST_LINES} are needed"
        )
    longest = max(m.calibrated_mm for m in lengths)
    needed = max(DIAGONAL_SHARE * volume.diagonal_mm, volume.shortest_mm)
    if longest < needed:
        out.append(f"the longest length is {longest:.0f} mm, {needed:.0f} mm are needed")
    ways = np.stack(
        [points.position_rig_mm[n.points[-1]] - points.position_rig_mm[n.points[0]] for n in lines]
    )
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    cosine = np.abs(ways @ ways.T)
    places = np.stack([points.position_rig_mm[n.points].mean(axis=0) for n in lines])
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    same = (cosine > np.cos(np.radians(SAME_LINE_DEG))) & (apart < 0.1 * volume.shortest_mm)
    if np.triu(same, 1).any():
        out.append("two of the lines lie in one place")
    return tuple(out)


def _notes(lengths: tuple[MeasuredLength, ...], observations: Observations) -> tuple[str, ...]:
    sigma = np.concatenate([c.sigma_mm for c in observations.targets.carriers])
    artefact = 1e3 * float(np.max(np.where(np.isfinite(sigma), sigma, 0.0))) * np.sqrt(2.0)
    smallest = min(m.limit_um for m in lengths)
    if artefact > ARTEFACT_SHARE * smallest:
        return (
            f"The bar's own uncertainty ({artefact:.1f} um) is more than a fifth of the limit "
            f"({smallest:.1f} um): the test says as much of the bar as of the rig.",
        )
    return ()
