"""A face's own frame: symmetry plane, slope of the nose bridge, tip of the nose.

After L. Spreeuwers, "Fast and accurate 3D face recognition using registration to an intrinsic
coordinate system and fusion of multiple region classifiers", IJCV 93 (2011): no other face is
needed to register one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from common.errors import InputError
from evaluation.recognition.rangeimage import Grid, foremost, range_image, smoothed
from geometry.arrays import Bools, Floats, frozen

BRIDGE_DEG = 33.0
"""The bridge of the nose leans by that much against the frame's vertical, by definition."""

COARSE = Grid(2.0, 62.0, -56.0, 66.0)
_START = Grid(2.0, 90.0, -90.0, 100.0)
_STEPS = 30
_SETTLED_DEG, _SETTLED_MM = 0.15, 0.25
_BRIDGE_MM = (9.0, 27.0)
"""Above the tip: there the bridge is nearly straight; lower is the ball, higher the brow."""

_TIP_MM = 6.0
_LOOK_MM = 10.0
"""Lips may stand out farther than the tip while the head is still bowed."""

_LEAST_TIP = 0.7
_MOST_MOVED_MM = 10.0
"""Faces whose place was found for certain had it right to 4 mm."""
_LEAST_BRIDGE = 0.6
_DAMPING, _SWINGING = 0.6, 10
_MOST_REST_DEG, _MOST_REST_MM = 1.0, 1.0
_MOST_ASYMMETRY_MM = 2.5
_MOST_BEND_MM = 2.5
_REACH_MM = 105.0
LEAST_SHARE = 0.5
_LEAST_BOTH = 0.35
"""Of each half: a narrow strip about the nose is alike on both sides however it is turned."""
_REMEDY = "capture the face again, from the front and with light on all of it"


@dataclass(frozen=True, eq=False)
class FaceFrame:
    """``origin_mm`` (3,) is the nose's tip; rows of ``axes`` (3, 3): left, into the head, up.

    ``asymmetry_mm`` is the median absolute difference of the two halves, ``measured_share`` how
    much of the face between chin and forehead has points.
    """

    origin_mm: Floats
    axes: Floats
    asymmetry_mm: float
    measured_share: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "origin_mm", frozen(self.origin_mm))
        object.__setattr__(self, "axes", frozen(self.axes))

    def local(self, points_mm: Floats) -> Floats:
        """Points (n, 3) in the face's frame."""
        return np.asarray((points_mm - self.origin_mm) @ self.axes.T)


