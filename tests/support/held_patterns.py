"""Carriers before a camera: what to render, and where each target truly appears."""

from __future__ import annotations

import numpy as np

from calibration.targets.boardpatterns import board_pattern
from calibration.targets.boards import Board
from calibration.targets.kinds import CarrierKind, CharucoPlate, MarkerCarrier
from calibration.targets.patterns import marker_pattern, plate_pattern, ring_pattern
from calibration.targets.rendering import PlacedPattern
from geometry.arrays import Floats
from geometry.camera import Camera, distort


def placed_carrier(
    kind: CarrierKind, rotation_to_camera: Floats, translation_mm: Floats
) -> tuple[PlacedPattern, ...]:
    """The patterns of a carrier at a pose ``x_camera = rotation @ x_carrier + translation_mm``.

    Targets lie in planes of constant z of the carrier, x to the right and y down.
    """
    rotation, translation = np.asarray(rotation_to_camera), np.asarray(translation_mm)
    if isinstance(kind, CharucoPlate):
        return (PlacedPattern(plate_pattern(kind), rotation, translation),)
    if isinstance(kind, Board):
        return (PlacedPattern(board_pattern(kind), rotation, translation),)
    patterns = (
        marker_pattern(kind, p.number)
        if isinstance(kind, MarkerCarrier)
        else ring_pattern(kind, p.number)
        for p in kind.places
    )
    return tuple(
        PlacedPattern(pattern, rotation, rotation @ np.array(place.position_mm) + translation)
        for pattern, place in zip(patterns, kind.places, strict=True)
    )


def true_pixels(
    kind: CarrierKind, camera: Camera, rotation_to_camera: Floats, translation_mm: Floats
) -> dict[str, Floats]:
    """Where each target of a carrier appears, (2,) each."""
    carrier = kind.carrier()
    local = carrier.nominal_mm @ np.asarray(rotation_to_camera).T + translation_mm
    normalised = distort(local[:, :2] / local[:, 2:], camera.distortion)
    pixels = normalised * camera.focal_length_px + camera.principal_point_px
    return dict(zip(carrier.ids, pixels, strict=True))
