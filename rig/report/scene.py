"""The rig as a GLB scene: head, bodies, lenses and views, for any 3D viewer.

glTF is in metres with +Y up and +Z to the front of the subject. This module is the only one
that leaves the rig frame and millimetres for that.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from geometry.arrays import Floats
from geometry.camera import RigCamera
from geometry.frames import Pose
from geometry.raycast import Occluder
from geometry.viewmesh import simplified

if TYPE_CHECKING:
    import trimesh

GLTF_FROM_RIG = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]) / 1000.0
"""Maps the rig frame (mm, Z up, face along -Y) to glTF (m, Y up, face along +Z)."""

MOST_FACES = 120_000
HEAD_RGBA = (214, 196, 182, 255)
BODY_RGBA = (52, 58, 68, 255)
FIXED_RGBA = (120, 92, 48, 255)
LENS_RGBA = (24, 26, 30, 255)
VIEW_RGBA = (64, 132, 214, 255)
VIEW_EDGE_SHARE = 0.004
"""Thickness of a view's edges as a share of their length: visible, yet not in the way."""


def frustum_corners_mm(rig_camera: RigCamera, depth_mm: float) -> Floats:
    """Corners (4, 3) of the image at ``depth_mm`` in the rig frame: clockwise from the top left."""
    left, right, top, bottom = rig_camera.camera.frame_limits()
    plane = np.array(
        [[left, top, 1.0], [right, top, 1.0], [right, bottom, 1.0], [left, bottom, 1.0]]
    )
    return rig_camera.pose.to_rig(plane * depth_mm)


def scene_glb(cameras: tuple[RigCamera, ...], occluder: Occluder) -> bytes:
    """The scene as GLB bytes.

    Nodes: ``head`` and, per camera, ``<name>/body``, ``<name>/lens`` and ``<name>/view``, whose
    frames are the cameras' own. Views reach to the focus distance.
    """
    # trimesh takes half a second to import; --help and evaluations do without it.
    import trimesh

    scene = trimesh.Scene()
    if len(occluder.faces):
        vertices, faces = simplified(occluder.vertices_mm, occluder.faces, MOST_FACES)
        head = trimesh.Trimesh(vertices @ GLTF_FROM_RIG.T, faces, process=False)
        _paint(head, HEAD_RGBA)
        scene.add_geometry(head, node_name="head", geom_name="head")
    for camera in cameras:
        transform = _gltf_transform(camera.pose)
        for part, mesh in _camera_meshes(camera):
            name = f"{camera.name}/{part}"
            scene.add_geometry(mesh, node_name=name, geom_name=name, transform=transform)
    return bytes(scene.export(file_type="glb"))  # type: ignore[no-untyped-call]


def _gltf_transform(pose: Pose) -> Floats:
    """Node matrix (4, 4): camera frame in metres to the glTF world."""
    transform = np.eye(4)
    transform[:3, :3] = GLTF_FROM_RIG @ pose.rotation_rig_to_camera.T * 1000.0
    transform[:3, 3] = GLTF_FROM_RIG @ pose.position_rig_mm
    return transform


def _paint(mesh: trimesh.Trimesh, rgba: tuple[int, int, int, int]) -> None:
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    material = PBRMaterial(  # type: ignore[no-untyped-call]
        baseColorFactor=rgba, metallicFactor=0.0, roughnessFactor=0.8, doubleSided=True
    )
    mesh.visual = TextureVisuals(material=material)  # type: ignore[no-untyped-call]


def _camera_meshes(camera: RigCamera) -> list[tuple[str, trimesh.Trimesh]]:
    """Body, lens and view in the camera frame, metres."""
    from trimesh.creation import box, cylinder

    body = camera.camera.body
    solid = box(extents=body.size_mm / 1000.0)
    solid.apply_translation(body.centre_camera_mm / 1000.0)
    _paint(solid, FIXED_RGBA if camera.fixed else BODY_RGBA)
    meshes = [("body", solid)]
    if body.lens_diameter_mm > 0.0 and body.lens_length_mm > 0.0:
        ends = np.array(
            [[0.0, 0.0, body.front_z_mm], [0.0, 0.0, body.front_z_mm + body.lens_length_mm]]
        )
        lens = cylinder(radius=body.lens_diameter_mm / 2000.0, segment=ends / 1000.0, sections=48)
        _paint(lens, LENS_RGBA)
        meshes.append(("lens", lens))
    view = _view_mesh(camera)
    _paint(view, VIEW_RGBA)
    return [*meshes, ("view", view)]


def _view_mesh(camera: RigCamera) -> trimesh.Trimesh:
    """The edges of the view as thin bars: many viewers do not draw lines."""
    from trimesh import util
    from trimesh.creation import cylinder

    corners = camera.pose.to_camera(frustum_corners_mm(camera, camera.focus_distance_mm)) / 1000.0
    apex = np.zeros(3)
    edges = [(apex, corner) for corner in corners]
    edges += [(corners[k], corners[(k + 1) % 4]) for k in range(4)]
    radius = camera.focus_distance_mm / 1000.0 * VIEW_EDGE_SHARE / 2.0
    bars = [cylinder(radius=radius, segment=np.array(edge), sections=6) for edge in edges]
    return util.concatenate(bars)  # type: ignore[return-value]
