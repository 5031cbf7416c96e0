"""Rational and fisheye lenses: calibrated, told where they are wanted, kept in files, exported."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
from plain_opencv import opencvs_base_mm
from wide_pairs import seen_by_two

from calibration.adjustment import Calibration, CalibrationOptions, calibrate
from calibration.adjustment.camera import INTERIOR, PER_CAMERA, Interior
from calibration.adjustment.initialisation.lenses import as_lens
from calibration.adjustment.options import InteriorModel
from calibration.exports import rig_cameras
from calibration.files.calibrationfile import (
    CalibrationRecord,
    calibration_document,
    calibration_from,
)
from calibration.files.packing import pack
from calibration.observations import Observations
from common.errors import InputError
from geometry.arrays import Floats
from geometry.camera import LensModel
from geometry.exchange import export_files

BASE_MM = 120.0
NOISE_PX = 0.05


@cache
def observed(half_deg: float) -> Observations:
    return seen_by_two(half_deg)


@cache
def calibrated(half_deg: float, lens: LensModel | None) -> Calibration:
    return calibrate(observed(half_deg), CalibrationOptions(cross_validate=False, lens=lens))


def base_mm(found: Calibration) -> float:
    left, right = (camera.pose.position_rig_mm for camera in found.cameras)
    return float(np.linalg.norm(right - left))


@pytest.mark.parametrize("lens", [LensModel.FISHEYE, LensModel.RATIONAL])
def test_a_lens_of_160_degrees_is_calibrated_from_nothing(lens: LensModel) -> None:
    found = calibrated(80.0, lens)
    assert found.quality.converged
    assert all(c.interior.lens_model is lens for c in found.cameras)
    # 548 points less some 70 unknowns leave 0.97 of the noise.
    assert found.quality.rms_px == pytest.approx(0.97 * NOISE_PX, rel=0.05)
    assert found.quality.rejected == 0
    # A tenth of a per cent is what is asked of lengths.
    assert base_mm(found) == pytest.approx(BASE_MM, rel=1e-3)
    assert found.quality.unfit_lenses == ()


def test_browns_terms_on_a_fisheye_are_told_with_the_model_that_fits() -> None:
    found = calibrated(80.0, None)
    assert found.quality.unfit_lenses == ("left", "right")
    assert found.quality.warnings[0].startswith("Do not use it: the brown lens model does not fit")
    assert "Calibrate with --model fisheye." in found.quality.warnings[0]
    record = CalibrationRecord("a", "2026-11-30T00:00:00Z", found)
    text = json.dumps(calibration_document(record))
    assert calibration_from(text, "a").calibration.quality.unfit_lenses == ("left", "right")


def test_files_keep_a_fisheye_and_files_from_before_read_as_they_did() -> None:
    found = calibrated(80.0, LensModel.FISHEYE)
    document = calibration_document(CalibrationRecord("a", "2026-11-30T00:00:00Z", found))
    again = calibration_from(json.dumps(document), "a").calibration
    for ours, theirs in zip(found.cameras, again.cameras, strict=True):
        np.testing.assert_array_equal(ours.interior.vector, theirs.interior.vector)
    np.testing.assert_allclose(again.covariance.cameras, found.covariance.cameras, atol=1e-15)

    old = calibrated(80.0, None)
    document = calibration_document(CalibrationRecord("a", "2026-11-30T00:00:00Z", old))
    covariance = document["covariance"]
    assert covariance["pose_count"] == 0, "one matrix of cameras and targets"
    joint = calibration_from(json.dumps(document), "a").calibration.covariance.core
    of_camera = np.r_[0:9, INTERIOR:PER_CAMERA]
    kept = np.concatenate([of_camera, PER_CAMERA + of_camera, np.arange(38, len(joint))])
    small = joint[np.ix_(kept, kept)]
    covariance["core"] = pack(small[np.tril_indices(len(small))])
    del covariance["per_camera"], document["quality"]["unfit_lenses"]
    read = calibration_from(json.dumps(document), "a").calibration
    np.testing.assert_array_equal(read.covariance.core, joint)


def test_terms_that_a_model_lacks_are_held() -> None:
    fisheye = Interior(500.0, np.array([400.0, 300.0]), np.zeros(4))
    sigma = dict(
        zip(
            ("f", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "b1", "k4", "k5", "k6", "lens"),
            InteriorModel(p1=1.0, k5=1.0).sigmas(fisheye, (801, 601)),
            strict=True,
        )
    )
    assert [n for n, s in sigma.items() if s == 0.0] == ["p1", "p2", "b1", "k5", "k6", "lens"]


@pytest.mark.parametrize("lens", list(LensModel))
def test_a_lens_is_said_nearly_alike_in_another_model(lens: LensModel) -> None:
    made = Interior(600.0, np.array([400.0, 300.0]), np.array([-0.01, 0.002, 0.0, 0.0]))
    other = as_lens(made, lens, (801, 601))
    at = np.array([[400.0, 300.0], [700.0, 300.0], [700.0, 500.0]])
    seen = other.pixels(made.normalised(at))
    assert other.lens_model is lens
    # Three terms fitted to 40 degrees of a fisheye leave a tenth of a pixel.
    np.testing.assert_allclose(seen, at, atol=0.2)


def opencv_pixels(interior: Interior, places: Floats) -> Floats:
    nowhere, matrix, terms = np.zeros(3), interior.camera_matrix, interior.distortion
    if interior.lens_model is LensModel.FISHEYE:
        return cv2.fisheye.projectPoints(places[:, None], nowhere, nowhere, matrix, terms)[0][:, 0]
    return cv2.projectPoints(places, nowhere, nowhere, matrix, terms)[0][:, 0]


@pytest.mark.parametrize("lens", [LensModel.FISHEYE, LensModel.RATIONAL])
def test_exports_that_have_words_for_a_lens_write_it_and_others_refuse(
    lens: LensModel, tmp_path: Path
) -> None:
    cameras = rig_cameras(calibrated(80.0, lens).cameras)
    fisheye = lens is LensModel.FISHEYE
    terms = calibrated(80.0, lens).cameras[0].interior.distortion.tolist()
    line = export_files("colmap-text", cameras)["cameras.txt"].decode().splitlines()[1].split()
    assert line[1] == ("OPENCV_FISHEYE" if fisheye else "FULL_OPENCV")
    assert [float(v) for v in line[8:]] == terms
    (tmp_path / "cameras.yml").write_bytes(export_files("opencv", cameras)["cameras.yml"])
    storage = cv2.FileStorage(str(tmp_path / "cameras.yml"), cv2.FILE_STORAGE_READ)
    node = storage.getNode("cameras")
    assert node.at(0).getNode("distortion_coefficients").mat().ravel().tolist() == terms
    assert node.at(0).getNode("model").string() == ("fisheye" if fisheye else "")
    for name, file in (("kalibr", "camchain.yaml"), ("nerfstudio", "transforms.json")):
        if fisheye:
            word = {"kalibr": "equidistant", "nerfstudio": "OPENCV_FISHEYE"}[name]
            assert word in export_files(name, cameras)[file].decode()
        else:
            with pytest.raises(InputError, match="has no rational lens"):
                export_files(name, cameras)
    for name in ("metashape-xml", "meshroom", "realityscan"):
        with pytest.raises(InputError, match=f"{name} has no {lens.name.lower()} lens"):
            export_files(name, cameras)
    interior = calibrated(80.0, lens).cameras[0].interior
    places = np.array([[0.3, 0.1, 1.0], [2.0, -1.0, 1.0], [-3.0, 2.0, 1.0]])
    ours = interior.pixels(places[:, :2] / places[:, 2:])
    np.testing.assert_allclose(ours, opencv_pixels(interior, places), atol=1e-9)


def test_nerfstudio_takes_one_lens_model_for_all() -> None:
    first, second = rig_cameras(calibrated(80.0, LensModel.FISHEYE).cameras)
    plain = replace(second, camera=replace(second.camera, distortion=np.zeros(5)))
    with pytest.raises(InputError, match="one lens model"):
        export_files("nerfstudio", (first, plain))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("half_deg", "lens"),
    [
        (47.0, LensModel.RATIONAL),
        (60.0, LensModel.RATIONAL),
        (60.0, LensModel.FISHEYE),
        (80.0, LensModel.FISHEYE),
    ],
)
def test_lengths_are_no_worse_than_opencvs_on_the_same_corners(
    half_deg: float, lens: LensModel
) -> None:
    ours = abs(base_mm(calibrated(half_deg, lens)) / BASE_MM - 1.0)
    theirs = abs(opencvs_base_mm(observed(half_deg), lens) / BASE_MM - 1.0)
    told = f"{ours:.5%}, OpenCV {theirs:.5%}"
    # Both draw on the same noise; by chance either is nearer by its sigma, 0.02 %.
    assert ours < theirs + 2e-4, told
    assert ours < 1e-3, told
