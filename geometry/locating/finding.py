"""The search for the face: places that may be a nose, a rough look at each, the best laid well."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation
from threadpoolctl import threadpool_limits

from common.errors import InputError
from geometry.arrays import Floats, frozen
from geometry.locating.candidates import BALL_MM, peaks
from geometry.locating.registration import Laid, Stiffness, Surface, nose_tip, register, rough
from geometry.locating.template import face_template
from geometry.surface import SurfacePoints

SURE = 0.5
"""A face found with less confidence than this is refused."""

_STIFF = Stiffness(place_mm=4.0, modes=0)
"""While the pose is looked for the average face stays as it is: faces differ from it by 4 mm."""
_SOFT = Stiffness(place_mm=0.6, modes=32)
_LOOSE = replace(_SOFT, anchor=0.01)
_FINE = Stiffness(place_mm=0.15, modes=96, anchor=0.01)
"""How much a face nods is told from how it slopes by many ways in which faces differ only: with
32 of them 1.3 degrees are left (standard deviation over people), with 96 of them 1.0."""

# How many ways go on from step to step: enough that the right one is among them on the heads of
# tests/geometry/test_face_finding.py, few enough for a few seconds.
_TURNS_ABOUT = 12
_TILT_DEG = 20.0
_TURNS_TRIED = 4
_APART_DEG = 35.0
_PEAKS = 32
_TRIED = 90
_KEPT_HALF = 16
_KEPT = 5
_FINE_STEPS = 8
_ROUGH_MM = 75.0
_ROUGH_EVERY = 8
_VOXEL_MM = 4.0
_MOST_COST_MM = 1.5
"""Between the worst of faces that were tried (0.71) and a head without its face (2.43)."""
_COST_SPREAD_MM = 0.08
_LEAST_LEAD_MM = 0.3
"""The nearest other pose of a face that was there cost 1.1 mm more (1.84 to 0.71)."""
_LEAD_SPREAD_MM = 0.1
_OTHER_HEAD_MM = 60.0
"""Noses nearer than this are of one head."""
_TWIN_MM = 0.7
"""The second face of a scan may be seen less well than the first by so much."""
_HINT_DEG = 45.0
_SWAY_DEG = 9.0


@dataclass(frozen=True, eq=False)
class FoundFace:
    """A face on a surface, in the coordinates of the surface.

    ``nose_tip_mm`` (3,); ``rotation_to_rig`` (3, 3) maps directions to the rig frame of a head
    that stands upright and looks at the cameras. ``size`` is the face's over that of an average
    one. ``confidence``, 0 to 1, falls when the shape is not that of a face and when another
    place or pose would do nearly as well; ``misfit_mm`` is the root mean square distance of the
    template, bent to the face, to the surface.
    """

    nose_tip_mm: Floats
    rotation_to_rig: Floats
    size: float
    confidence: float
    misfit_mm: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "nose_tip_mm", frozen(self.nose_tip_mm))
        object.__setattr__(self, "rotation_to_rig", frozen(self.rotation_to_rig))


def locate_face(points: SurfacePoints, near_rotation: Floats | None = None) -> FoundFace | None:
    """The face on a surface of evenly spread points, mm; None where nothing is like one.

    With ``near_rotation`` (3, 3), to the rig frame, only poses within 45 degrees of it count.
    Raises :class:`InputError` when two faces far apart are equally clear.
    """
    # The matrices are small: threads would only wait for one another.
    with threadpool_limits(1, user_api="blas"):
        surface = Surface(points)
        laid = _search(surface, near_rotation)
        if not laid:
            return None
        best, others = laid[0], laid[1:]
        turned = register(surface, face_template(), [best], _FINE_STEPS, _FINE)[0]
    lead = min((other.cost_mm - best.cost_mm for other in others), default=2.0)
    sure = _rising(_MOST_COST_MM - best.cost_mm, _COST_SPREAD_MM)
    for other in others:
        far = np.linalg.norm(other.tip_mm - best.tip_mm) > _OTHER_HEAD_MM
        like = other.cost_mm - best.cost_mm < _TWIN_MM and other.cost_mm < _MOST_COST_MM
        if far and like:
            raise InputError(
                "faces-several",
                "more than one face is in the scan",
                "cut it to one person, or give nose_tip, left_eye and right_eye of the one meant",
            )
    return FoundFace(
        turned.tip_mm,
        turned.rotation.T,
        turned.scale,
        float(sure * _rising(lead - _LEAST_LEAD_MM, _LEAD_SPREAD_MM)),
        best.misfit_mm,
    )


def _rising(value: float, spread: float) -> float:
    return float(1.0 / (1.0 + np.exp(-np.clip(value / spread, -50.0, 50.0))))


def _search(surface: Surface, near_rotation: Floats | None) -> list[Laid]:
    """Ways the face may lie, the best first, no two alike."""
    template, even = face_template(), _even(surface.points_mm)
    ways = _ways(even)
    if near_rotation is not None:
        ways = [way for way in ways if angle_deg(way.rotation.T, near_rotation) <= _HINT_DEG]
    if not ways:
        return []
    inner = np.linalg.norm(template.points_mm, axis=1) < _ROUGH_MM
    misfit = rough(even, template.points_mm[inner][::_ROUGH_EVERY], ways)
    coarse = _promising(ways, misfit, _TRIED if near_rotation is None else _TRIED // 3)
    for thin, steps, most in ((8, 5, _KEPT_HALF), (4, 6, _KEPT)):
        coarse = register(surface, template.thinned(thin), coarse, steps, _STIFF)
        coarse = _distinct(sorted(coarse, key=lambda way: way.cost_mm), most, 20.0, 15.0)
    fine = sorted(_refined(surface, coarse, _KEPT), key=lambda way: way.cost_mm)
    # Noses pull the template aside into places that are only nearly the best.
    swayed = _refined(surface, _swayed(fine[0]), 1)
    fine[0] = min((fine[0], *swayed), key=lambda way: way.cost_mm)
    return _distinct(fine, _KEPT, 35.0, 25.0)


def _promising(ways: list[Laid], misfit_mm: Floats, most: int) -> list[Laid]:
    """The best of the ways, by their rough misfit (n,): few on each peak, and those far apart."""
    chosen: list[Laid] = []
    of_peak: dict[bytes, list[Laid]] = {}
    for k in np.argsort(misfit_mm, kind="stable"):
        way = ways[int(k)]
        # A clear nose fits a little in many turns; they must not crowd out other places.
        near = of_peak.setdefault(way.peak_mm.tobytes(), [])
        if len(near) < _TURNS_TRIED and all(
            angle_deg(way.rotation, other.rotation) > _APART_DEG for other in near
        ):
            near.append(way)
            chosen.append(way)
        if len(chosen) == most:
            break
    return chosen


def _refined(surface: Surface, starts: list[Laid], most: int) -> list[Laid]:
    """The best ``most`` of the starts, bent to the surface."""
    template = face_template()
    half = register(surface, template.thinned(4), starts, 10, _SOFT)
    half = sorted(half, key=lambda way: way.cost_mm)[:most]
    half = [replace(way, peak_mm=nose_tip(surface, way)) for way in half]
    return register(surface, template.thinned(2), half, 8, _LOOSE)


def _swayed(way: Laid) -> list[Laid]:
    """The same, turned a little to either side and about its axis."""
    turns = _SWAY_DEG * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    return [
        replace(
            way,
            rotation=way.rotation @ Rotation.from_euler("zy", turn, degrees=True).as_matrix(),
            scale=1.0,
            shape=np.zeros(0),
        )
        for turn in turns
    ]


def _even(points_mm: Floats) -> Floats:
    """One point for each voxel of the surface, (n, 3): clouds are denser where a scanner was."""
    cell = np.floor(points_mm / _VOXEL_MM).astype(np.int64)
    _, number = np.unique(cell, axis=0, return_inverse=True)
    number = np.ravel(number)
    share = np.bincount(number)[:, None]
    total = np.stack([np.bincount(number, points_mm[:, k]) for k in range(3)], axis=1)
    return np.asarray(total / share)


def _ways(even_mm: Floats) -> list[Laid]:
    """The template on each place that stands out, turned about its direction in many ways."""
    found = peaks(even_mm, _PEAKS)
    near = face_template().points_mm
    near = near[np.linalg.norm(near, axis=1) <= BALL_MM]
    back = _bases(-near.mean(axis=0)[None])[0].T
    rolls = 2.0 * np.pi / _TURNS_ABOUT * np.arange(_TURNS_ABOUT)
    tilts = np.radians(_TILT_DEG) * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
    turns = (
        Rotation.from_euler("yz", tilts).as_matrix()[:, None]
        @ Rotation.from_euler("x", rolls[:, None]).as_matrix()
    ).reshape(-1, 3, 3)
    rotations = _bases(found.directions)[:, None] @ turns @ back
    return [
        Laid(rotation, tip, 1.0, tip)
        for tip, about in zip(found.points_mm, rotations, strict=True)
        for rotation in about
    ]


def _bases(axes: Floats) -> Floats:
    """Rotations (n, 3, 3) whose first columns are the ``axes`` (n, 3)."""
    axes = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    side = np.cross(axes, np.eye(3)[np.abs(axes).argmin(axis=1)])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    return np.stack([axes, side, np.cross(axes, side)], axis=2)


def angle_deg(one: Floats, other: Floats) -> float:
    """The angle of the rotation between two rotations (3, 3)."""
    cosine = (np.einsum("ij,ij->", one, other) - 1.0) / 2.0
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def _distinct(ways: list[Laid], most: int, turn_deg: float, apart_mm: float) -> list[Laid]:
    """The first ``most`` that differ from all before them in turn or place."""
    chosen: list[Laid] = []
    for way in ways:
        if len(chosen) == most:
            break
        if all(
            angle_deg(way.rotation, other.rotation) > turn_deg
            or np.linalg.norm(way.tip_mm - other.tip_mm) > apart_mm
            for other in chosen
        ):
            chosen.append(way)
    return chosen
