"""Pictures of timing boards that are sound, damaged, covered, lit, or seen by a rolling shutter."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from rig.acquisition.timingboard.graytime import lit_shares
from rig.acquisition.timingboard.reading import TimingBoard

BOARD = TimingBoard()
SCALE = 3.2
PITCH_PX = BOARD.pitch_mm * SCALE
KINDS = ("sound", "lit room", "dead", "stuck", "covered", "finger", "reflection", "rolling")
SOUND = KINDS[:2]


@dataclass(frozen=True)
class Trial:
    """A picture and the truth: the exposure's middle at the height of the board's middle."""

    kind: str
    picture: np.ndarray
    mid_us: float
    exposure_us: float


def trial(seed: int) -> Trial:
    """One board; the kinds take turns."""
    draw = np.random.default_rng(seed)
    kind = KINDS[seed % len(KINDS)]
    exposure = float(np.exp(draw.uniform(np.log(300.0), np.log(16_000.0))))
    mid = float(draw.uniform(exposure, BOARD.range_us - exposure))
    face = (BOARD.face(SCALE) / 255.0).astype(np.float32)
    face = np.clip(face, 0.03, 0.9) * (0.5 if kind == "lit room" else draw.uniform(0.1, 0.4))
    middles = BOARD.leds_mm * SCALE + np.array(face.shape[::-1]) / 2.0
    level = levels(draw, kind, mid, exposure, middles)
    radius = 0.5 * BOARD.led_diameter_mm * SCALE
    light = face
    for value, (x, y) in zip(level.ravel(), middles.reshape(-1, 2), strict=True):
        disc(light, x, y, radius, value)
    if kind == "covered":
        for _ in range(draw.integers(1, 4)):
            blot(draw, light, middles, draw.uniform(0.01, 0.04))
    if kind == "finger":
        for _ in range(draw.integers(1, 4)):
            blot(draw, light, middles, draw.uniform(0.15, 0.8))
    if kind == "reflection":
        glare(draw, light, middles)
    return Trial(kind, photographed(draw, light), mid, exposure)


def levels(
    draw: np.random.Generator, kind: str, mid: float, exposure: float, middles: np.ndarray
) -> np.ndarray:
    """Light of each LED, (2, bits)."""
    row_us = draw.uniform(10.0, 30.0) if kind == "rolling" else 0.0
    at = mid + (middles[..., 1] - middles[..., 1].mean()) * row_us
    tick = BOARD.tick_us
    shares = np.array(
        [
            np.diagonal(lit_shares(row / tick, np.full(BOARD.bits, exposure / tick), BOARD.bits))
            for row in at
        ]
    )
    bright = draw.uniform(0.35, 0.75) * draw.normal(1.0, 0.03, (2, BOARD.bits))
    lit = np.stack([shares[0], 1.0 - shares[1]])
    bad = draw.choice(2 * BOARD.bits, draw.integers(1, 4), replace=False)
    if kind in ("dead", "stuck"):
        lit.ravel()[bad] = 0.0 if kind == "dead" else 1.0
    return np.clip(bright * lit, 0.0, 0.9)


def disc(light: np.ndarray, x: float, y: float, radius: float, value: float) -> None:
    """Add a disc, its edge shared out among the pixels it crosses."""
    reach = int(radius) + 2
    ys, xs = np.mgrid[int(y) - reach : int(y) + reach + 1, int(x) - reach : int(x) + reach + 1]
    share = np.clip(radius + 0.5 - np.hypot(xs - x, ys - y), 0.0, 1.0)
    light[ys, xs] += value * share


def near_one(draw: np.random.Generator, middles: np.ndarray) -> np.ndarray:
    """A place (x, y) on one of the LEDs or beside it."""
    one = middles.reshape(-1, 2)[draw.integers(2 * BOARD.bits)]
    return np.asarray(one + draw.normal(0.0, 0.2 * PITCH_PX, 2))


def blot(draw: np.random.Generator, light: np.ndarray, middles: np.ndarray, value: float) -> None:
    """Something opaque over one LED or a few."""
    x, y = middles.reshape(-1, 2)[draw.integers(2 * BOARD.bits)] + draw.normal(
        0.0, 0.2 * PITCH_PX, 2
    )
    axes = (int(PITCH_PX * draw.uniform(0.2, 1.0)), int(PITCH_PX * draw.uniform(0.3, 2.0)))
    cv2.ellipse(light, (int(x), int(y)), axes, draw.uniform(0, 360), 0, 360, value, -1)


def glare(draw: np.random.Generator, light: np.ndarray, middles: np.ndarray) -> None:
    """A soft spot of light."""
    x, y = middles.reshape(-1, 2)[draw.integers(2 * BOARD.bits)] + draw.normal(
        0.0, 0.2 * PITCH_PX, 2
    )
    ys, xs = np.mgrid[: light.shape[0], : light.shape[1]]
    width = PITCH_PX * draw.uniform(0.1, 0.8)
    light += draw.uniform(0.05, 0.4) * np.exp(-0.5 * ((xs - x) ** 2 + (ys - y) ** 2) / width**2)


def photographed(draw: np.random.Generator, light: np.ndarray) -> np.ndarray:
    """The board aslant on a grey ground, blurred, with noise, as an 8-bit picture."""
    height, width = light.shape
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32)
    turned = corners + 60.0 + draw.uniform(-12.0, 12.0, (4, 2)).astype(np.float32)
    matrix = cv2.getPerspectiveTransform(corners, turned.astype(np.float32))
    size = (width + 120, height + 120)
    seen = cv2.warpPerspective(light, matrix, size, flags=cv2.INTER_AREA, borderValue=0.2)
    seen = cv2.GaussianBlur(seen, (0, 0), 0.6)
    noise = 0.004 * draw.standard_normal(seen.shape, np.float32)
    seen = np.clip(seen + noise, 0.0, 1.0)
    code = np.where(seen <= 0.0031308, 12.92 * seen, 1.055 * seen ** (1 / 2.4) - 0.055)
    return np.round(255.0 * code).astype(np.uint8)
