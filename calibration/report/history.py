"""Checks over time: what drifts, and how near it is to an alarm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from calibration.check.verdicts import CameraCheck, Kind
from calibration.files.records import CheckRecord
from common.page.svg import Series, chart


@dataclass(frozen=True)
class CameraTrace:
    """One camera over all checks; NaN where a check did not see it.

    ``load``: pose statistic over its limit, an alarm above 1. ``effect_mm`` and ``effect_px`` of
    the movement that the images suggest, at the subject and in the image.
    """

    name: str
    load: tuple[float, ...]
    effect_mm: tuple[float, ...]
    effect_px: tuple[float, ...]


@dataclass(frozen=True)
class History:
    """Checks against one reference in the order of their times."""

    reference: str
    times: tuple[str, ...]
    lights: tuple[str, ...]
    scale_ppm: tuple[float, ...]
    scale_sigma_ppm: tuple[float, ...]
    rms_px: tuple[float, ...]
    cameras: tuple[CameraTrace, ...]


def history_of(records: Sequence[CheckRecord], reference: str) -> History:
    """The history of one reference; records of others are left out."""
    own = sorted((r for r in records if r.reference == reference), key=lambda r: r.made_utc)
    names: dict[str, None] = {}
    for record in own:
        names.update(dict.fromkeys(c.name for c in record.result.cameras))
    return History(
        reference,
        tuple(r.made_utc for r in own),
        tuple(r.result.light.value for r in own),
        tuple(r.result.scale_ppm for r in own),
        tuple(r.result.scale_sigma_ppm for r in own),
        tuple(r.result.rms_px for r in own),
        tuple(_trace(name, own) for name in names),
    )


def explained(camera: CameraCheck) -> bool:
    """Whether a camera is fine though its test is above its limit: findings account for that."""
    return camera.verdict is Kind.FINE and camera.pose_statistic > camera.pose_limit


def _trace(name: str, records: Sequence[CheckRecord]) -> CameraTrace:
    nan = float("nan")
    rows = [next((c for c in r.result.cameras if c.name == name), None) for r in records]
    return CameraTrace(
        name,
        tuple(nan if c is None or explained(c) else c.pose_statistic / c.pose_limit for c in rows),
        tuple(nan if c is None else c.effect_mm for c in rows),
        tuple(nan if c is None else c.effect_px for c in rows),
    )


def history_svg(history: History) -> str:
    """How near each camera is to its alarm, over time."""
    series = [Series(c.name, c.load) for c in history.cameras]
    label = f"Cameras of {history.reference or 'the reference'} over {len(history.times)} checks"
    return chart(history.times, series, 1.0, label, "pose test over its limit")
