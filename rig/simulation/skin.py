"""Procedural skin for the bundled synthetic head: eyes, brows, lips, freckles, cropped hair.

The face is painted as seen from the front, in millimetres of x and z, on one picture; what faces
backwards takes a plain corner of it. Hair is a tint of the vertices, so it needs no picture.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Floats
from geometry.head import HeadShape, synthetic_head
from geometry.head_field import TEMPLATE_SIZE_MM
from rig.simulation.grain import value_noise
from rig.simulation.mesh import TexturedMesh

PX_PER_MM = 6.0
_LEFT_MM, _TOP_MM = -110.0, 115.0
_SIZE_MM = (220.0, 270.0)
_PLAIN_PX = 6.0
"""Side of the corner of the picture that holds plain skin."""

_SKIN = (222, 176, 152)
_LIP = (192, 116, 108)
_HAIR = np.array([0.10, 0.11, 0.115])
_BROW = (62, 44, 36)

Picture = NDArray[np.uint8]


@lru_cache(maxsize=1)
def painted_head(seed: int = 0) -> TexturedMesh:
    """The average synthetic head with skin; ``seed`` varies relief, freckles and hairs."""
    shape = HeadShape()
    scan = synthetic_head(shape, seed)
    size = np.array([shape.width_mm, shape.depth_mm, shape.height_mm]) / TEMPLATE_SIZE_MM
    vertices = np.array(scan.vertices_mm)
    corners = vertices[scan.faces]
    texture = np.stack(
        [
            (corners[..., 0] - _LEFT_MM) * PX_PER_MM - 0.5,
            (_TOP_MM - corners[..., 2]) * PX_PER_MM - 0.5,
        ],
        axis=-1,
    )
    behind = corners[..., 1].max(axis=1) > -15.0 * size[1]
    texture[behind] = _PLAIN_PX / 2.0
    tint = _tint(vertices / size)
    picture = _painted(shape, np.random.default_rng(seed))
    return TexturedMesh(vertices, np.array(scan.faces), texture.astype(np.float32), picture, tint)


def _tint(template_mm: Floats) -> NDArray[np.float32]:
    """Factors of red, green and blue: cropped hair, ruddy cheeks, nose and ears."""
    x, y, z = template_mm.T
    fine = value_noise((template_mm / 3.0).astype(np.float32), np.uint32(11))
    coarse = value_noise((template_mm / 14.0).astype(np.float32), np.uint32(12))
    front = 62.0 - 0.45 * np.maximum(y + 62.0, 0.0) - 0.0035 * np.abs(x) ** 2
    line = np.maximum(front, np.where(y > 18.0, -45.0, -8.0))
    near_ear = (np.abs(x) > 66.0) & (y > -12.0) & (y < 42.0) & (z > -48.0) & (z < 24.0)
    height = (z - line) + 3.5 * fine + 2.5 * coarse
    hair = np.clip(height / 7.0, 0.0, 1.0) * ~near_ear
    red = np.exp(-(((np.abs(x) - 42.0) / 20.0) ** 2) - ((z + 28.0) / 20.0) ** 2) * (y < -40.0)
    red += 1.2 * np.exp(-((x / 15.0) ** 2) - ((z + 36.0) / 14.0) ** 2) * (y < -95.0)
    red = red + 0.8 * near_ear + 0.25 * coarse
    skin = 1.0 - red[:, None] * np.array([0.02, 0.12, 0.11])
    dark = _HAIR * (1.0 + 0.5 * fine[:, None])
    tint = skin * (1.0 - hair[:, None]) + dark * hair[:, None]
    return np.asarray(tint, dtype=np.float32)


def _pixels(points_mm: Floats) -> NDArray[np.int32]:
    """Points (N, 2) x, z as pixels with 4 bits of fraction, for OpenCV's ``shift``."""
    px = (points_mm - [_LEFT_MM, _TOP_MM]) * [PX_PER_MM, -PX_PER_MM] - 0.5
    return np.round(px * 16.0).astype(np.int32)


