"""Exports read by other people's programs: projections must agree.

Tolerance 1e-6 px where numbers are written in full: 64-bit arithmetic on coordinates of 4000 px
loses about 1e-12 of them per operation, far below it.
"""

from __future__ import annotations

import io
import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from exchange_rigs import many_cameras, points_in_view
from lxml import etree

from geometry.camera import RigCamera, distort
from geometry.exchange import export_files, write_export
from geometry.exchange.conventions import quaternion_wxyz, yaw_pitch_roll_deg

AGREE_PX = 1e-6


def expected_px(camera: RigCamera) -> np.ndarray:
    """Pixels with centres at integers; every point is in front of the camera."""
    pixels, depths = camera.camera.project(camera.pose, points_in_view())
    assert (depths > 0.0).all()
    return pixels


@pytest.mark.parametrize("distorted", [False, True])
@pytest.mark.parametrize("form", ["colmap-text", "colmap-binary"])
def test_colmap_projects_as_we_do(form: str, distorted: bool, tmp_path: Path) -> None:
    pycolmap = pytest.importorskip("pycolmap")
    cameras = many_cameras(distorted)
    out = tmp_path / "model"
    write_export(out, form, cameras)
    model = pycolmap.Reconstruction(out)
    assert (model.num_rigs(), model.num_frames(), model.num_images()) == (1, 1, len(cameras))
    rig = model.rig(1)
    assert rig.num_sensors() == len(cameras)
    world_m = points_in_view() / 1000.0
    for image in model.images.values():
        (camera,) = (c for c in cameras if f"{c.name}.png" == image.name)
        # The pose COLMAP works with is the frame's and the sensor's, one after the other.
        local = image.cam_from_world() * world_m
        pixels = image.camera.img_from_cam(local) - 0.5
        assert np.abs(pixels - expected_px(camera)).max() < AGREE_PX
        assert image.has_pose


@pytest.mark.parametrize("distorted", [False, True])
def test_opencv_reads_and_projects(distorted: bool, tmp_path: Path) -> None:
    cameras = many_cameras(distorted)
    path = write_export(tmp_path / "cv", "opencv", cameras)["cameras.yml"]
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    nodes = storage.getNode("cameras")
    assert nodes.size() == len(cameras)
    for index, camera in enumerate(cameras):
        node = nodes.at(index)
        assert node.getNode("name").string() == camera.name
        assert int(node.getNode("image_width").real()) == camera.camera.image_size_px[0]
        turn, _ = cv2.Rodrigues(node.getNode("rotation").mat())
        pixels, _ = cv2.projectPoints(
            points_in_view(),
            turn,
            node.getNode("translation_mm").mat(),
            node.getNode("camera_matrix").mat(),
            node.getNode("distortion_coefficients").mat(),
        )
        assert np.abs(pixels.reshape(-1, 2) - expected_px(camera)).max() < AGREE_PX
    storage.release()


def test_names_that_yaml_would_read_as_something_else(tmp_path: Path) -> None:
    camera = many_cameras(False)[0]
    rig = tuple(
        RigCamera(name, camera.camera, camera.pose, 800.0) for name in ("no", "1e3", "a: b")
    )
    path = write_export(tmp_path / "cv", "opencv", rig)["cameras.yml"]
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    nodes = storage.getNode("cameras")
    assert [nodes.at(k).getNode("name").string() for k in range(3)] == ["no", "1e3", "a: b"]
    storage.release()


def test_a_glb_reader_finds_the_views_where_the_cameras_look() -> None:
    import trimesh

    cameras = many_cameras(True)
    data = export_files("gltf", cameras)["cameras.glb"]
    scene = trimesh.load_scene(io.BytesIO(data), file_type="glb")
    for camera in cameras:
        (name,) = (n for n in scene.graph.nodes if n == f"{camera.name}/view")
        matrix, geometry = scene.graph.get(name)
        vertices = trimesh.transform_points(scene.geometry[geometry].vertices, matrix)
        # glTF's (x, y, z) in metres is (x, -z, y) of the rig; the marker is 50 mm deep.
        rig_mm = np.column_stack([vertices[:, 0], -vertices[:, 2], vertices[:, 1]]) * 1000.0
        local = camera.pose.to_camera(rig_mm)
        order = np.argsort(local[:, 2])
        # Vertices are 32-bit floats of metres: good to 1e-4 mm.
        assert np.abs(local[order[0]]).max() < 1e-3
        assert np.abs(local[order[1:], 2] - 50.0).max() < 1e-3
        half = np.array(camera.camera.sensor_size_mm) / (2.0 * camera.camera.focal_length_mm) * 50.0
        assert np.abs(np.abs(local[order[1:], :2]) - half).max() < 1e-3


