"""Every export against numbers worked out by hand.

The rig is that of ``exchange_rigs.hand_rig``. Its front camera stands at C = (0, -1000, 200) mm and
looks along +Y, level, so its axes are

    x = (1, 0, 0)   y (down) = (0, 0, -1)   z (forward) = (0, 1, 0)      the rows of R1
    T1 = -R1 C = (0, 200, 1000) mm

Its side camera stands at (1000, 0, 200) mm and looks along -X:

    x = (0, 1, 0)   y (down) = (0, 0, -1)   z (forward) = (-1, 0, 0)     the rows of R2
    T2 = -R2 C = (0, 200, 1000) mm

The point P = (50, 0, 175) mm is at (50, 25, 1000) mm in the front camera, so with f = 400 px it is
(20, 10) px from the principal point: (229.5, 104.5) with pixel centres at integers, (230, 105) with
the image's corner at (0, 0).
"""

from __future__ import annotations

import csv
import json
import struct

import numpy as np
import pytest
from exchange_rigs import hand_rig
from lxml import etree

from geometry.camera import RigCamera
from geometry.exchange import ExportOptions, export_files
from geometry.frames import Pose

HALF = float(np.sqrt(0.5))
DISTORTION = (0.01, 0.02, 0.003, 0.004, 0.005)
"""k1, k2, p1, p2, k3"""


def test_the_rig_is_as_described() -> None:
    front = hand_rig()[0]
    pixels, depths = front.camera.project(front.pose, np.array([[50.0, 0.0, 175.0]]))
    assert depths[0] == 1000.0
    assert np.allclose(pixels, [[229.5, 104.5]], rtol=0.0, atol=1e-12)


def text_line(name: str, index: int = 0, distortion: tuple[float, ...] = (0.0,) * 5) -> list[str]:
    text = export_files("colmap-text", hand_rig(distortion))[name].decode()
    return [line for line in text.splitlines() if not line.startswith("#")][index].split()


def test_colmap_has_the_corner_at_zero() -> None:
    # 209.5 + 0.5 = 210, 94.5 + 0.5 = 95.
    assert text_line("cameras.txt") == [
        "1",
        "PINHOLE",
        "400",
        "200",
        "400.0",
        "400.0",
        "210.0",
        "95.0",
    ]
    radial = text_line("cameras.txt", 1, (0.01, 0.02, 0.003, 0.004, 0.0))
    assert radial[1:2] + radial[-4:] == ["OPENCV", "0.01", "0.02", "0.003", "0.004"]
    full = text_line("cameras.txt", 0, DISTORTION)
    assert full[1] == "FULL_OPENCV"
    assert full[8:] == ["0.01", "0.02", "0.003", "0.004", "0.005", "0.0", "0.0", "0.0"]


def test_colmap_poses_map_the_world_to_the_camera_in_metres() -> None:
    # R1 is a turn by +90 degrees about x: w = x = sqrt(1/2). T1 in metres: (0, 0.2, 1).
    image = text_line("images.txt")
    assert np.allclose([float(v) for v in image[1:8]], [HALF, HALF, 0, 0, 0, 0.2, 1.0], atol=1e-15)
    assert image[8:] == ["1", "front.png"]
    assert text_line("images.txt", 2)[-1] == "side_one.png", "its name must not hold a blank"


def test_colmap_rig_and_frame() -> None:
    # The rig's frame is the front camera's. R2 R1' = ((0,0,1),(0,1,0),(-1,0,0)) is a turn by +90
    # degrees about y; R2 (C1 - C2) = R2 (-1000, -1000, 0) = (-1000, 0, 1000) mm.
    rig = text_line("rigs.txt")
    assert rig[:7] == ["1", "2", "CAMERA", "1", "CAMERA", "2", "1"]
    assert np.allclose([float(v) for v in rig[7:]], [HALF, 0, HALF, 0, -1.0, 0, 1.0], atol=1e-15)
    frame = text_line("frames.txt")
    assert frame[:2] == ["1", "1"]
    assert np.allclose([float(v) for v in frame[2:9]], [HALF, HALF, 0, 0, 0, 0.2, 1.0], atol=1e-15)
    assert frame[9:] == ["2", "CAMERA", "1", "1", "CAMERA", "2", "2"]


