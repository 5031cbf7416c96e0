"""Calibrations that many tests share: made once, since a calibration never changes."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
from synthetic_scenes import Scene, face_rig, face_scene, plate_places, turned

from calibration.adjustment import Calibration, CalibrationOptions, calibrate
from geometry.arrays import Floats

SIGMA_PX = 0.1
STILL = np.zeros(3)


@functools.cache
def small_scene() -> Scene:
    """Five cameras, 40 ring targets with bars, a plate in five places."""
    return face_scene(face_rig(5), rings=40, frames=5, seed=2)


@functools.cache
def small_reference() -> Calibration:
    """The small scene calibrated from the truth as start."""
    scene = small_scene()
    return calibrate(scene.observe(SIGMA_PX, 21), CalibrationOptions(start=scene.cameras))


@functools.cache
def check_scene() -> Scene:
    """What a check of the small reference looks at: the same things, the plate elsewhere."""
    scene = small_scene()
    return replace(scene, places=(scene.places[0], plate_places(4, 31)))


def disturbed(
    scene: Scene, camera: int, translation_mm: Floats = STILL, turn_rad: Floats = STILL
) -> Scene:
    """The scene with one camera moved."""
    cameras = list(scene.cameras)
    cameras[camera] = turned(cameras[camera], np.asarray(translation_mm), np.asarray(turn_rad))
    return scene.with_cameras(tuple(cameras))
