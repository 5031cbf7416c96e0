"""Flat things in the scene: coded targets, pictures, the LED timing board."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from common.errors import InputError
from geometry.arrays import Floats
from geometry.camera import RigCamera
from rig.acquisition.timingboard.reading import TimingBoard, aruco_dictionary
from rig.simulation.flatsettings import HeldSettings, PlaceSettings, TargetSettings
from rig.simulation.heads import read_picture
from rig.simulation.motion import rotation_by
from rig.simulation.sampling import LINEAR_OF_SRGB, pyramid, sampled

Singles = NDArray[np.float32]

_PX_PER_CELL = 8
"""Of a coded face: so that its borders, and the quarters of a ChArUco square, are whole pixels."""

_HALVED = 64
"""A picture's sides are made multiples of this, to be halved six times."""

_WIDTH_KEY = "rigwright-width-mm"
"""Text of a PNG that ``rigwright targets`` writes: how wide the whole picture is."""

_WIDTH_SHARE = 0.005
_BORDER_SHARE = 0.125
_BOARD_PX_PER_MM = 12.0
_BACK_ALBEDO = 0.4
_OUTLINE_POINTS = 33


@dataclass(frozen=True, eq=False)
class Flat:
    """A rectangle in the rig frame with a face on one side, plain grey on the other.

    ``centre_rig_mm`` (3,), unit vectors ``right_rig``, ``down_rig`` and ``facing_rig`` (3,),
    ``size_mm`` width and height; ``albedo`` the face and smaller copies of it, linear, (H, W) or
    (H, W, 3); ``glow`` its own radiance (H, W) or None. The pixels of a ``blocky`` face are what
    is printed, so they have sharp edges; others are smooth between their pixels.
    """

    centre_rig_mm: Floats
    right_rig: Floats
    down_rig: Floats
    facing_rig: Floats
    size_mm: tuple[float, float]
    albedo: tuple[Singles, ...]
    glow: tuple[Singles, ...] | None = None
    blocky: bool = False


def placed(
    place: PlaceSettings,
    size_mm: tuple[float, float],
    albedo: Singles,
    glow: Singles | None = None,
    *,
    blocky: bool = False,
) -> Flat:
    """A flat thing at its place; ``albedo`` is linear."""
    facing = np.array(place.facing_rig) / np.linalg.norm(place.facing_rig)
    up = np.array(place.up_rig, dtype=np.float64)
    up -= (up @ facing) * facing
    up /= np.linalg.norm(up)
    # Who looks at the face has its right hand at up x facing.
    right = np.cross(up, facing)
    return Flat(
        np.array(place.position_rig_mm, dtype=np.float64),
        right,
        -up,
        facing,
        size_mm,
        pyramid(albedo),
        None if glow is None else pyramid(glow),
        blocky,
    )


def target(settings: TargetSettings) -> Flat:
    """A coded target or picture as a flat thing."""
    if settings.kind == "image":
        picture = read_picture(settings.image) if settings.image else None
        if picture is None:
            raise InputError("simulation-target-image", "a target has no image", "give its file")
        _must_be_as_wide_as_told(settings)
        return _pictured(settings, LINEAR_OF_SRGB[_without_colour(picture)])
    face, px_per_mm = _coded(settings)
    border = round(_BORDER_SHARE * settings.size_mm * px_per_mm)
    face = np.pad(face, border, constant_values=255)
    # White paper and black ink are neither quite.
    albedo = np.float32(0.04) + np.float32(0.82) * (face.astype(np.float32) / 255.0)
    size = (face.shape[1] / px_per_mm, face.shape[0] / px_per_mm)
    return placed(settings.place, size, albedo, blocky=True)


def _must_be_as_wide_as_told(settings: TargetSettings) -> None:
    """Raises :class:`InputError` where a picture of targets says another width than its settings.

    A plate shown a twentieth too large would calibrate well, and to a size that is wrong.
    """
    with Image.open(settings.image or Path()) as picture:
        told = picture.info.get(_WIDTH_KEY)
    if told is None:
        return
    width_mm = float(told)
    if abs(settings.size_mm - width_mm) > _WIDTH_SHARE * width_mm:
        raise InputError(
            "simulation-target-size",
            f"the picture {settings.image} is {width_mm:g} mm wide with its border, not "
            f"{settings.size_mm:g} mm",
            f"give size_mm = {width_mm:g}",
        )


