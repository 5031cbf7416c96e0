"""The bundled synthetic head: made from a few measures, watertight, in the rig frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import lru_cache

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats
from geometry.head_field import NECK_CUT_Z_MM, TEMPLATE_SIZE_MM, Measures, head_distance
from geometry.scan import Scan, ScanNote, vertex_normals
from geometry.surface_nets import grid_values, largest_piece, settle, surface_nets, unambiguous

RANGES_MM: dict[str, tuple[float, float]] = {
    "width_mm": (120.0, 180.0),
    "height_mm": (170.0, 260.0),
    "depth_mm": (150.0, 230.0),
    "face_width_mm": (115.0, 160.0),
    "jaw_width_mm": (85.0, 135.0),
    "chin_mm": (-8.0, 10.0),
    "brow_mm": (0.0, 8.0),
    "eye_spacing_mm": (52.0, 74.0),
    "eye_depth_mm": (6.0, 16.0),
    "nose_length_mm": (38.0, 62.0),
    "nose_protrusion_mm": (12.0, 30.0),
    "nose_width_mm": (26.0, 46.0),
    "mouth_width_mm": (38.0, 64.0),
    "lip_mm": (2.5, 7.0),
    "ear_length_mm": (48.0, 76.0),
    "ear_protrusion_mm": (8.0, 28.0),
    "neck_width_mm": (85.0, 145.0),
    "hair_mm": (0.0, 40.0),
    "shoulder_width_mm": (0.0, 560.0),
}
"""Least and greatest value of each measure: beyond them the parts no longer meet in a head."""


@dataclass(frozen=True)
class HeadShape:
    """Measures of a head. Raises :class:`InputError` outside :data:`RANGES_MM`.

    ``width_mm`` across the skull above the ears, ``height_mm`` chin to crown, ``depth_mm``
    forehead to back of the head; ``face_width_mm`` across the cheekbones, ``jaw_width_mm``
    across the angles of the jaw; ``chin_mm`` and ``brow_mm`` how far chin and brow ridge stand
    out; ``eye_spacing_mm`` between the pupils, ``eye_depth_mm`` how far the eyes lie back;
    ``nose_length_mm`` from root to base, ``nose_protrusion_mm`` from the upper lip's plane to
    the tip, ``nose_width_mm`` across the wings; ``lip_mm`` half the height of a lip;
    ``ear_protrusion_mm`` from the skull to the rim; ``hair_mm`` thickness of a cap of hair,
    ``shoulder_width_mm`` across the shoulders, 0 for none of either.
    """

    width_mm: float = 150.0
    height_mm: float = 210.0
    depth_mm: float = 190.0
    face_width_mm: float = 136.0
    jaw_width_mm: float = 110.0
    chin_mm: float = 2.0
    brow_mm: float = 3.0
    eye_spacing_mm: float = 63.0
    eye_depth_mm: float = 11.0
    nose_length_mm: float = 50.0
    nose_protrusion_mm: float = 22.0
    nose_width_mm: float = 35.0
    mouth_width_mm: float = 51.0
    lip_mm: float = 4.2
    ear_length_mm: float = 63.0
    ear_protrusion_mm: float = 18.0
    neck_width_mm: float = 114.0
    hair_mm: float = 0.0
    shoulder_width_mm: float = 0.0

    def __post_init__(self) -> None:
        for entry in fields(self):
            value, (low, high) = getattr(self, entry.name), RANGES_MM[entry.name]
            if not low <= value <= high:
                raise InputError(
                    "head-shape",
                    f"{entry.name} of the head is {value}",
                    f"give {low:g} to {high:g} millimetres",
                )


def _measures(shape: HeadShape) -> Measures:
    """The measures in template millimetres: the template is stretched to the head's size."""
    kx, ky, kz = (
        size / template
        for size, template in zip(
            (shape.width_mm, shape.depth_mm, shape.height_mm), TEMPLATE_SIZE_MM, strict=True
        )
    )
    return Measures(
        face_half_width_mm=shape.face_width_mm / (2.0 * kx),
        jaw_half_width_mm=shape.jaw_width_mm / (2.0 * kx),
        chin_mm=shape.chin_mm / ky,
        brow_mm=shape.brow_mm / ky,
        eye_half_spacing_mm=shape.eye_spacing_mm / (2.0 * kx),
        eye_depth_mm=shape.eye_depth_mm / ky,
        nose_length_mm=shape.nose_length_mm / kz,
        nose_protrusion_mm=shape.nose_protrusion_mm / ky,
        nose_half_width_mm=shape.nose_width_mm / (2.0 * kx),
        mouth_half_width_mm=shape.mouth_width_mm / (2.0 * kx),
        lip_mm=shape.lip_mm / kz,
        ear_length_mm=shape.ear_length_mm / kz,
        ear_protrusion_mm=shape.ear_protrusion_mm / kx,
        neck_radius_mm=shape.neck_width_mm / (2.0 * kx),
        hair_mm=shape.hair_mm / kz,
        shoulder_half_width_mm=shape.shoulder_width_mm / (2.0 * kx),
    )


