"""Exports read back by other programs, and their conventions by hand."""

from __future__ import annotations

import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from calibration.adjustment.camera import CalibratedCamera, Interior
from calibration.exports import (
    caliscope_toml,
    colmap_files,
    kalibr_yaml,
    metashape_xml,
    opencv_yaml,
)
from calibration.synthetic import face_rig
from geometry.arrays import Floats
from geometry.errors import InputError
from geometry.frames import Pose

POINT = np.array([[30.0, 500.0, -20.0]])
"""By hand: camera at the origin looking along +Y, x right, z up is y up.

x_camera = (30, 20, 500); normalised (0.06, 0.04); r2 = 0.0052.
"""


def plain_camera(
    distortion: tuple[float, ...] = (0.0,) * 5, affinity: float = 0.0
) -> CalibratedCamera:
    interior = Interior(1000.0, np.array([319.5, 239.5]), np.array(distortion), affinity)
    pose = Pose.looking_at(np.zeros(3), np.array([0.0, 1.0, 0.0]))
    return CalibratedCamera("a", (640, 480), interior, pose)


def test_the_hand_worked_point() -> None:
    # 1000 * 0.06 + 319.5 = 379.5; 1000 * 0.04 + 239.5 = 279.5.
    np.testing.assert_allclose(plain_camera().project(POINT), [[379.5, 279.5]], atol=1e-10)


def rig() -> tuple[CalibratedCamera, ...]:
    cameras = []
    for k, camera in enumerate(face_rig(4)):
        terms = np.array([0.02, -0.1, 2e-3, -1e-3, 0.2 * k])
        interior = Interior(
            camera.interior.focal_length_px, camera.interior.principal_point_px, terms, 1e-3 * k
        )
        cameras.append(CalibratedCamera(camera.name, camera.image_size_px, interior, camera.pose))
    return tuple(cameras)


def subject() -> Floats:
    return np.random.default_rng(1).uniform(-80.0, 80.0, (40, 3))


def test_opencv_reads_its_file(tmp_path: Path) -> None:
    cv2 = pytest.importorskip("cv2")
    path = tmp_path / "rig.yaml"
    path.write_text(opencv_yaml(rig()), encoding="utf-8")
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    nodes = storage.getNode("cameras")
    for k, camera in enumerate(rig()):
        node = nodes.at(k)
        assert node.getNode("name").string() == camera.name
        turn, shift = node.getNode("R").mat(), node.getNode("T").mat()
        pixels, _ = cv2.projectPoints(
            subject(),
            cv2.Rodrigues(turn)[0],
            shift,
            node.getNode("camera_matrix").mat(),
            node.getNode("distortion_coefficients").mat(),
        )
        # Rounding of a rotation through Rodrigues' vector: 1e-15 times 1e4 px times 1e3.
        np.testing.assert_allclose(pixels.reshape(-1, 2), camera.project(subject()), atol=1e-7)
    storage.release()


def test_colmap_reads_its_files_and_has_half_a_pixel_more(tmp_path: Path) -> None:
    pycolmap = pytest.importorskip("pycolmap")
    for name, text in colmap_files(rig()).items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    model = pycolmap.Reconstruction(str(tmp_path))
    assert len(model.rigs) == 1
    assert len(model.frames) == 1
    for k, camera in enumerate(rig(), 1):
        image = model.images[k]
        local = image.cam_from_world() * subject()
        pixels = np.array([model.cameras[image.camera_id].img_from_cam(p) for p in local])
        np.testing.assert_allclose(
            pixels.reshape(-1, 2) - 0.5, camera.project(subject()), atol=1e-6
        )


def test_colmap_pixels_by_hand() -> None:
    line = colmap_files((plain_camera(),))["cameras.txt"].splitlines()[1].split()
    assert line[:4] == ["1", "FULL_OPENCV", "640", "480"]
    assert [float(v) for v in line[4:8]] == [1000.0, 1000.0, 320.0, 240.0]


def test_colmap_refuses_names_with_spaces() -> None:
    with pytest.raises(InputError, match="without spaces"):
        colmap_files((plain_camera(),), ("an image.png",))


def tree(text: str) -> ET.Element:
    return ET.fromstring(text.split("?>")[1])  # noqa: S314 - written by ourselves