def face_frame(points_mm: Floats, tip_mm: Floats, axes: Floats) -> FaceFrame:
    """The frame of the face in points (n, 3), from a rough tip (3,) and rough axes (3, 3).

    The start may be off by some 12 degrees and 8 mm. Raises :class:`InputError` where too
    little of the face is there, or it is not certain how it stands.
    """
    near = points_mm[np.linalg.norm(points_mm - tip_mm, axis=1) < _REACH_MM]
    origin, turn = np.array(tip_mm, dtype=np.float64), np.array(axes, dtype=np.float64)
    moved_deg, moved_mm = np.inf, np.inf
    image, profile = np.zeros(COARSE.shape), _Profile(0.0, 0.0, 0.0, 0.0)
    near = near[foremost((near - origin) @ turn.T, _START)]
    for step in range(_STEPS):
        image = range_image((near - origin) @ turn.T, COARSE)
        _require_enough(image)
        rotvec, shift = _symmetry_step(image)
        profile = _profile(image)
        # Turning moves the stretch that is taken for the bridge: whole steps swing, and where
        # the nose is bumpy even part of a step may.
        damping = _DAMPING * 0.5 ** max(0.0, (step - _SWINGING) / 4.0)
        pitch = float(np.clip(damping * (BRIDGE_DEG - profile.lean_deg), -6.0, 6.0))
        lift = (-profile.tip_height_mm, damping * profile.tip_z_mm)
        rotation = Rotation.from_rotvec([np.radians(pitch), rotvec[0], rotvec[1]]).as_matrix()
        # The tip moves with the turn as the points do.
        origin = origin + turn.T @ np.array([shift, lift[0], lift[1]])
        turn = rotation.T @ turn
        moved_deg = float(np.degrees(np.linalg.norm(rotvec)) + abs(pitch))
        moved_mm = float(abs(shift) + np.abs(lift).sum())
        if moved_deg < _SETTLED_DEG / 8.0 and moved_mm < _SETTLED_MM / 8.0:
            break
    rest_deg = abs(profile.lean_deg - BRIDGE_DEG)
    settled = rest_deg <= _MOST_REST_DEG and abs(profile.tip_z_mm) <= _MOST_REST_MM
    if not settled or moved_deg > _SETTLED_DEG or moved_mm > _SETTLED_MM:
        raise _unsure("its symmetry plane and nose do not settle")
    if np.linalg.norm(origin - tip_mm) > _MOST_MOVED_MM:
        raise _unsure("the tip of its nose is not where a face has it")
    x, z = np.meshgrid(COARSE.x_mm, COARSE.z_mm)
    if np.isfinite(image[np.hypot(x, z) <= _TIP_MM]).mean() < _LEAST_TIP:
        raise _unsure("the tip of its nose was not measured")
    if profile.bend_mm > _MOST_BEND_MM:
        raise _unsure("the bridge of its nose is not straight")
    difference = image - image[:, ::-1]
    asymmetry = float(np.nanmedian(np.abs(difference)))
    if asymmetry > _MOST_ASYMMETRY_MM:
        raise _unsure(f"its halves differ by {asymmetry:.1f} mm")
    return FaceFrame(origin, turn, asymmetry, _share(image))


def _unsure(why: str) -> InputError:
    return InputError("face-unsure", f"how the face stands is not certain: {why}", _REMEDY)


def _core() -> Bools:
    x, z = np.meshgrid(COARSE.x_mm, COARSE.z_mm)
    return np.asarray((x / 50.0) ** 2 + ((z - 5.0) / 58.0) ** 2 <= 1.0)


def _share(image: Floats) -> float:
    return float(np.isfinite(image[_core()]).mean())


def _require_enough(image: Floats) -> None:
    share = _share(image)
    if share < LEAST_SHARE:
        raise InputError(
            "face-incomplete",
            f"only {100.0 * share:.0f} % of the face was measured; "
            f"{100.0 * LEAST_SHARE:.0f} % are the least",
            _REMEDY,
        )


def _symmetry_step(image: Floats) -> tuple[tuple[float, float], float]:
    """Turns about y and z, radians, and shift along x, mm, that make the halves alike.

    One step of Gauss-Newton on the difference of the image and its mirror, Tukey's weights.
    """
    x, z = np.meshgrid(COARSE.x_mm, COARSE.z_mm)
    both = np.isfinite(image) & np.isfinite(image[:, ::-1])
    even = np.where(both, 0.5 * (image + image[:, ::-1]), np.nan)
    even = smoothed(even, 0.8)
    by_z = np.asarray(np.gradient(even, COARSE.step_mm, axis=0))
    by_x = np.asarray(np.gradient(even, COARSE.step_mm, axis=1))
    left = both & (x > 0.0) & np.isfinite(by_x) & np.isfinite(by_z)
    # Steep flanks show errors of place, not of height.
    left &= np.hypot(by_x, by_z) < 2.0
    if left.sum() < _LEAST_BOTH * _core().sum() / 2.0:
        raise _unsure("too little of it is there on both sides")
    h, hx, hz = even[left], by_x[left], by_z[left]
    about_z = -x[left] - hx * h
    about_y = -z[left] * hx + x[left] * hz
    rows = 2.0 * np.stack([about_y, about_z, -hx], axis=1)
    difference = (image - image[:, ::-1])[left]
    found = np.zeros(3)
    for _ in range(4):
        rest = difference - rows @ found
        scale = max(1.4826 * float(np.median(np.abs(rest))), 0.05)
        weight = np.maximum(1.0 - (rest / (4.0 * scale)) ** 2, 0.0) ** 2
        normal = rows.T @ (weight[:, None] * rows)
        found = np.linalg.solve(normal + 1e-9 * np.eye(3), rows.T @ (weight * difference))
    found[:2] = np.clip(found[:2], -0.2, 0.2)
    return (float(found[0]), float(found[1])), float(np.clip(found[2], -8.0, 8.0))