def _axis(
    low: float, high: float, fine_low: float, fine_high: float, fine: float, coarse: float
) -> Floats:
    """Grid nodes from low to high, ``fine`` apart between the fine limits, else ``coarse``."""
    parts = [
        np.arange(fine_low, low - coarse, -coarse)[::-1],
        np.arange(fine_low + fine, fine_high, fine),
        np.arange(fine_high, high + coarse, coarse),
    ]
    return np.concatenate(parts)


def _grid(measures: Measures) -> tuple[Floats, Floats, Floats]:
    """A grid about the template, finest where the face is."""
    half = max(118.0, measures.shoulder_half_width_mm + 20.0)
    low = NECK_CUT_Z_MM - (85.0 if measures.shoulder_half_width_mm > 0.0 else 12.0)
    high = 112.0 + measures.hair_mm
    back = 112.0 + measures.hair_mm
    return (
        _axis(-half, half, -102.0, 102.0, 2.3, 4.2),
        _axis(-135.0, back, -130.0, 32.0, 2.3, 4.2),
        _axis(low, high, -105.0, 45.0, 2.1, 3.8),
    )


def head_field(shape: HeadShape) -> Callable[[Floats], Floats]:
    """Signed distance (N,), about mm, of points (N, 3) of the rig frame to a smooth head."""
    measures = _measures(shape)
    size = _stretch(shape)

    def field(points: Floats) -> Floats:
        return np.asarray(head_distance(points / size, measures) * size.min())

    return field


def _stretch(shape: HeadShape) -> Floats:
    size = np.array([shape.width_mm, shape.depth_mm, shape.height_mm])
    return np.asarray(size / np.array(TEMPLATE_SIZE_MM))


def synthetic_head(shape: HeadShape | None = None, seed: int = 0) -> Scan:
    """A watertight head in the rig frame, its origin at mid height between the ears.

    ``seed`` varies the surface by a fraction of a millimetre, as no two faces are smooth in the
    same way; the measures are those of ``shape``.
    """
    return _made(shape or HeadShape(), seed)


@lru_cache(maxsize=2)
def _made(shape: HeadShape, seed: int) -> Scan:
    """Cached: it takes two seconds, and simulated cameras, studies and designs ask for the same."""
    measures = _measures(shape)
    relief = _relief(seed)

    def field(points: Floats) -> Floats:
        return head_distance(points, measures) + relief(points)

    axes = _grid(measures)
    vertices, faces = largest_piece(*surface_nets(unambiguous(grid_values(field, axes)), axes))
    vertices = settle(vertices, field)
    vertices = vertices * _stretch(shape)
    note = ScanNote("inferred", f"synthetic head, seed {seed}: millimetres, in the rig frame")
    return Scan(vertices, faces, vertex_normals(vertices, faces), (note,))


def _relief(seed: int) -> Callable[[Floats], Floats]:
    """A smooth random field of about 0.25 mm on wavelengths of 25 to 60 mm."""
    rng = np.random.default_rng(seed)
    waves = rng.normal(size=(12, 3))
    waves *= (2.0 * np.pi / rng.uniform(25.0, 60.0, 12) / np.linalg.norm(waves, axis=1))[:, None]
    phase = rng.uniform(0.0, 2.0 * np.pi, 12)

    def field(points: Floats) -> Floats:
        return np.asarray(0.1 * np.sin(points @ waves.T + phase).sum(axis=1))

    return field


SPREAD_MM = {
    "width_mm": 5.5,
    "height_mm": 8.0,
    "depth_mm": 7.0,
    "face_width_mm": 5.0,
    "jaw_width_mm": 5.5,
    "chin_mm": 2.0,
    "brow_mm": 1.5,
    "eye_spacing_mm": 3.2,
    "eye_depth_mm": 1.2,
    "nose_length_mm": 3.2,
    "nose_protrusion_mm": 2.4,
    "nose_width_mm": 2.8,
    "mouth_width_mm": 3.2,
    "lip_mm": 0.8,
    "ear_length_mm": 4.0,
    "ear_protrusion_mm": 3.0,
    "neck_width_mm": 7.0,
}
"""Standard deviations for a population: of the size that anthropometric surveys give for adults."""


def random_head_shape(seed: int) -> HeadShape:
    """One head of a population: each measure varies about the average adult, overall size too."""
    rng = np.random.default_rng(seed)
    base = HeadShape()
    overall = rng.normal()
    values = {}
    for name, spread in SPREAD_MM.items():
        # Half of the variance is common: large heads have large noses, mostly.
        draw = np.sqrt(0.5) * overall + np.sqrt(0.5) * rng.normal()
        low, high = RANGES_MM[name]
        values[name] = float(np.clip(getattr(base, name) + spread * draw, low, high))
    return HeadShape(**values)