def _fill(picture: Picture, outline_mm: Floats, colour: tuple[int, ...], soft_mm: float) -> None:
    """Fill an outline (N, 2) with a colour, its edge ``soft_mm`` wide."""
    mask = np.zeros(picture.shape[:2], dtype=np.uint8)
    cv2.fillPoly(mask, [_pixels(outline_mm)], 255, cv2.LINE_AA, 4)
    _blend(picture, mask, colour, soft_mm)


def _blend(picture: Picture, mask: Picture, colour: tuple[int, ...], soft_mm: float) -> None:
    soft = cv2.GaussianBlur(mask, (0, 0), soft_mm * PX_PER_MM).astype(np.float32) / 255.0
    mixed = picture * (1.0 - soft[..., None]) + np.array(colour, np.float32) * soft[..., None]
    picture[:] = np.round(mixed).astype(np.uint8)


def _painted(shape: HeadShape, rng: np.random.Generator) -> Picture:
    width, height = (round(v * PX_PER_MM) for v in _SIZE_MM)
    picture = np.full((height, width, 3), _SKIN, dtype=np.uint8)
    _mottle(picture, rng)
    stretch_x = shape.width_mm / TEMPLATE_SIZE_MM[0]
    stretch_z = shape.height_mm / TEMPLATE_SIZE_MM[2]
    _lips(picture, shape.mouth_width_mm / 2.0, -64.0 * stretch_z)
    for side in (-1.0, 1.0):
        _brow(picture, side, stretch_x, stretch_z, rng)
        _eye(picture, side, shape.eye_spacing_mm / 2.0, stretch_z, rng)
    corner = round(_PLAIN_PX)
    picture[: 2 * corner, : 2 * corner] = _SKIN
    return picture


def _mottle(picture: Picture, rng: np.random.Generator) -> None:
    """Uneven skin, freckles and a few moles."""
    height, width = picture.shape[:2]
    uneven = np.zeros((height, width), dtype=np.float32)
    for cell_mm, strength in ((14.0, 3.0), (5.0, 3.0), (1.6, 3.0)):
        small = (round(width / cell_mm / PX_PER_MM), round(height / cell_mm / PX_PER_MM))
        noise = rng.normal(size=small[::-1]).astype(np.float32)
        uneven += strength * cv2.resize(noise, (width, height), interpolation=cv2.INTER_CUBIC)
    shade = picture + uneven[..., None] * np.array([0.5, 1.0, 1.0], np.float32)
    picture[:] = np.clip(np.round(shade), 0, 255).astype(np.uint8)
    spots = np.zeros((height, width), dtype=np.uint8)
    for _ in range(320):
        place = _pixels(rng.normal(size=2) * [38.0, 22.0] + [0.0, -22.0])
        size = int(16 * PX_PER_MM * rng.uniform(0.25, 0.7))
        cv2.circle(spots, tuple(place.tolist()), size, int(rng.uniform(15, 70)), -1, cv2.LINE_AA, 4)
    _blend(picture, spots, (150, 92, 66), 0.15)
    for _ in range(3):
        middle = rng.uniform([-42.0, -90.0], [42.0, 45.0])
        turn = np.linspace(0.0, 2.0 * np.pi, 20)
        ring = middle + rng.uniform(0.4, 0.8) * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        _fill(picture, ring, (120, 74, 58), 0.2)


def _lips(picture: Picture, half_width_mm: float, z_mm: float) -> None:
    w = half_width_mm
    t = np.linspace(-1.0, 1.0, 61)
    bow = 7.6 * (1.0 - t**2) ** 0.75 - 1.7 * np.exp(-((t / 0.10) ** 2))
    upper = np.stack([w * t, z_mm - 0.7 + bow], axis=1)
    lower = np.stack([w * t[::-1], z_mm - 0.7 - 9.8 * (1.0 - t**2) ** 0.85], axis=1)
    _fill(picture, np.concatenate([upper, lower]), _LIP, 0.7)
    slit = np.stack([0.97 * w * t, np.full(61, z_mm - 0.7)], axis=1)
    half = np.array([0.0, 0.5])
    line = np.concatenate([slit + half, slit[::-1] - half])
    _fill(picture, line, (110, 56, 54), 0.5)


