"""What a camera sees of targets: exact pictures, to judge detection by.

A pixel is the integral over its area of the lens's Gaussian blur of the pattern. The pattern is
sampled as means over small soft boxes, ``SUPERSAMPLING`` a pixel each way, so that edges keep
their place between samples; blur and pixel are one kernel, applied to those samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import ndtr
from threadpoolctl import threadpool_limits

from calibration.targets.patterns import SOFTNESS, Pattern
from geometry.arrays import Floats
from geometry.camera import Camera, perspective

SUPERSAMPLING = 4
_TILE = 64
_NODES = 9


@dataclass(frozen=True, eq=False)
class PlacedPattern:
    """A pattern in front of a camera: ``x_camera = rotation @ (x, y, 0) + translation_mm``."""

    pattern: Pattern
    rotation_to_camera: Floats
    translation_mm: Floats

    def pixels(self, camera: Camera, plane_mm: Floats) -> Floats:
        """Where places (n, 2) of the plane appear, (n, 2)."""
        local = np.column_stack([plane_mm, np.zeros(len(plane_mm))])
        seen = local @ self.rotation_to_camera.T + self.translation_mm
        return camera.pixels(perspective(seen))

    def plane(self, camera: Camera, pixels: Floats) -> Floats:
        """Places (n, 2) of the plane behind pixels (n, 2)."""
        straight = camera.normalised(pixels)
        to_plane = np.linalg.inv(
            np.column_stack([self.rotation_to_camera[:, :2], self.translation_mm])
        )
        local = np.column_stack([straight, np.ones(len(straight))]) @ to_plane.T
        return np.asarray(local[:, :2] / local[:, 2:])


def render(
    camera: Camera,
    placed: Sequence[PlacedPattern],
    blur_px: float = 0.7,
    black: float = 30.0,
    white: float = 210.0,
    background: float = 110.0,
) -> Floats:
    """Grey levels (H, W) of the patterns, later ones before earlier ones; no noise yet."""
    width, height = camera.image_size_px
    image = np.full((height, width), float(background))
    # The matrices are small: threads would only get in each other's way.
    with threadpool_limits(1):
        for item in placed:
            _paint(camera, item, image, blur_px, black, white)
    return image


def _paint(
    camera: Camera, item: PlacedPattern, image: Floats, blur_px: float, black: float, white: float
) -> None:
    left, top, right, bottom = _bounds(camera, item, 4.0 * blur_px + 2.0)
    for y in range(top, bottom, _TILE):
        for x in range(left, right, _TILE):
            size = min(_TILE, right - x), min(_TILE, bottom - y)
            share, cover = _tile(camera, item, (x, y), size, blur_px)
            part = image[y : y + size[1], x : x + size[0]]
            part += black * cover + (white - black) * share - part * cover


def photographed(grey: Floats, noise: float, seed: int, bits: int = 8) -> np.ndarray:
    """Grey levels with Gaussian noise (in 8-bit levels), rounded to 8 or 16 bits."""
    noisy = grey + np.random.default_rng(seed).normal(0.0, noise, grey.shape) if noise else grey
    if bits == 8:
        return np.asarray(np.clip(np.rint(noisy), 0, 255).astype(np.uint8))
    return np.asarray(np.clip(np.rint(noisy * 257.0), 0, 65535).astype(np.uint16))


def _bounds(camera: Camera, item: PlacedPattern, margin: float) -> tuple[int, int, int, int]:
    left, top, right, bottom = item.pattern.extent_mm
    s = np.linspace(0.0, 1.0, 33)
    xs, ys = left + s * (right - left), top + s * (bottom - top)
    rim = np.concatenate(
        [np.column_stack([xs, np.full(33, y)]) for y in (top, bottom)]
        + [np.column_stack([np.full(33, x), ys]) for x in (left, right)]
    )
    low = np.floor(item.pixels(camera, rim).min(axis=0) - margin).astype(int)
    high = np.ceil(item.pixels(camera, rim).max(axis=0) + margin).astype(int) + 1
    width, height = camera.image_size_px
    return max(low[0], 0), max(low[1], 0), min(high[0], width), min(high[1], height)


def _tile(
    camera: Camera,
    item: PlacedPattern,
    corner: tuple[int, int],
    size: tuple[int, int],
    blur_px: float,
) -> tuple[Floats, Floats]:
    """White and cover of one tile of pixels, each (h, w)."""
    reach = int(np.ceil(4.5 * blur_px)) + 1
    across, down = (_kernel(n, reach, blur_px) for n in size)
    plane_x, plane_y, box = _plane_grid(camera, item, corner, size, reach)
    cover, share = _samples(item.pattern, plane_x, plane_y, box)
    return down @ share @ across.T, down @ cover @ across.T


def _samples(
    pattern: Pattern, x: Floats, y: Floats, box: tuple[float, float]
) -> tuple[Floats, Floats]:
    """Cover and covered white of all samples; pixels of one colour are asked once."""
    n = SUPERSAMPLING
    pixel = box[0] * n, box[1] * n
    blocks = [v.reshape(v.shape[0] // n, n, -1, n).transpose(0, 2, 1, 3) for v in (x, y)]
    middle = [v.mean(axis=(2, 3)) for v in blocks]
    cover = _cover(pattern, middle[0], middle[1], pixel)
    if 2.0 * max(pixel) < pattern.finest_mm:
        share = pattern.white_share(middle[0], middle[1], pixel)
        mixed = (cover > 0.0) & ((cover < 1.0) | ((share > 1e-9) & (share < 1.0 - 1e-9)))
    else:
        share, mixed = np.zeros_like(cover), cover > 0.0
    parts = []
    inner = [v[mixed] for v in blocks]
    fine_cover = _cover(pattern, inner[0], inner[1], box)
    fine_share = pattern.white_share(inner[0], inner[1], box) * fine_cover
    for coarse, fine in ((cover, fine_cover), (share * cover, fine_share)):
        whole = np.repeat(np.repeat(coarse, n, axis=0), n, axis=1)
        by_block = whole.reshape(blocks[0].shape[0], n, -1, n).transpose(0, 2, 1, 3)
        by_block[mixed] = fine
        parts.append(whole)
    return parts[0], parts[1]


def _cover(pattern: Pattern, x: Floats, y: Floats, box: tuple[float, float]) -> Floats:
    left, top, right, bottom = pattern.extent_mm
    return _between(x, left, right, box[0]) * _between(y, top, bottom, box[1])


def _plane_grid(
    camera: Camera,
    item: PlacedPattern,
    corner: tuple[int, int],
    size: tuple[int, int],
    reach: int,
) -> tuple[Floats, Floats, tuple[float, float]]:
    """Plane coordinates of all samples of a tile, interpolated from a few exact ones."""
    knots, weights = [], []
    for start, count in zip(corner, size, strict=True):
        low, high = start - 0.5 - reach, start - 0.5 + count + reach
        knots.append((low + high) / 2.0 + (high - low) / 2.0 * _chebyshev())
        weights.append(_interpolation((count + 2 * reach) * SUPERSAMPLING))
    grid = np.stack(np.meshgrid(knots[0], knots[1]), axis=-1).reshape(-1, 2)
    exact = item.plane(camera, grid).reshape(_NODES, _NODES, 2)
    middle = np.array([corner]) + np.array([size]) / 2.0
    step = item.plane(camera, middle + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    box = np.hypot(step[1] - step[0], step[2] - step[0])
    box = np.maximum(box, 1e-9) / SUPERSAMPLING
    fine = [weights[1] @ exact[..., k] @ weights[0].T for k in range(2)]
    return fine[0], fine[1], (float(box[0]), float(box[1]))


def _chebyshev() -> Floats:
    return np.cos(np.pi * (np.arange(_NODES) + 0.5) / _NODES)


@lru_cache(maxsize=64)
def _interpolation(samples: int) -> Floats:
    """Values at evenly spaced samples from values at the Chebyshev nodes, (samples, nodes)."""
    fine = (np.arange(samples) + 0.5) / samples * 2.0 - 1.0
    vander = np.polynomial.chebyshev.chebvander
    order = _NODES - 1
    return np.asarray(vander(fine, order) @ np.linalg.inv(vander(_chebyshev(), order)))


@lru_cache(maxsize=64)
def _kernel(pixels: int, reach: int, blur_px: float) -> Floats:
    """Weights of the samples in each pixel, (pixels, samples): blur, then the pixel's area."""
    samples = (np.arange((pixels + 2 * reach) * SUPERSAMPLING) + 0.5) / SUPERSAMPLING - 0.5 - reach
    away = samples[None, :] - np.arange(pixels)[:, None]
    sigma = np.sqrt(max(blur_px**2 - (SOFTNESS / SUPERSAMPLING) ** 2, 1e-6))
    weights = ndtr((away + 0.5) / sigma) - ndtr((away - 0.5) / sigma)
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def _between(place: Floats, low: float, high: float, box: float) -> Floats:
    inside = np.clip(np.minimum(place - low, high - place) / box, -1.0, 1.0)
    return np.asarray(0.5 + inside - 0.5 * inside * np.abs(inside))
