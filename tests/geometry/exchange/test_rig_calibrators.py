"""Kalibr's and caliscope's files read back as their programs would, and by hand."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from exchange_rigs import hand_rig, many_cameras, points_in_view

from common.errors import InputError
from geometry.camera import RigCamera, distort
from geometry.exchange import export_files
from geometry.exchange.kalibr import WORST_PX

yaml = pytest.importorskip("yaml")


def chain_pixels(cameras: tuple[RigCamera, ...]) -> list[np.ndarray]:
    """Pixels of the points in each camera, by following the chain from the first camera."""
    chain = yaml.safe_load(export_files("kalibr", cameras)["camchain.yaml"])
    local = 1e-3 * cameras[0].pose.to_camera(points_in_view())
    found = []
    for index in range(len(cameras)):
        node = chain[f"cam{index}"]
        if index:
            step = np.array(node["T_cn_cnm1"])
            local = local @ step[:3, :3].T + step[:3, 3]
        terms = np.array([*node["distortion_coeffs"], 0.0])
        fx, fy, cx, cy = node["intrinsics"]
        found.append(distort(local[:, :2] / local[:, 2:], terms) * [fx, fy] + [cx, cy])
    return found


def test_kalibrs_chain_leads_to_the_same_pixels() -> None:
    cameras = many_cameras(False)
    for camera, pixels in zip(cameras, chain_pixels(cameras), strict=True):
        expected, _ = camera.camera.project(camera.pose, points_in_view())
        np.testing.assert_allclose(pixels, expected, rtol=0.0, atol=1e-6)


def test_kalibr_stands_in_for_a_small_k3() -> None:
    front, side = many_cameras(True)[:2]
    terms = np.array([-0.1, 0.06, 0.003, -0.004, 0.002])
    cameras = (replace(front, camera=replace(front.camera, distortion=terms)), side)
    expected, _ = front.camera.project(front.pose, points_in_view())
    assert np.abs(expected).max() < 4000.0
    expected, _ = cameras[0].camera.project(front.pose, points_in_view())
    np.testing.assert_allclose(chain_pixels(cameras)[0], expected, rtol=0.0, atol=WORST_PX)


def test_kalibr_refuses_a_k3_that_it_cannot_have() -> None:
    with pytest.raises(InputError, match=r"'front' has a k3 .* lacks"):
        export_files("kalibr", hand_rig((0.0, 0.0, 0.0, 0.0, 5.0)))


def test_kalibr_by_hand() -> None:
    chain = yaml.safe_load(export_files("kalibr", hand_rig())["camchain.yaml"])
    assert chain["cam0"]["intrinsics"] == [400.0, 400.0, 209.5, 94.5]
    assert chain["cam1"]["rostopic"] == "/side one/image_raw"
    # R2 R1' = ((0,0,1),(0,1,0),(-1,0,0)), T2 - R2 R1' T1 = (-1, 0, 1) m.
    step = [[0, 0, 1, -1], [0, 1, 0, 0], [-1, 0, 0, 1], [0, 0, 0, 1]]
    np.testing.assert_allclose(chain["cam1"]["T_cn_cnm1"], step, rtol=0.0, atol=1e-15)
    assert "T_cn_cnm1" not in chain["cam0"]


def test_caliscope_comes_back_with_every_digit() -> None:
    cameras = many_cameras(True)
    text = export_files("caliscope", cameras)["camera_array.toml"].decode()
    table = tomllib.loads(text)["cameras"]
    for index, camera in enumerate(cameras):
        one = table[str(index)]
        assert one["name"] == camera.name
        assert one["size"] == list(camera.camera.image_size_px)
        assert np.array_equal(one["rotation"], camera.pose.rotation_rig_to_camera)
        assert np.array_equal(one["matrix"], camera.camera.camera_matrix)
        assert np.array_equal(one["distortions"], camera.camera.distortion)
        centre_mm = -1e3 * np.array(one["rotation"]).T @ one["translation"]
        np.testing.assert_allclose(centre_mm, camera.pose.position_rig_mm, atol=1e-9)