def metashape_pixel(sensor: ET.Element, local: Floats) -> Floats:
    """Metashape's own formulas (its manual, frame cameras), corner of the image at (0, 0)."""
    found = sensor.find("calibration")
    assert found is not None
    v = {e.tag: float(e.text or "nan") for e in found if e.tag != "resolution"}
    size = found.find("resolution")
    assert size is not None
    w, h = float(size.get("width", "nan")), float(size.get("height", "nan"))
    x, y = local[:, 0] / local[:, 2], local[:, 1] / local[:, 2]
    r2 = x * x + y * y
    radial = 1.0 + v["k1"] * r2 + v["k2"] * r2**2 + v["k3"] * r2**3
    xd = x * radial + v["p1"] * (r2 + 2 * x * x) + 2 * v["p2"] * x * y
    yd = y * radial + v["p2"] * (r2 + 2 * y * y) + 2 * v["p1"] * x * y
    return np.stack([w / 2 + v["cx"] + xd * (v["f"] + v["b1"]), h / 2 + v["cy"] + yd * v["f"]], 1)


def test_metashape_formulas_give_our_pixels() -> None:
    chunk = tree(metashape_xml(rig())).find("chunk")
    assert chunk is not None
    sensors, placed = chunk.findall("sensors/sensor"), chunk.findall("cameras/camera")
    for sensor, one, camera in zip(sensors, placed, rig(), strict=True):
        text = one.findtext("transform")
        assert text is not None
        matrix = np.array([float(v) for v in text.split()]).reshape(4, 4)
        local = (1e-3 * subject() - matrix[:3, 3]) @ matrix[:3, :3]
        pixels = metashape_pixel(sensor, local)
        np.testing.assert_allclose(pixels - 0.5, camera.project(subject()), atol=1e-7)


def test_metashape_centre_by_hand() -> None:
    text = metashape_xml((plain_camera((0.0, 0.0, 1e-3, 2e-3, 0.0), 0.01),))
    found = tree(text).find("chunk/sensors/sensor/calibration")
    assert found is not None
    values = {e.tag: e.text for e in found}
    # 319.5 counts from the first pixel's centre; from its corner 320, which is the middle.
    assert float(values["cx"] or "nan") == 0.0
    assert float(values["p1"] or "nan") == 2e-3
    assert float(values["b1"] or "nan") == 10.0


def test_kalibr_chain_closes_and_its_terms_stand_in_for_k3() -> None:
    yaml = pytest.importorskip("yaml")
    cameras = tuple(
        CalibratedCamera(c.name, c.image_size_px, Interior.of(c.interior.vector), c.pose)
        for c in rig()
    )
    chain = yaml.safe_load(kalibr_yaml(cameras))
    turn = cameras[0].pose.rotation_rig_to_camera
    shift = -turn @ cameras[0].pose.position_rig_mm * 1e-3
    for k, camera in enumerate(cameras):
        node = chain[f"cam{k}"]
        if k:
            step = np.array(node["T_cn_cnm1"])
            turn, shift = step[:3, :3] @ turn, step[:3, :3] @ shift + step[:3, 3]
        local = 1e-3 * subject() @ turn.T + shift
        f, g, u, v = node["intrinsics"]
        k1, k2, p1, p2 = node["distortion_coeffs"]
        interior = Interior(g, np.array([u, v]), np.array([k1, k2, p1, p2, 0.0]), f / g - 1.0)
        pixels = interior.pixels(local[:, :2] / local[:, 2:])
        np.testing.assert_allclose(pixels, camera.project(subject()), atol=0.05)


def test_kalibr_refuses_a_k3_that_it_cannot_have() -> None:
    with pytest.raises(InputError, match="k3"):
        kalibr_yaml((plain_camera((0.0, 0.0, 0.0, 0.0, 5.0)),))


def test_caliscope_numbers_come_back_bit_for_bit() -> None:
    table = tomllib.loads(caliscope_toml(rig()))["cameras"]
    for k, camera in enumerate(rig()):
        one = table[str(k)]
        turn, shift = np.array(one["rotation"]), np.array(one["translation"])
        assert np.array_equal(turn, camera.pose.rotation_rig_to_camera)
        centre = -1e3 * turn.T @ shift
        np.testing.assert_allclose(centre, camera.pose.position_rig_mm, atol=1e-9)
        assert np.array_equal(np.array(one["matrix"]), camera.interior.camera_matrix)
        assert one["size"] == list(camera.image_size_px)
