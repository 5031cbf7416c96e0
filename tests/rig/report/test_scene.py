"""The GLB scene, read back by a reader of its own and by trimesh."""

from __future__ import annotations

import io
import json
import struct

import numpy as np
import pytest
import trimesh

from geometry.raycast import Occluder
from geometry.subject import Subject
from geometry.viewmesh import simplified
from rig.report.scene import frustum_corners_mm, scene_glb
from solver.result import Design


@pytest.fixture(scope="module")
def glb(design: Design, subject: Subject) -> bytes:
    return scene_glb(design.cameras, subject.occluder)


def header(glb: bytes) -> dict[str, object]:
    """The JSON chunk, by the letter of the GLB 2.0 container format."""
    magic, version, length = struct.unpack_from("<4sII", glb)
    assert (magic, version, length) == (b"glTF", 2, len(glb))
    size, kind = struct.unpack_from("<I4s", glb, 12)
    assert kind == b"JSON" and size % 4 == 0
    binary_size, binary_kind = struct.unpack_from("<I4s", glb, 20 + size)
    assert binary_kind == b"BIN\0" and 20 + size + 8 + binary_size == len(glb)
    return dict(json.loads(glb[20 : 20 + size]))


def test_the_container_is_valid_and_the_nodes_have_names(glb: bytes, design: Design) -> None:
    document = header(glb)
    assert document["asset"]["version"] == "2.0"
    names = {node.get("name") for node in document["nodes"]}
    wanted = {f"{c.name}/{part}" for c in design.cameras for part in ("body", "lens", "view")}
    assert wanted | {"head"} <= names


def test_cameras_stand_where_they_should_in_metres_y_up(glb: bytes, design: Design) -> None:
    scene = trimesh.load(io.BytesIO(glb), file_type="glb")
    for camera in design.cameras:
        transform, _ = scene.graph.get(f"{camera.name}/body")
        x, y, z = camera.pose.position_rig_mm / 1000.0
        # GLB stores single precision: 1e-6 m at 1 m.
        assert np.allclose(transform[:3, 3], [x, z, -y], atol=1e-6)
        gx, gy, gz = camera.pose.axis_rig
        assert np.allclose(transform[:3, 2], [gx, gz, -gy], atol=1e-6), "looks along its own z"
        assert np.linalg.det(transform[:3, :3]) == pytest.approx(1.0, abs=1e-5)


def test_the_head_has_its_size_and_faces_plus_z(glb: bytes, subject: Subject) -> None:
    scene = trimesh.load(io.BytesIO(glb), file_type="glb")
    head = scene.geometry["head"]
    low, high = subject.occluder.vertices_mm.min(axis=0), subject.occluder.vertices_mm.max(axis=0)
    width, depth, height = (high - low) / 1000.0
    assert np.allclose(np.ptp(head.vertices, axis=0), [width, height, depth], atol=1e-5)
    assert head.vertices[:, 2].max() == pytest.approx(-low[1] / 1000.0, abs=1e-5), "the nose"


def test_bodies_have_their_size(glb: bytes) -> None:
    scene = trimesh.load(io.BytesIO(glb), file_type="glb")
    body = scene.geometry["cam01/body"]
    assert np.allclose(np.ptp(body.vertices, axis=0), [0.062, 0.045, 0.032], atol=1e-6)
    lens = scene.geometry["cam01/lens"]
    assert np.allclose(np.ptp(lens.vertices, axis=0), [0.030, 0.030, 0.025], atol=1e-4)


def test_views_end_at_the_image_corners(design: Design) -> None:
    camera = design.cameras[2]
    pixels, depth = camera.camera.project(camera.pose, frustum_corners_mm(camera, 500.0))
    width, height = camera.camera.image_size_px
    corners = [[-0.5, -0.5], [width - 0.5, -0.5], [width - 0.5, height - 0.5], [-0.5, height - 0.5]]
    assert np.allclose(pixels, corners, atol=1e-6) and np.allclose(depth, 500.0)


def test_a_scene_without_a_mesh(design: Design) -> None:
    names = {
        node.get("name") for node in header(scene_glb(design.cameras, Occluder.none()))["nodes"]
    }
    assert "head" not in names and "cam01/body" in names


def test_a_lighter_mesh_keeps_its_shape(subject: Subject) -> None:
    occluder = subject.occluder
    vertices, faces = simplified(occluder.vertices_mm, occluder.faces, 1000)
    assert 300 < len(faces) <= 1000
    light, full = (
        trimesh.Trimesh(vertices, faces),
        trimesh.Trimesh(occluder.vertices_mm, occluder.faces),
    )
    assert np.allclose(light.extents, full.extents, rtol=0.06)
    same, kept = simplified(occluder.vertices_mm, occluder.faces, len(occluder.faces))
    assert same is occluder.vertices_mm and kept is occluder.faces
