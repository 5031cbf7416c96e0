"""What is told of a picture at once: blur, exposure, and the picture itself, small."""

from __future__ import annotations

import io

import cv2
import numpy as np
import pytest
from PIL import Image

from rig.acquisition.cameras.base import Frame, FrameStatus
from rig.acquisition.looks import DARK, look_at, pixels_of, small_jpeg


def edges(blur_px: float, size: int = 240, noise: float = 0.0, low: float = 60.0) -> np.ndarray:
    """Dark and light squares of 40 pixels, turned, blurred by a Gaussian; 8 bits."""
    y, x = np.mgrid[0 : 4 * size, 0 : 4 * size] / 4.0
    turned = np.stack([x * np.cos(0.3) - y * np.sin(0.3), x * np.sin(0.3) + y * np.cos(0.3)])
    light = low + 120.0 * ((np.floor(turned / 40.0).sum(axis=0) % 2) > 0)
    fine = cv2.GaussianBlur(light, (0, 0), 4.0 * blur_px) if blur_px else light
    grey = cv2.resize(fine, (size, size), interpolation=cv2.INTER_AREA)
    grey += np.random.default_rng(1).normal(0.0, noise, grey.shape)
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("blur_px", [0.8, 1.5, 3.0])
@pytest.mark.parametrize("noise", [0.0, 2.0])
def test_blur_is_that_of_the_edges(blur_px: float, noise: float) -> None:
    found = look_at(edges(blur_px, noise=noise)).blur_px
    truth = blur_px**2 + 1 / 12  # of variance; a pixel is a box of 1/12
    # Steepness is 120 / sqrt(2 pi (v + s^2)), and noise adds n / (sqrt(8 pi) s^2) to it; that share
    # goes twice into the squared ratio, on which v depends by -(c^2 - s^2) / (ratio - 1)^2.
    fine, coarse = 1 + 1 / 3, 4 + 1 / 3
    steep = 120 / np.sqrt(2 * np.pi * (truth + fine))
    ratio = (truth + coarse) / (truth + fine)
    share = noise / (np.sqrt(8 * np.pi) * fine) / steep
    wrong = 2 * ratio * share * (coarse - fine) / (ratio - 1) ** 2 / (2 * np.sqrt(truth))
    assert found == pytest.approx(np.sqrt(truth), abs=0.1 + 1.5 * wrong)


def test_a_sharper_picture_has_more_focus_whatever_the_light() -> None:
    focus = [look_at(edges(blur)).focus for blur in (0.5, 1.0, 2.0, 4.0)]
    assert focus == sorted(focus, reverse=True)
    # Steepness squared over a width: 1 / sqrt(v + s^2), 1.26 to 2.31 here.
    assert focus[0] > 1.7 * focus[2]


def test_a_picture_without_edges_has_no_blur() -> None:
    assert look_at(np.full((64, 96), 120, np.uint8)).blur_px is None
    assert look_at(np.full((2, 2, 3), 120, np.uint8)).blur_px is None


@pytest.mark.parametrize(
    ("level", "words"),
    [(255, ["% of it is white"]), (130, []), (20, ["dark"])],
)
@pytest.mark.parametrize("deep", [False, True])
def test_exposure_is_told_in_words(level: int, words: list[str], deep: bool) -> None:
    pixels = np.full((60, 80, 3), level, np.uint8)
    if deep:  # linear: what is dark at 16 bits is a fifth of that of gamma-coded 8
        share = level / 255.0 * (1.0 if level > 100 else DARK[16] / DARK[8])
        pixels = np.full((60, 80, 3), round(share * 65535), np.uint16)
    told = look_at(pixels).warnings
    assert len(told) == len(words)
    assert all(word in text for word, text in zip(words, told, strict=True))


def test_a_small_picture_is_brightened_when_it_is_dark() -> None:
    dark = np.full((1200, 1600, 3), 12, np.uint8)
    data, gain = small_jpeg(dark, look_at(dark))
    shown = np.asarray(Image.open(io.BytesIO(data)))
    assert shown.shape == (720, 960, 3)
    assert gain > 10
    assert np.abs(shown.astype(float) - 12 * gain).max() < 3  # JPEG's rounding of a flat grey
    plain = edges(1.0)
    data, gain = small_jpeg(plain, look_at(plain))
    assert gain == 1.0
    assert np.asarray(Image.open(io.BytesIO(data))).shape == plain.shape


def test_files_of_bodies_are_read_and_raw_ones_are_not() -> None:
    data, _ = small_jpeg(edges(1.0), look_at(edges(1.0)))
    given = {"camera_id": "a", "arrived_host_ns": 1, "status": FrameStatus.OK}
    seen = pixels_of(Frame(**given, encoded=data, media_type="image/jpeg"))
    assert seen is not None and seen.shape == (240, 240, 3)
    raw = Frame(**given, encoded=b"raw", media_type="image/x-nikon-nef")
    assert pixels_of(raw) is None