def test_nerfstudio() -> None:
    # Columns of the matrix: x, y up, z backward, position in metres.
    document = json.loads(export_files("nerfstudio", hand_rig(DISTORTION))["transforms.json"])
    frame = document["frames"][0]
    assert document["camera_model"] == "OPENCV"
    assert frame["transform_matrix"] == [[1, 0, 0, 0], [0, 0, -1, -1], [0, 1, 0, 0.2], [0, 0, 0, 1]]
    assert [frame[key] for key in ("fl_x", "fl_y", "cx", "cy", "w", "h")] == [
        *(400.0, 400.0, 210.0, 95.0),
        *(400, 200),
    ]
    assert [frame[key] for key in ("k1", "k2", "p1", "p2", "k3")] == list(DISTORTION)
    assert frame["file_path"] == "images/front.png"


def test_metashape_xml() -> None:
    # Columns: x, y down, z forward. cx, cy count from the middle: 210 - 200, 95 - 100.
    # Metashape: dx = P1 (r2 + 2 x2) + 2 P2 x y, so its P1 is OpenCV's p2.
    root = etree.fromstring(export_files("metashape-xml", hand_rig(DISTORTION))["cameras.xml"])
    camera = root.find("chunk/cameras/camera")
    transform = camera.findtext("transform")
    expected = [[1, 0, 0, 0], [0, 0, 1, -1], [0, -1, 0, 0.2], [0, 0, 0, 1]]
    assert np.array(transform.split(), float).reshape(4, 4).tolist() == expected
    assert camera.get("label") == "front"
    values = {leaf.tag: leaf.text for leaf in root.find("chunk/sensors/sensor/calibration")}
    assert (values["f"], values["cx"], values["cy"]) == ("400.0", "10.0", "-5.0")
    assert [values[k] for k in ("k1", "k2", "k3")] == ["0.01", "0.02", "0.005"]
    assert (values["p1"], values["p2"]) == ("0.004", "0.003")
    sensor = root.find("chunk/sensors/sensor")
    assert sensor.find("resolution").attrib == {"width": "400", "height": "200"}


def test_metashape_reference() -> None:
    # Survey angles: all zero looks down with north (+Y) at the top; pitch 90 lifts the view to the
    # horizon; yaw is the heading, so west (-X) is -90. As omega, phi, kappa the front camera is
    # (90, 0, 0): the nadir camera turned about X. The side camera is then turned by +90 about Z
    # (towards west), which leaves omega 90 and makes phi 90.
    down = Pose([0.0, 0.0, 1500.0], [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])
    front, side = hand_rig()
    rig = (front, side, RigCamera("down", front.camera, down, 1500.0))
    text = export_files("metashape-csv", rig)["reference.csv"].decode()
    header, *rows = csv.reader(text.splitlines())
    assert header[:4] == ["label", "x_m", "y_m", "z_m"]
    assert [row[0] for row in rows] == ["front", "side_one", "down"]
    values = np.array([row[1:] for row in rows], float)
    assert values[:, :3].tolist() == [[0, -1, 0.2], [1, 0, 0.2], [0, 0, 1.5]]
    assert np.allclose(values[:, 3:6], [[0, 90, 0], [-90, 90, 0], [0, 0, 0]], atol=1e-12)
    assert np.allclose(values[0, 6:], [90, 0, 0], atol=1e-12)
    assert np.allclose(values[2, 6:], [0, 0, 0], atol=1e-12)
    assert abs(values[1, 7]) == pytest.approx(90.0)


def test_realityscan() -> None:
    # f = 400 px of a longer side of 400 px: 36 mm. U = 10 / 400, V = -5 / 400.
    # Terms: k1, k2, k3, k4, t1 = p2, t2 = p1.
    files = export_files("realityscan", hand_rig(DISTORTION))
    assert set(files) == {"front.xmp", "side_one.xmp"}
    xcr = "{http://www.capturingreality.com/ns/xcr/1.1#}"
    (told,) = etree.fromstring(files["front.xmp"]).iter(
        "{http://www.w3.org/1999/02/22-rdf-syntax-ns#}Description"
    )
    assert told.get(f"{xcr}FocalLength35mm") == "36.0"
    assert told.get(f"{xcr}PrincipalPointU") == "0.025"
    assert told.get(f"{xcr}PrincipalPointV") == "-0.0125"
    assert told.get(f"{xcr}DistortionModel") == "brown3t2"
    assert told.findtext(f"{xcr}Rotation") == "1.0 0.0 0.0 0.0 0.0 -1.0 0.0 1.0 0.0"
    assert told.findtext(f"{xcr}Position").split() == ["0.0", "-1.0", "0.2"]
    terms = told.findtext(f"{xcr}DistortionCoeficients").split()
    assert terms == ["0.01", "0.02", "0.005", "0.0", "0.004", "0.003"]
    assert told.get(f"{xcr}PosePrior") == "initial"


