"""Reading a scan file: checked, cleaned, turned and scaled into the rig frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats, Ints
from geometry.cleaning import clean_mesh, drop_not_finite
from geometry.cloud import clean_cloud
from geometry.loading import load_raw
from geometry.sampling import spread
from geometry.scan import Scan, ScanNote, vertex_normals
from geometry.scanoptions import ScanOptions
from geometry.sniffing import check_file
from geometry.standing import Standing, stand

_MAX_COORDINATE_MM = 1e6


def read_scan(path: Path, options: ScanOptions | None = None) -> Scan:
    """The scan in a file, in the rig frame, with notes of what was inferred and changed.

    Reads GLB, glTF, OBJ, PLY, STL, 3MF, OFF and text points (x y z, with or without normals).
    Raises :class:`InputError` (:class:`TooLargeError`, :class:`NotFoundError`) with a remedy for
    every file that cannot be used.
    """
    options = options or ScanOptions()
    kind = check_file(path)
    raw, notes = drop_not_finite(load_raw(path, kind))
    if len(raw.faces):
        mesh = clean_mesh(raw, drop_pieces=options.subject == "head")
        vertices, faces, normals = (
            mesh.vertices,
            mesh.faces,
            vertex_normals(mesh.vertices, mesh.faces),
        )
        notes += mesh.notes
    else:
        vertices, normals, cloud_notes = clean_cloud(raw, closed=options.subject == "head")
        faces = raw.faces
        notes += cloud_notes
    standing = stand(spread(vertices, faces, normals), kind, raw.unit, options)
    return _placed(vertices, faces, normals, standing, notes)


def _placed(
    vertices: Floats,
    faces: Ints,
    normals: Floats,
    standing: Standing,
    notes: tuple[ScanNote, ...],
) -> Scan:
    rotation, scale = standing.rotation_file_to_rig, standing.mm_per_unit
    vertices_mm = scale * vertices @ rotation.T
    if np.abs(vertices_mm).max() > _MAX_COORDINATE_MM:
        problem = "coordinates of the scan lie more than a kilometre from its origin"
        remedy = "move the scan to its origin, check its units and export it again"
        raise InputError("scan-coordinates", problem, remedy)
    rig_from_file = np.eye(4)
    rig_from_file[:3, :3] = scale * rotation
    return Scan(
        vertices_mm,
        faces,
        normals @ rotation.T,
        notes + standing.notes,
        rig_from_file,
        standing.face,
    )
