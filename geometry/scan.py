"""A scan: the surface of a subject in the rig frame."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats, Ints, frozen, frozen_ints
from geometry.raycast import Occluder

_SURFEL_SIZE = 0.75
"""Half the width of a surfel, as a share of the median distance to the nearest neighbour."""


@dataclass(frozen=True)
class ScanNote:
    """Something about a scan that its owner should know.

    ``kind``: ``inferred`` (units, axes: not given, so guessed), ``changed`` (cleaned away or
    repaired) or ``warning`` (usable, but look at it).
    """

    kind: Literal["inferred", "changed", "warning"]
    text: str


@dataclass(frozen=True, eq=False)
class FacePlace:
    """Where the face is: ``nose_tip_mm`` (3,) in the rig frame.

    ``axes_rig`` (3, 3) has the face's own axes as rows: to the subject's left, into the head, up;
    near the identity for a face that looks straight at the cameras. ``confidence`` is 0 to 1.
    """

    nose_tip_mm: Floats
    axes_rig: Floats
    confidence: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "nose_tip_mm", frozen(self.nose_tip_mm))
        object.__setattr__(self, "axes_rig", frozen(self.axes_rig))


@dataclass(frozen=True, eq=False)
class Scan:
    """``vertices_mm`` (V, 3) in the rig frame with outward unit ``normals`` (V, 3).

    ``faces`` (F, 3) are wound counter-clockwise seen from outside; none make it a point cloud.
    ``rig_from_file`` (4, 4) maps homogeneous coordinates of the file to the rig frame, mm.
    ``face`` is None when none was looked for or found for certain.
    Raises :class:`InputError` when the arrays do not fit together.
    """

    vertices_mm: Floats
    faces: Ints
    normals: Floats
    notes: tuple[ScanNote, ...] = ()
    rig_from_file: Floats = field(default_factory=lambda: np.eye(4))
    face: FacePlace | None = None

    def __post_init__(self) -> None:
        vertices, normals = frozen(self.vertices_mm), frozen(self.normals)
        faces = frozen_ints(np.reshape(self.faces, (-1, 3)))
        remedy = "give V x 3 finite vertices, a unit normal for each, and faces that index them"
        if vertices.ndim != 2 or vertices.shape[1:] != (3,) or normals.shape != vertices.shape:
            raise InputError("scan-shape", "a scan has arrays of the wrong shape", remedy)
        if len(vertices) == 0:
            raise InputError("scan-empty", "the scan is empty", "export it again with its geometry")
        if not (np.isfinite(vertices).all() and np.isfinite(normals).all()):
            raise InputError("scan-not-finite", "a scan holds NaN or infinity", remedy)
        if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
            raise InputError("scan-faces", "faces of a scan refer to vertices it lacks", remedy)
        if np.abs(np.linalg.norm(normals, axis=1) - 1.0).max() > 1e-6:
            raise InputError("scan-normals", "the normals of a scan are not unit vectors", remedy)
        object.__setattr__(self, "vertices_mm", vertices)
        object.__setattr__(self, "faces", faces)
        object.__setattr__(self, "normals", normals)
        object.__setattr__(self, "rig_from_file", frozen(self.rig_from_file))

    @property
    def is_cloud(self) -> bool:
        """Whether the scan has points only."""
        return len(self.faces) == 0

    @property
    def extents_mm(self) -> Floats:
        """Width (x), depth (y) and height (z), (3,)."""
        return np.asarray(np.ptp(self.vertices_mm, axis=0))

    def occluder(self) -> Occluder:
        """What of the scan can stand in the way of a line of sight.

        A cloud is covered with surfels: a square per point, square to its normal and wide
        enough to leave no gap to its neighbours.
        """
        if not self.is_cloud:
            return Occluder(self.vertices_mm, self.faces)
        return _surfels(self.vertices_mm, self.normals)


def vertex_normals(vertices: Floats, faces: Ints) -> Floats:
    """Unit normals (V, 3), the area-weighted mean over the faces around each vertex."""
    corners = vertices[faces]
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = np.stack(
        [
            sum(
                (np.bincount(faces[:, k], doubled[:, axis], len(vertices)) for k in range(3)),
                start=np.zeros(len(vertices)),
            )
            for axis in range(3)
        ],
        axis=1,
    )
    length = np.linalg.norm(total, axis=1, keepdims=True)
    # A vertex whose faces cancel out has no direction of its own; any unit vector will do there.
    return np.where(length > 1e-30, total / np.maximum(length, 1e-30), np.array([0.0, 0.0, 1.0]))


def _surfels(points_mm: Floats, normals: Floats) -> Occluder:
    """A square for each point, square to its normal."""
    # Imported here: SciPy's trees take time that users of meshes need not pay for.
    from scipy.spatial import cKDTree

    if len(points_mm) < 2:
        return Occluder.none()
    distance, _ = cKDTree(points_mm).query(points_mm, k=2)
    half = _SURFEL_SIZE * float(np.median(np.asarray(distance)[:, 1]))
    # The axis least along the normal never vanishes in the cross product.
    helper = np.eye(3)[np.abs(normals).argmin(axis=1)]
    side = np.cross(normals, helper)
    side *= half / np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(normals, side)
    corners = np.stack([side + up, up - side, -side - up, side - up], axis=1)
    vertices = (points_mm[:, None] + corners).reshape(-1, 3)
    first = 4 * np.arange(len(points_mm))[:, None, None]
    faces = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    # On a curved surface neighbouring squares stand a little proud of each other; a ray that
    # starts lower than that would end on the next square.
    return Occluder(vertices, faces, lift_mm=1.1 * half)
