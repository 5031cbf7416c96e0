"""Small pictures of coded targets with the truth known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from held_patterns import placed_carrier, true_pixels
from scipy.spatial.transform import Rotation

from calibration.detection.detections import Detections
from calibration.targets.kinds import (
    CarrierKind,
    CharucoPlate,
    MarkerCarrier,
    RingCarrier,
    TargetPlace,
)
from calibration.targets.rendering import photographed, render
from calibration.targets.ringcodes import RingCodeFamily
from geometry.arrays import Floats
from geometry.camera import Body, Camera

PLATE = CharucoPlate("plate", 5, 4, 20.0, 15.0, "DICT_5X5_100")
EXACT = (0.0, 0.0, 0.0)


def camera(size: tuple[int, int] = (360, 300), focal_px: float = 600.0, k1: float = 0.0) -> Camera:
    body = Body(np.full(3, 50.0), np.zeros(3))
    terms = np.array([k1, 0.0, 0.0, 0.0, 0.0])
    pitch = 0.005
    return Camera("c", size, pitch, focal_px * pitch, 8.0, 0.01, 50.0, body, distortion=terms)


def rotation(tilt_deg: float = 0.0, pan_deg: float = 0.0, roll_deg: float = 0.0) -> Floats:
    angles = [roll_deg, pan_deg, tilt_deg]
    return np.asarray(Rotation.from_euler("zyx", angles, degrees=True).as_matrix())


def places(numbers: Sequence[int], columns: int, step_mm: float) -> tuple[TargetPlace, ...]:
    return tuple(
        TargetPlace(n, (k % columns * step_mm, k // columns * step_mm, 0.0), EXACT)
        for k, n in enumerate(numbers)
    )


def markers(count: int = 6, dot: bool = True, corners: bool = False) -> MarkerCarrier:
    spots = places(range(count), 3, 28.0)
    return MarkerCarrier("markers", "DICT_4X4_50", 20.0, spots, dot, corners)


def rings(count: int = 6, bits: int = 12, first: int = 1) -> RingCarrier:
    # Paper of 24 mm each, with a gap: papers that touch show a seam in the picture.
    spots = places(range(first, first + count), 3, 26.0)
    return RingCarrier(f"rings{bits}", 3.0, spots, RingCodeFamily(bits))


def middle_mm(kind: CarrierKind) -> Floats:
    nominal = kind.carrier().nominal_mm
    return np.asarray((nominal.min(axis=0) + nominal.max(axis=0)) / 2.0)


def shot(
    kind: CarrierKind,
    view: Camera,
    turn: Floats,
    distance_mm: float,
    *,
    blur_px: float = 0.7,
    noise: float = 2.0,
    seed: int = 1,
    shift_mm: tuple[float, float] = (0.37, -0.21),
    background: float = 150.0,
) -> tuple[np.ndarray, dict[str, Floats]]:
    """An 8-bit picture of a carrier's middle, and where its targets truly are."""
    translation = np.array([*shift_mm, distance_mm]) - turn @ middle_mm(kind)
    placed = placed_carrier(kind, turn, translation)
    grey = render(view, placed, blur_px, 30.0, 220.0, background)
    return photographed(grey, noise, seed), true_pixels(kind, view, turn, translation)


def errors(found: Detections, truth: dict[str, Floats]) -> Floats:
    """Found less true pixels (n, 2)."""
    return np.array([found.pixel[k] - truth[name] for k, name in enumerate(found.ids)]).reshape(
        -1, 2
    )
