"""Faces for tests of recognition: a generated head, and smooth random images in their place."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from evaluation.recognition.gallery import Gallery, Trained
from evaluation.recognition.population import front_of
from evaluation.recognition.rangeimage import FACE_GRID
from evaluation.recognition.training import train
from geometry.arrays import Floats, Ints
from geometry.head import HeadShape


@lru_cache(maxsize=2)
def front(**measures: float) -> tuple[Floats, Floats]:
    """Points of a generated head from the front, and its nose tip."""
    return front_of(HeadShape(**measures))


def fields(persons: int, captures: int, own_mm: float, seed: int = 0) -> tuple[Floats, Ints]:
    """Range images of smooth random shapes, and whose each is.

    Persons differ by 1 mm in each of 20 waves, captures of one person by ``own_mm``.
    """
    rng = np.random.default_rng(99)
    x, z = np.meshgrid(FACE_GRID.x_mm, FACE_GRID.z_mm)
    waves = rng.uniform(-0.08, 0.08, (20, 2))
    phase = rng.uniform(0.0, 6.28, 20)
    shapes = np.sin(waves[:, :1, None] * x + waves[:, 1:, None] * z + phase[:, None, None])
    rng = np.random.default_rng(seed)
    weights = np.repeat(rng.normal(size=(persons, 20)), captures, axis=0)
    weights = weights + own_mm * rng.normal(size=weights.shape)
    return np.tensordot(weights, shapes, 1), np.repeat(np.arange(persons), captures)


@lru_cache(maxsize=1)
def small_gallery() -> Gallery:
    """Trained on 40 random shapes; nobody is in it."""
    images, person = fields(40, 3, 0.1)
    recogniser = train(images, person, false_match_rate=0.01)
    return Gallery(recogniser, Trained(40, 120, "random shapes"))