def _pictured(settings: TargetSettings, face: Singles) -> Flat:
    """A picture as a flat thing, with some pixels of white about it.

    Smaller copies of it halve its sides again and again; where those are odd a copy would cover
    less than the picture, and the target would be seen a little too large.
    """
    scale = settings.size_mm / face.shape[1]
    lacking = [-side % _HALVED for side in face.shape[:2]]
    around = [(total // 2, total - total // 2) for total in lacking]
    more = [(0, 0)] * (face.ndim - 2)
    face = np.pad(face, [*around, *more], constant_values=1.0)
    size = (face.shape[1] * scale, face.shape[0] * scale)
    flat = placed(settings.place, size, face, blocky=settings.sharp)
    down, right = ((after - before) / 2.0 * scale for before, after in around)
    return replace(
        flat, centre_rig_mm=flat.centre_rig_mm + right * flat.right_rig + down * flat.down_rig
    )


def _without_colour(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """One channel of a grey picture: a large printed target would fill memory three times."""
    grey = picture.ndim == 3 and not np.ptp(picture, axis=2).any()
    return picture[..., 0] if grey else picture


def held_up(flat: Flat, held: HeldSettings, capture: int) -> Flat:
    """A flat thing where somebody holds it in a capture; see :class:`HeldSettings`."""
    draw = np.random.default_rng((held.seed, capture))
    axes = np.stack([flat.right_rig, flat.down_rig, flat.facing_rig])
    roll, tilt = (np.radians(draw.uniform(-a, a)) for a in (held.roll_deg, held.tilt_deg))
    way = draw.uniform(0.0, 2.0 * np.pi)
    about = np.array([np.cos(way), np.sin(way), 0.0])
    turned = rotation_by(about * tilt) @ rotation_by(np.array([0.0, 0.0, roll]))
    right, down, facing = turned @ axes
    shift = draw.uniform(-1.0, 1.0, 3) * np.array(held.within_mm)
    return replace(
        flat,
        centre_rig_mm=flat.centre_rig_mm + shift,
        right_rig=right,
        down_rig=down,
        facing_rig=facing,
    )


def _coded(settings: TargetSettings) -> tuple[NDArray[np.uint8], float]:
    """The face of a marker or a ChArUco board, and its pixels per millimetre."""
    dictionary = aruco_dictionary(settings.dictionary)
    cells = int(dictionary.markerSize) + 2
    if settings.kind == "aruco":
        known = len(dictionary.bytesList)
        if not 0 <= settings.marker_id < known:
            raise InputError(
                "simulation-marker",
                f"{settings.dictionary} has no marker {settings.marker_id}",
                f"give 0 to {known - 1}",
            )
        side = cells * _PX_PER_CELL
        face = cv2.aruco.generateImageMarker(dictionary, settings.marker_id, side)
        return np.asarray(face, dtype=np.uint8), side / settings.size_mm
    # Three quarters of a square is a marker; cells and quarters both divide the side.
    board = charuco_board(settings)
    across, down = settings.squares
    side = cells * _PX_PER_CELL
    face = board.generateImage((across * side, down * side))
    return np.asarray(face, dtype=np.uint8), side / settings.size_mm


def charuco_board(settings: TargetSettings) -> cv2.aruco.CharucoBoard:
    """OpenCV's description of a ChArUco target: markers of three quarters of a square."""
    across, down = settings.squares
    if not (2 <= across <= 40 and 2 <= down <= 40):
        problem = f"a ChArUco board of {across} x {down} squares cannot be made"
        raise InputError("simulation-charuco", problem, "give 2 to 40 squares each way")
    return cv2.aruco.CharucoBoard(
        (across, down),
        settings.size_mm,
        0.75 * settings.size_mm,
        aruco_dictionary(settings.dictionary),
    )


def timing_board(board: TimingBoard, place: PlaceSettings, shares: Floats, level: float) -> Flat:
    """The timing board as a flat thing whose bits were 1 for ``shares`` (bits,) of the exposure."""
    face = board.face(_BOARD_PX_PER_MM)
    height, width = face.shape
    glow = np.zeros((height, width), dtype=np.float32)
    radius = board.led_diameter_mm / 2.0 * _BOARD_PX_PER_MM
    for row, lit in zip(board.leds_mm, (shares, 1.0 - shares), strict=True):
        for (x_mm, y_mm), share in zip(row, lit, strict=True):
            x = x_mm * _BOARD_PX_PER_MM + width / 2.0 - 0.5
            y = y_mm * _BOARD_PX_PER_MM + height / 2.0 - 0.5
            _add_disk(glow, x, y, radius, level * float(share))
    albedo = 0.8 * LINEAR_OF_SRGB[face]
    return placed(place, board.size_mm, albedo, glow)


def _add_disk(picture: Singles, x: float, y: float, radius: float, value: float) -> None:
    """Add a disk with a smooth edge of one pixel."""
    reach = int(np.ceil(radius)) + 2
    left, top = int(x) - reach, int(y) - reach
    rows, columns = np.mgrid[top : top + 2 * reach, left : left + 2 * reach]
    cover = np.clip(radius + 0.5 - np.hypot(columns - x, rows - y), 0.0, 1.0)
    picture[top : top + 2 * reach, left : left + 2 * reach] += (value * cover).astype(np.float32)


class FlatView:
    """A flat thing as one camera sees it: what rays of the camera hit of it."""

    def __init__(self, flat: Flat, rig_camera: RigCamera, light: Singles) -> None:
        rotation = rig_camera.pose.rotation_rig_to_camera
        self._flat = flat
        self._light = light
        self._centre = rig_camera.pose.to_camera(flat.centre_rig_mm[None])[0]
        self._axes = np.stack([flat.right_rig, flat.down_rig, flat.facing_rig]) @ rotation.T
        self._from_front = float(self._axes[2] @ self._centre) < 0.0
        self.bounds_px = _bounds(flat, rig_camera)
        self._level = self._level_for(rig_camera)

    def _level_for(self, rig_camera: RigCamera) -> int:
        """The copy of the face whose pixels are about a quarter of the camera's."""
        footprint_mm = max(self._centre[2], 1.0) / rig_camera.camera.focal_length_px / 4.0
        texel_mm = self._flat.size_mm[0] / self._flat.albedo[0].shape[1]
        level = int(np.floor(np.log2(max(footprint_mm / texel_mm, 1.0))))
        return min(level, len(self._flat.albedo) - 1)

    def hits(self, rays: Singles) -> tuple[NDArray[np.bool_], Singles, Singles, Singles]:
        """Whether rays (N, 2) hit it; depth, and column and row of the face in mm, (N,) each."""
        right, down, facing = self._axes
        towards = _dot(rays, facing)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            depth = np.float32(facing @ self._centre) / towards
            across = depth * _dot(rays, right) - np.float32(right @ self._centre)
            along = depth * _dot(rays, down) - np.float32(down @ self._centre)
            inside = (
                (depth > 0.0)
                & (np.abs(across) <= 0.5 * self._flat.size_mm[0])
                & (np.abs(along) <= 0.5 * self._flat.size_mm[1])
            )
        return inside, depth, across, along

    def radiance(self, across_mm: Singles, along_mm: Singles) -> Singles:
        """Radiance (N, 3) at places of the face."""
        if not self._from_front:
            grey = np.float32(_BACK_ALBEDO) * self._light
            return np.broadcast_to(grey, (len(across_mm), 3)).astype(np.float32)
        albedo = self._read(self._flat.albedo, across_mm, along_mm)
        light = (albedo if albedo.ndim == 2 else albedo[:, None]) * self._light
        if self._flat.glow is not None:
            light = light + self._read(self._flat.glow, across_mm, along_mm)[:, None]
        return np.asarray(light, dtype=np.float32)

    def _read(self, levels: tuple[Singles, ...], across: Singles, along: Singles) -> Singles:
        picture = levels[self._level]
        scale_x = np.float32(levels[0].shape[1] / self._flat.size_mm[0] / 2.0**self._level)
        scale_y = np.float32(levels[0].shape[0] / self._flat.size_mm[1] / 2.0**self._level)
        half_x, half_y = (np.float32(0.5 * v) for v in self._flat.size_mm)
        x = (across + half_x) * scale_x - np.float32(0.5)
        y = (along + half_y) * scale_y - np.float32(0.5)
        sharp = self._flat.blocky and self._level == 0
        return np.asarray(sampled(picture, x, y, sharp=sharp), dtype=np.float32)


def _dot(rays: Singles, direction: Floats) -> Singles:
    x, y, z = direction.astype(np.float32)
    return np.asarray(rays[:, 0] * x + rays[:, 1] * y + z, dtype=np.float32)


def _bounds(flat: Flat, rig_camera: RigCamera) -> tuple[float, float, float, float]:
    """Left, top, right, bottom in pixels of the part of the image that it can be in."""
    steps = np.linspace(-0.5, 0.5, _OUTLINE_POINTS)
    ends = np.full(_OUTLINE_POINTS, 0.5)
    across = np.concatenate([steps, steps, ends, -ends]) * flat.size_mm[0]
    along = np.concatenate([ends, -ends, steps, steps]) * flat.size_mm[1]
    outline = flat.centre_rig_mm + np.outer(across, flat.right_rig) + np.outer(along, flat.down_rig)
    return bounds_px(outline, rig_camera)


def bounds_px(points_rig_mm: Floats, rig_camera: RigCamera) -> tuple[float, float, float, float]:
    """Left, top, right, bottom of the points' image with a margin; everything if one is behind."""
    pixels, depth = rig_camera.camera.project(rig_camera.pose, points_rig_mm)
    if depth.min() <= 1.0:
        return -np.inf, -np.inf, np.inf, np.inf
    left, top = pixels.min(axis=0) - 3.0
    right, bottom = pixels.max(axis=0) + 3.0
    return float(left), float(top), float(right), float(bottom)