@pytest.mark.parametrize("distorted", [False, True])
def test_nerfstudio_shoots_its_rays_at_the_points(distorted: bool) -> None:
    """nerfstudio's own recipe: rays through pixel centres + 0.5, y up, z backward."""
    cameras = many_cameras(distorted)
    document = json.loads(export_files("nerfstudio", cameras)["transforms.json"])
    for camera, frame in zip(cameras, document["frames"], strict=True):
        image_xy = expected_px(camera) + 0.5
        x = (image_xy[:, 0] - frame["cx"]) / frame["fl_x"]
        y = (image_xy[:, 1] - frame["cy"]) / frame["fl_y"]
        to_world = np.array(frame["transform_matrix"])
        # The undistorted point, distorted as nerfstudio does it, must be the image point.
        points_m = points_in_view() / 1000.0 - to_world[:3, 3]
        local = points_m @ to_world[:3, :3]
        ideal = np.column_stack([local[:, 0] / -local[:, 2], -local[:, 1] / -local[:, 2]])
        r2 = (ideal**2).sum(axis=1)
        k1, k2, k3, p1, p2 = (frame[key] for key in ("k1", "k2", "k3", "p1", "p2"))
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        u, v = ideal.T
        dx = u * radial + 2.0 * p1 * u * v + p2 * (r2 + 2.0 * u * u)
        dy = v * radial + 2.0 * p2 * u * v + p1 * (r2 + 2.0 * v * v)
        assert np.abs(dx - x).max() * frame["fl_x"] < AGREE_PX
        assert np.abs(dy - y).max() * frame["fl_y"] < AGREE_PX


def test_usd_frusta_see_the_points_where_they_are(tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    from pxr import Gf, Usd, UsdGeom

    cameras = many_cameras(False)
    path = write_export(tmp_path / "usd", "usd", cameras)["cameras.usda"]
    stage = Usd.Stage.Open(str(path))
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    for camera in cameras:
        prim = UsdGeom.Camera(stage.GetPrimAtPath(f"/Rig/{camera.name}"))
        frustum = prim.GetCamera(Usd.TimeCode.Default()).frustum
        matrix = frustum.ComputeViewMatrix() * frustum.ComputeProjectionMatrix()
        width, height = camera.camera.image_size_px
        for point_mm, pixel in zip(points_in_view(), expected_px(camera), strict=True):
            x, y, _ = matrix.Transform(Gf.Vec3d(*(point_mm / 10.0)))
            found = np.array([(x + 1.0) / 2.0 * width, (1.0 - y) / 2.0 * height]) - 0.5
            # Apertures and focal lengths are 32-bit: 4000 px x 6e-8, twice.
            assert np.abs(found - pixel).max() < 2e-3


def test_survey_angles_are_the_rotation() -> None:
    for camera in many_cameras(False, count=40, seed=11):
        yaw, pitch, roll = np.radians(yaw_pitch_roll_deg(camera.pose))
        c, s = np.cos, np.sin
        rz = np.array([[c(yaw), s(yaw), 0], [-s(yaw), c(yaw), 0], [0, 0, 1]])
        rx = np.array([[1, 0, 0], [0, c(pitch), -s(pitch)], [0, s(pitch), c(pitch)]])
        ry = np.array([[c(roll), 0, s(roll)], [0, 1, 0], [-s(roll), 0, c(roll)]])
        axes = camera.pose.rotation_rig_to_camera.T @ np.diag([1.0, -1.0, -1.0])
        # arctan2 near its poles keeps half the digits at worst.
        assert np.abs(rz @ rx @ ry - axes).max() < 1e-7


def test_quaternions_of_half_turns_keep_their_digits() -> None:
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng(2)
    turns = [*(np.pi * axis for axis in np.eye(3)), *(np.pi * v for v in rng.normal(size=(50, 3)))]
    for turn in turns:
        matrix = Rotation.from_rotvec(turn).as_matrix()
        w, x, y, z = quaternion_wxyz(matrix)
        assert w >= 0.0
        again = Rotation.from_quat([x, y, z, w]).as_matrix()
        assert np.abs(again - matrix).max() < 1e-14


def test_meshroom_and_metashape_lens_models_are_ours() -> None:
    """Their published formulas with the exported terms give our distortion."""
    cameras = many_cameras(True)
    points = np.random.default_rng(3).uniform(-0.3, 0.3, size=(20, 2))
    x, y = points.T
    r2 = x * x + y * y
    sfm = json.loads(export_files("meshroom", cameras)["cameras.sfm"])
    root = etree.fromstring(export_files("metashape-xml", cameras)["cameras.xml"])
    sensors = root.iter("sensor")
    for camera, lens, sensor in zip(cameras, sfm["intrinsics"], sensors, strict=True):
        ours = distort(points, camera.camera.distortion)
        k1, k2, k3, t1, t2 = (float(v) for v in lens["distortionParams"])
        radial = 1.0 + k1 * r2 + k2 * r2**2 + k3 * r2**3
        brown = np.column_stack(
            [
                x * radial + t2 * (r2 + 2 * x * x) + 2 * t1 * x * y,
                y * radial + t1 * (r2 + 2 * y * y) + 2 * t2 * x * y,
            ]
        )
        assert np.abs(brown - ours).max() < 1e-12
        k1, k2, k3, p1, p2 = (
            float(sensor.findtext(f"calibration/{tag}")) for tag in ("k1", "k2", "k3", "p1", "p2")
        )
        radial = 1.0 + k1 * r2 + k2 * r2**2 + k3 * r2**3
        agisoft = np.column_stack(
            [
                x * radial + p1 * (r2 + 2 * x * x) + 2 * p2 * x * y,
                y * radial + p2 * (r2 + 2 * y * y) + 2 * p1 * x * y,
            ]
        )
        assert np.abs(agisoft - ours).max() < 1e-12
