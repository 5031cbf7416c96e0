"""A GLB scene that holds the cameras, for any 3D program.

glTF: metres, Y up, cameras look along -z with y up and know a field of view but no principal
point and no distortion; those stand in ``extras``. Each camera also has a small pyramid, because
some viewers do not draw cameras.
"""

from __future__ import annotations

import json
import struct

import numpy as np

from geometry.arrays import Floats
from geometry.camera import Camera, LensModel, RigCamera
from geometry.exchange.base import Cameras, ExportOptions, Files, Format, image_name
from geometry.exchange.conventions import (
    GLTF_FROM_RIG_AXES,
    METRES_PER_MM,
    distortion_key,
    graphics_camera_to_rig,
)

MARKER_DEPTH_M = 0.05
NEAR_M, FAR_M = 0.01, 10.0
FACES = np.array([[0, 2, 1], [0, 3, 2], [0, 4, 3], [0, 1, 4], [1, 2, 3], [1, 3, 4]])
FLOAT, UNSIGNED_SHORT = 5126, 5123
VERTICES, INDICES = 34962, 34963
BYTES_PER_MARKER = 5 * 12 + FACES.size * 2 + (-FACES.size * 2) % 4


def _marker(camera: Camera) -> Floats:
    """Vertices (5, 3): apex and corners of the view at the marker's depth, glTF camera axes."""
    half = np.array(camera.sensor_size_mm) / (2.0 * camera.focal_length_mm) * MARKER_DEPTH_M
    corners = np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]]) * half
    return np.vstack([np.zeros(3), np.column_stack([corners, np.full(4, -MARKER_DEPTH_M)])])


def _node_matrix(camera: RigCamera) -> list[float]:
    """Column by column, as glTF wants it."""
    matrix = graphics_camera_to_rig(camera.pose, METRES_PER_MM)
    turned = np.eye(4)
    turned[:3] = GLTF_FROM_RIG_AXES @ matrix[:3]
    return [float(v) + 0.0 for v in turned.T.ravel()]


def _perspective(camera: Camera) -> dict[str, object]:
    width, height = camera.image_size_px
    return {
        "type": "perspective",
        "perspective": {
            "aspectRatio": width / height,
            "yfov": float(2.0 * np.arctan(height / (2.0 * camera.focal_length_px))),
            "znear": NEAR_M,
            "zfar": FAR_M,
        },
    }


def _extras(rig_camera: RigCamera, options: ExportOptions) -> dict[str, object]:
    camera = rig_camera.camera
    return {
        "image": image_name(rig_camera, options),
        "image_size_px": list(camera.image_size_px),
        "camera_matrix": camera.camera_matrix.tolist(),
        distortion_key(camera): camera.distortion.tolist(),
    }


def _accessors(index: int, vertices: Floats) -> list[dict[str, object]]:
    return [
        {
            "bufferView": 2 * index,
            "componentType": FLOAT,
            "count": 5,
            "type": "VEC3",
            "min": vertices.min(axis=0).tolist(),
            "max": vertices.max(axis=0).tolist(),
        },
        {
            "bufferView": 2 * index + 1,
            "componentType": UNSIGNED_SHORT,
            "count": FACES.size,
            "type": "SCALAR",
        },
    ]


def _views(index: int) -> list[dict[str, object]]:
    start = index * BYTES_PER_MARKER
    return [
        {"buffer": 0, "byteOffset": start, "byteLength": 60, "target": VERTICES},
        {"buffer": 0, "byteOffset": start + 60, "byteLength": FACES.size * 2, "target": INDICES},
    ]


def _nodes(index: int, camera: RigCamera, options: ExportOptions) -> list[dict[str, object]]:
    """The camera, and below it its pyramid: a node with both confuses readers."""
    return [
        {
            "name": camera.name,
            "camera": index,
            "matrix": _node_matrix(camera),
            "extras": _extras(camera, options),
            "children": [2 * index + 1],
        },
        {"name": f"{camera.name}/view", "mesh": index},
    ]


def _document(cameras: Cameras, options: ExportOptions, markers: list[Floats]) -> dict[str, object]:
    numbered = list(enumerate(cameras))
    return {
        "asset": {"version": "2.0", "generator": "Rigwright"},
        "scene": 0,
        "scenes": [{"nodes": [2 * index for index, _ in numbered]}],
        "nodes": [node for index, camera in numbered for node in _nodes(index, camera, options)],
        "cameras": [{"name": c.name, **_perspective(c.camera)} for c in cameras],
        "meshes": [
            {
                "name": f"{camera.name}/view",
                "primitives": [{"attributes": {"POSITION": 2 * i}, "indices": 2 * i + 1}],
            }
            for i, camera in numbered
        ],
        "accessors": [a for i, vertices in enumerate(markers) for a in _accessors(i, vertices)],
        "bufferViews": [view for index, _ in numbered for view in _views(index)],
        "buffers": [{"byteLength": len(cameras) * BYTES_PER_MARKER}],
    }


def _chunk(kind: bytes, data: bytes, filler: bytes) -> bytes:
    data += filler * (-len(data) % 4)
    return struct.pack("<I4s", len(data), kind) + data


def write(cameras: Cameras, options: ExportOptions) -> Files:
    """``cameras.glb``."""
    markers = [_marker(camera.camera).astype("<f4") for camera in cameras]
    indices = FACES.astype("<u2").tobytes()
    indices += b"\0" * (-len(indices) % 4)
    document = json.dumps(_document(cameras, options, markers), ensure_ascii=False)
    body = _chunk(b"JSON", document.encode(), b" ")
    body += _chunk(b"BIN\0", b"".join(m.tobytes() + indices for m in markers), b"\0")
    return {"cameras.glb": struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body}


FORMAT = Format(
    "gltf",
    "Blender and any 3D program",
    "a GLB scene with the cameras",
    ("cameras.glb",),
    write,
    tuple(LensModel),
)
