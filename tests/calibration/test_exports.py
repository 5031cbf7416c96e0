"""Calibrated cameras as cameras of a rig: what every export is written from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_scenes import PIXEL_PITCH_MM, face_rig

from calibration.adjustment.camera import CalibratedCamera, Interior
from calibration.exports import FULL_FRAME_MM, rig_cameras
from common.errors import InputError
from geometry.exchange import write_export

POINTS_MM = np.random.default_rng(1).uniform(-80.0, 80.0, (40, 3))


def calibrated() -> tuple[CalibratedCamera, ...]:
    cameras = []
    for k, camera in enumerate(face_rig(4)):
        terms = np.array([0.02, -0.1, 2e-3, -1e-3, 0.2 * k])
        cameras.append(replace(camera, interior=replace(camera.interior, distortion=terms)))
    return tuple(cameras)


def test_cameras_of_a_rig_see_what_calibrated_ones_see() -> None:
    for camera, found in zip(calibrated(), rig_cameras(calibrated()), strict=True):
        pixels, _ = found.camera.project(found.pose, POINTS_MM)
        np.testing.assert_allclose(pixels, camera.project(POINTS_MM), rtol=0.0, atol=1e-9)
        assert found.camera.sensor_size_mm[0] == pytest.approx(FULL_FRAME_MM)
        assert found.focus_distance_mm == pytest.approx(1000.0)


def test_a_design_tells_pitch_body_and_focus() -> None:
    designed = tuple(
        replace(
            c,
            name=c.name,
            camera=replace(c.camera, pixel_pitch_mm=PIXEL_PITCH_MM, f_number=11.0),
            focus_distance_mm=950.0,
        )
        for c in rig_cameras(face_rig(4))
    )
    for camera, found in zip(calibrated(), rig_cameras(calibrated(), designed), strict=True):
        assert found.camera.pixel_pitch_mm == PIXEL_PITCH_MM
        assert found.camera.f_number == 11.0
        assert found.focus_distance_mm == 950.0
        pixels, _ = found.camera.project(found.pose, POINTS_MM)
        np.testing.assert_allclose(pixels, camera.project(POINTS_MM), rtol=0.0, atol=1e-9)


def test_what_cannot_be_written_is_refused() -> None:
    camera = calibrated()[0]
    interior = camera.interior
    wide = Interior(
        interior.focal_length_px, interior.principal_point_px, interior.distortion, 0.01
    )
    with pytest.raises(InputError, match="not square"):
        rig_cameras((replace(camera, interior=wide),))
    with pytest.raises(InputError, match="another size"):
        rig_cameras((replace(camera, image_size_px=(600, 400)),), rig_cameras((camera,)))


def test_a_calibration_reaches_colmap(tmp_path: Path) -> None:
    pycolmap = pytest.importorskip("pycolmap")
    write_export(tmp_path / "model", "colmap-text", rig_cameras(calibrated()))
    model = pycolmap.Reconstruction(tmp_path / "model")
    by_name = {image.name: image for image in model.images.values()}
    for camera in calibrated():
        image = by_name[f"{camera.name}.png"]
        pixels = image.camera.img_from_cam(image.cam_from_world() * (POINTS_MM / 1000.0))
        # COLMAP's first pixel has its centre at 0.5.
        np.testing.assert_allclose(pixels - 0.5, camera.project(POINTS_MM), atol=1e-6)
