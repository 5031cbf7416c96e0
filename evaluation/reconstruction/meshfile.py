"""Meshes for other programs: PLY and OBJ in the rig frame, GLB for viewers."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping

import numpy as np

from evaluation.extras import plyfile
from evaluation.reconstruction.surface import SurfaceMesh
from rig.report.scene import GLTF_FROM_RIG


def mesh_ply(mesh: SurfaceMesh) -> bytes:
    """Binary PLY in the rig frame, mm: x y z nx ny nz red green blue sigma_mm, and triangles."""
    ply = plyfile()
    kinds = [(n, "<f8") for n in "xyz"] + [(n, "<f4") for n in ("nx", "ny", "nz")]
    kinds += [(n, "u1") for n in ("red", "green", "blue")] + [("sigma_mm", "<f4")]
    rows = np.empty(len(mesh.vertices_mm), dtype=kinds)
    for k, (axis, colour) in enumerate(zip("xyz", ("red", "green", "blue"), strict=True)):
        rows[axis], rows["n" + axis] = mesh.vertices_mm[:, k], mesh.normals[:, k]
        rows[colour] = mesh.colours[:, k]
    rows["sigma_mm"] = mesh.sigma_mm
    faces = np.empty(len(mesh.faces), dtype=[("vertex_indices", "<i4", (3,))])
    faces["vertex_indices"] = mesh.faces
    stream = io.BytesIO()
    describe = ply.PlyElement.describe
    ply.PlyData([describe(rows, "vertex"), describe(faces, "face")], byte_order="<").write(stream)
    return stream.getvalue()


def mesh_glb(mesh: SurfaceMesh) -> bytes:
    """GLB in metres with +Y up, as glTF wants it: vertex colours, and sigma as ``_SIGMA_MM``."""
    # Imported here: trimesh takes a third of a second.
    import trimesh

    solid = trimesh.Trimesh(
        mesh.vertices_mm @ GLTF_FROM_RIG.T,
        mesh.faces,
        vertex_normals=mesh.normals @ GLTF_FROM_RIG.T * 1000.0,
        vertex_colors=mesh.colours,
        vertex_attributes={"_SIGMA_MM": mesh.sigma_mm.astype(np.float32)},
        process=False,
    )
    scene = trimesh.Scene()
    scene.add_geometry(solid, node_name="face", geom_name="face")
    return bytes(scene.export(file_type="glb"))  # type: ignore[no-untyped-call]


def mesh_obj(mesh: SurfaceMesh) -> bytes:
    """OBJ in the rig frame, mm: normals, and colours behind the places as most programs read them.

    Its text has no place for sigma.
    """
    # Imported here: trimesh takes a third of a second.
    from trimesh import Trimesh
    from trimesh.exchange.obj import export_obj

    solid = Trimesh(
        mesh.vertices_mm,
        mesh.faces,
        vertex_normals=mesh.normals,
        vertex_colors=mesh.colours,
        process=False,
    )
    text = export_obj(  # type: ignore[no-untyped-call]
        solid, include_normals=True, include_color=True, digits=6
    )
    return str(text).encode()


MESHES: Mapping[str, Callable[[SurfaceMesh], bytes]] = {
    "ply": mesh_ply,
    "glb": mesh_glb,
    "obj": mesh_obj,
}
"""How a mesh is written, by the ending of its file."""
