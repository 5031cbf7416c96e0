"""Meshes for other programs: PLY and OBJ in the rig frame, GLB for viewers."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np

from evaluation.extras import plyfile
from evaluation.reconstruction.surface import SurfaceMesh
from evaluation.reconstruction.texture import Texture
from geometry.arrays import Ints
from rig.report.scene import GLTF_FROM_RIG

if TYPE_CHECKING:
    from trimesh.visual import TextureVisuals


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


def mesh_glb(mesh: SurfaceMesh, texture: Texture | None = None) -> bytes:
    """GLB in metres with +Y up, as glTF wants it: the texture or vertex colours, and ``_SIGMA_MM``.

    That attribute is the sigma of each vertex.
    """
    # Imported here: trimesh takes a third of a second.
    import trimesh

    vertex, faces = _split(mesh, texture)
    solid = trimesh.Trimesh(
        mesh.vertices_mm[vertex] @ GLTF_FROM_RIG.T,
        faces,
        vertex_normals=mesh.normals[vertex] @ GLTF_FROM_RIG.T * 1000.0,
        vertex_colors=None if texture else mesh.colours,
        vertex_attributes={"_SIGMA_MM": mesh.sigma_mm[vertex].astype(np.float32)},
        visual=_visual(texture),
        process=False,
    )
    scene = trimesh.Scene()
    scene.add_geometry(solid, node_name="face", geom_name="face")
    return bytes(scene.export(file_type="glb"))  # type: ignore[no-untyped-call]


def mesh_obj(mesh: SurfaceMesh, texture: Texture | None = None) -> dict[str, bytes]:
    """OBJ in the rig frame, mm, with normals: ``mesh.obj``, and material and picture of a texture.

    Without one the colours stand behind the places, as most programs read them. Its text has no
    place for sigma.
    """
    # Imported here: trimesh takes a third of a second.
    from trimesh import Trimesh
    from trimesh.exchange.obj import export_obj

    vertex, faces = _split(mesh, texture)
    solid = Trimesh(
        mesh.vertices_mm[vertex],
        faces,
        vertex_normals=mesh.normals[vertex],
        vertex_colors=None if texture else mesh.colours,
        visual=_visual(texture),
        process=False,
    )
    text, files = export_obj(  # type: ignore[no-untyped-call]
        solid,
        include_normals=True,
        include_color=True,
        return_texture=True,
        digits=6,
        mtl_name="mesh.mtl",
    )
    beside = files if texture else {}
    return {"mesh.obj": str(text).encode()} | {name: bytes(data) for name, data in beside.items()}


def _split(mesh: SurfaceMesh, texture: Texture | None) -> tuple[Ints, Ints]:
    """Which vertices are written, and the faces by these."""
    if texture is None:
        return np.arange(len(mesh.vertices_mm)), mesh.faces
    return texture.vertex, texture.faces


def _visual(texture: Texture | None) -> TextureVisuals | None:
    if texture is None:
        return None
    from PIL import Image
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    image = Image.fromarray(texture.image)
    material = PBRMaterial(  # type: ignore[no-untyped-call]
        "mesh", baseColorTexture=image, metallicFactor=0.0, roughnessFactor=1.0
    )
    return TextureVisuals(uv=texture.uv, material=material)  # type: ignore[no-untyped-call]


def mesh_files(mesh: SurfaceMesh, ending: str, texture: Texture | None = None) -> dict[str, bytes]:
    """The files of a mesh by name, ``ending`` ply, glb or obj. PLY has vertex colours always."""
    if ending == "obj":
        return mesh_obj(mesh, texture)
    return {f"mesh.{ending}": mesh_ply(mesh) if ending == "ply" else mesh_glb(mesh, texture)}
