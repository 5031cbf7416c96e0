"""The reference surface from a mesh file, as it is: no cleaning, no moving, no scaling."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from common.errors import InputError, NotFoundError
from evaluation.comparison.distances import Reference

SUFFIXES = (".ply", ".obj", ".stl", ".off", ".glb", ".gltf", ".3mf")
LARGEST_BYTES = 1_000_000_000


def read_reference(path: Path) -> Reference:
    """The triangles of a mesh file, in the file's own unit and frame.

    Raises :class:`InputError` in one line for what holds none.
    """
    # Imported here: trimesh takes a third of a second.
    import trimesh

    if not path.is_file():
        what = f"{path} is a folder" if path.is_dir() else f"there is no file {path}"
        raise NotFoundError("reference", what, "check the path")
    if path.suffix.lower() not in SUFFIXES or path.stat().st_size > LARGEST_BYTES:
        raise InputError(
            "reference-file",
            f"{path.name} is no mesh file of at most 1 GB",
            f"give one of {', '.join(s[1:].upper() for s in SUFFIXES)}",
        )
    try:
        mesh = trimesh.load_scene(path, process=False).to_mesh()
        vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    except Exception as error:
        raise InputError(
            "reference-file", f"{path.name} cannot be read as a mesh", "export it again as PLY"
        ) from error
    return Reference(vertices, faces.reshape(-1, 3))