@dataclass(frozen=True)
class _Profile:
    tip_z_mm: float
    tip_height_mm: float
    lean_deg: float
    bend_mm: float


def _profile(image: Floats) -> _Profile:
    """The nose in the symmetry plane: its tip, how its bridge leans, how far that is bent."""
    z = COARSE.z_mm
    near = image[:, np.abs(COARSE.x_mm) <= 2.0]
    known = np.isfinite(near).sum(axis=1) >= 2
    profile = np.full(len(z), np.nan)
    profile[known] = np.nanmean(near[known], axis=1)
    tip_z, tip_height = _tip(image)
    middle, half = sum(_BRIDGE_MM) / 2.0, (_BRIDGE_MM[1] - _BRIDGE_MM[0]) / 2.0
    # Weights that fade out: a row that enters or leaves must not make the slope jump.
    fading = np.clip(1.5 - 1.5 * np.abs(z - middle) / (1.5 * half), 0.0, 1.0)
    bridge = known & (fading > 0.0)
    if fading[bridge].sum() < _LEAST_BRIDGE * fading.sum():
        raise _unsure("the bridge of its nose was not measured")
    slope, bend = _line(z[bridge], profile[bridge], fading[bridge])
    return _Profile(tip_z, tip_height, float(np.degrees(np.arctan(-slope))), bend)


def _tip(image: Floats) -> tuple[float, float]:
    """Place along z and height of the highest point of the nose, by a paraboloid about it."""
    x, z = np.meshgrid(COARSE.x_mm, COARSE.z_mm)
    about = (np.abs(x) <= 5.0) & (np.abs(z) <= _LOOK_MM) & np.isfinite(image)
    if about.sum() < 25:
        raise _unsure("the tip of its nose was not measured")
    blurred = smoothed(np.where(about, image, np.nan), 0.8)
    top = int(np.nanargmax(np.where(about, blurred, np.nan)))
    centre = float(z.ravel()[top])
    if abs(centre) <= _TIP_MM:
        # Steps of the grid would be steps of the tip.
        centre = 0.0
    near = about & (np.abs(z - centre) <= 2.0 * _TIP_MM)
    u, v, h = x[near], z[near] - centre, image[near]
    weight = np.exp(-((v / _TIP_MM) ** 2))
    basis = np.stack([np.ones_like(u), v, v * v, u * u], axis=1)
    fit = np.linalg.lstsq(basis * weight[:, None], h * weight, rcond=None)[0]
    if fit[2] >= -1e-3:
        return centre, float(blurred.ravel()[top])
    offset = float(np.clip(-fit[1] / (2.0 * fit[2]), -_TIP_MM, _TIP_MM))
    return centre + offset, float(fit[0] + fit[1] * offset + fit[2] * offset**2)


def _line(z: Floats, height: Floats, share: Floats) -> tuple[float, float]:
    """Slope of a straight line through the profile, and its median departure from it, mm."""
    weight = np.sqrt(share)
    basis = np.stack([np.ones_like(z), z - z.mean()], axis=1)
    fit, rest = np.zeros(2), height
    for _ in range(5):
        fit = np.linalg.lstsq(basis * weight[:, None], height * weight, rcond=None)[0]
        rest = height - basis @ fit
        scale = max(1.4826 * float(np.median(np.abs(rest))), 0.1)
        weight = np.sqrt(share / (1.0 + (rest / (2.0 * scale)) ** 2))
    return float(fit[1]), float(np.median(np.abs(rest)))