def _brow(
    picture: Picture, side: float, stretch_x: float, stretch_z: float, rng: np.random.Generator
) -> None:
    hairs = np.zeros(picture.shape[:2], dtype=np.uint8)
    for _ in range(520):
        t = rng.uniform() ** 0.9
        x = 9.0 + 44.0 * t
        z = 25.0 + 8.0 * np.sin(np.pi * min(t * 0.72, 1.0)) - 9.0 * t**3
        thick = 3.2 * (1.0 - 0.75 * t) * min(1.0, 0.45 + 4.0 * t)
        root = np.array([x, z + thick * rng.uniform(-1.0, 1.0)])
        lean = np.radians(rng.normal(58.0 - 62.0 * t, 12.0))
        tip = root + rng.uniform(4.0, 7.5) * np.array([np.cos(lean), np.sin(lean)])
        ends = np.stack([root, tip]) * [side * stretch_x, stretch_z]
        first, last = _pixels(ends).tolist()
        cv2.line(hairs, tuple(first), tuple(last), int(rng.uniform(90, 230)), 1, cv2.LINE_AA, 4)
    _blend(picture, hairs, _BROW, 0.09)


def _eye(
    picture: Picture, side: float, x_mm: float, stretch_z: float, rng: np.random.Generator
) -> None:
    """White, iris, pupil and lashes within the almond of the lids (as the head's solid has it)."""
    u = np.linspace(-15.0, 15.0, 121)
    tilt = 0.6 + 0.05 * u
    upper = -15.0 + np.sqrt(np.maximum(20.3**2 - u**2, 0.0))
    lower = 18.0 - np.sqrt(np.maximum(22.0**2 - u**2, 0.0))
    inside = upper > lower
    top = np.stack([side * (x_mm + u), stretch_z * (tilt + upper)], axis=1)[inside]
    bottom = np.stack([side * (x_mm + u), stretch_z * (tilt + lower)], axis=1)[inside]
    almond = np.concatenate([top, bottom[::-1]])
    shade = picture.copy()
    _fill(shade, almond, (228, 218, 212), 0.25)
    middle = np.array([side * x_mm, 1.0 * stretch_z])
    turn = np.linspace(0.0, 2.0 * np.pi, 80)
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    for radius, colour, soft in (
        (6.0, (52, 62, 66), 0.3),
        (5.3, (104, 128, 134), 0.4),
        (3.2, (128, 132, 112), 0.5),
    ):
        _fill(shade, middle + radius * ring, colour, soft)
    for angle in rng.uniform(0.0, 2.0 * np.pi, 70):
        spoke = np.array([np.cos(angle), np.sin(angle)])
        first, last = _pixels(middle + np.outer([2.4, 5.4], spoke)).tolist()
        tone = int(rng.uniform(70, 170))
        cv2.line(shade, tuple(first), tuple(last), (tone, tone + 8, tone), 1, cv2.LINE_AA, 4)
    _fill(shade, middle + 2.1 * ring, (14, 12, 12), 0.2)
    _fill(shade, middle + [-1.6, 1.8] + 0.8 * ring, (250, 250, 250), 0.12)
    mask = np.zeros(picture.shape[:2], dtype=np.uint8)
    cv2.fillPoly(mask, [_pixels(almond)], 255, cv2.LINE_AA, 4)
    cover = (cv2.GaussianBlur(mask, (0, 0), 1.5).astype(np.float32) / 255.0)[..., None]
    picture[:] = np.round(picture * (1.0 - cover) + shade * cover).astype(np.uint8)
    up = np.array([0.0, 1.0])
    lashes = np.concatenate([top + 0.9 * up, top[::-1] - 0.2 * up])
    _fill(picture, lashes, (48, 34, 30), 0.2)
    rim = np.concatenate([bottom + 0.25 * up, bottom[::-1] - 0.35 * up])
    _fill(picture, rim, (150, 98, 88), 0.25)