def test_realityscan_is_told_how_far_it_may_move_a_camera() -> None:
    xmp = export_files("realityscan", hand_rig(), ExportOptions(pose_prior="locked"))["front.xmp"]
    assert 'xcr:PosePrior="locked"' in xmp.decode()


def test_meshroom() -> None:
    # Rotation column by column: (1,0,0), (0,0,1), (0,-1,0). The principal point with pixel centres
    # at integers, from (200, 100): 209.5 - 200 and 94.5 - 100. Sensor 400 x 0.01 mm = 4 mm.
    document = json.loads(export_files("meshroom", hand_rig(DISTORTION))["cameras.sfm"])
    pose = document["poses"][0]["pose"]["transform"]
    assert [float(v) for v in pose["rotation"]] == [1, 0, 0, 0, 0, 1, 0, -1, 0]
    assert [float(v) for v in pose["center"]] == [0.0, -1.0, 0.2]
    lens = document["intrinsics"][0]
    assert (float(lens["focalLength"]), float(lens["sensorWidth"])) == (4.0, 4.0)
    assert [float(v) for v in lens["principalPoint"]] == [9.5, -5.5]
    assert lens["type"] == "brown"
    # k1, k2, k3, t1, t2 with t1 = p1, t2 = p2.
    assert [float(v) for v in lens["distortionParams"]] == [0.01, 0.02, 0.005, 0.003, 0.004]
    view = document["views"][1]
    assert (view["path"], view["poseId"], view["intrinsicId"]) == ("side_one.png", "2", "2")


def test_opencv_keeps_millimetres_and_pixel_centres_at_integers() -> None:
    text = export_files("opencv", hand_rig())["cameras.yml"].decode()
    assert text.startswith("%YAML:1.0\n---\n")
    assert "data: [ 400.0, 0.0, 209.5, 0.0, 400.0, 94.5, 0.0, 0.0, 1.0 ]" in text
    assert "data: [ 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0 ]" in text
    assert "data: [ 0.0, 200.0, 1000.0 ]" in text


def glb_json(data: bytes) -> dict:
    magic, version, length, size, kind = struct.unpack("<4sIII4s", data[:20])
    assert (magic, version, length, kind) == (b"glTF", 2, len(data), b"JSON")
    return json.loads(data[20 : 20 + size])


def test_gltf() -> None:
    # (x, y, z) of the rig is (x, z, -y) in glTF: C becomes (0, 0.2, 1) m. Looking along +Y is
    # looking along glTF's -z with y up, which is a camera that is not turned at all.
    document = glb_json(export_files("gltf", hand_rig(DISTORTION))["cameras.glb"])
    front = document["nodes"][0]
    assert front["matrix"] == [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0.2, 1, 1]
    view = document["cameras"][0]["perspective"]
    assert view["aspectRatio"] == 2.0
    # Half the height, 100 px, over f = 400 px.
    assert view["yfov"] == pytest.approx(2.0 * np.arctan(0.25))
    assert front["extras"]["distortion_k1_k2_p1_p2_k3"] == list(DISTORTION)
    assert document["nodes"][2]["name"] == "side one"


def test_blender() -> None:
    # The principal point is 10 px right of the middle: the view is shifted left by 10 of 400 image
    # widths. It is 5 px above the middle: the view is shifted down.
    script = export_files("blender", hand_rig())["cameras_blender.py"].decode()
    compile(script, "cameras_blender.py", "exec")
    data = json.loads(script.split('r"""\n')[1].split('\n"""')[0])
    front = data[0]
    assert front["matrix_world"] == [[1, 0, 0, 0], [0, 0, -1, -1], [0, 1, 0, 0.2], [0, 0, 0, 1]]
    assert (front["shift_x"], front["shift_y"]) == (-0.025, -0.0125)
    assert (front["focal_length_mm"], front["sensor_width_mm"]) == (4.0, 4.0)
    assert front["focus_distance_m"] == 1.0


def test_usd() -> None:
    # Centimetres: C is (0, -100, 20). The aperture is moved by -10 and -5 pixels of 0.01 mm.
    pytest.importorskip("pxr")
    text = export_files("usd", hand_rig())["cameras.usda"].decode()
    matrix = "( (1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, -100, 20, 1) )"
    assert f"xformOp:transform = {matrix}" in text
    for line in (
        *("float horizontalAperture = 4", "float verticalAperture = 2"),
        *("float horizontalApertureOffset = -0.1", "float verticalApertureOffset = -0.05"),
        *("float focalLength = 4", "float focusDistance = 100"),
        *("metersPerUnit = 0.01", 'upAxis = "Z"', 'def Camera "side_one"'),
    ):
        assert line in text
