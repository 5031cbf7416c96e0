"""From a file of a face, mesh or cloud, to its range image in its own frame."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from common.errors import InputError
from evaluation.recognition.frame import FaceFrame, face_frame
from evaluation.recognition.rangeimage import FACE_GRID, foremost, range_image
from geometry.arrays import Floats, frozen
from geometry.face import nose_tip
from geometry.reading import read_scan
from geometry.sampling import spread
from geometry.scan import Scan
from geometry.scanoptions import ScanOptions

_REACH_MM = 115.0
_PER_MM2 = 3.0
"""Points on a mesh: each place of the grid then has some of its own."""

_MOST_POINTS = 600_000
_FRONT = 0.1


@dataclass(frozen=True, eq=False)
class RangeFace:
    """``depth_mm`` (h, w) on :data:`FACE_GRID`, NaN for holes, in the ``frame`` of the face."""

    depth_mm: Floats
    frame: FaceFrame

    def __post_init__(self) -> None:
        depth = frozen(self.depth_mm)
        if depth.shape != FACE_GRID.shape:
            raise InputError(
                "range-image", f"a range image is {depth.shape}", f"give {FACE_GRID.shape}"
            )
        object.__setattr__(self, "depth_mm", depth)


def read_face(path: Path, options: ScanOptions | None = None) -> RangeFace:
    """The face in a file of any format that :func:`geometry.reading.read_scan` reads.

    Raises :class:`InputError` in one line where there is no face for certain.
    """
    return face_of(read_scan(path, options))


def face_of(scan: Scan) -> RangeFace:
    """The face of a scan; raises :class:`InputError` as :func:`read_face` does."""
    tip = nose_tip(scan)
    axes = np.eye(3) if scan.face is None else scan.face.axes_rig
    return registered(points_near(scan, tip), tip, axes)


def registered(points_mm: Floats, tip_mm: Floats, axes: Floats) -> RangeFace:
    """The face in points (n, 3) that begins from a rough tip (3,) and rough axes (3, 3)."""
    frame = face_frame(points_mm, tip_mm, axes)
    local = frame.local(points_mm)
    return RangeFace(range_image(local[foremost(local, FACE_GRID)], FACE_GRID), frame)


def points_near(scan: Scan, tip_mm: Floats) -> Floats:
    """Points (n, 3) of the front of a scan about the nose tip (3,), even on a mesh."""
    near = np.linalg.norm(scan.vertices_mm - tip_mm, axis=1) <= _REACH_MM
    if scan.is_cloud:
        points = scan.vertices_mm[near]
        return np.asarray(points[:: max(1, len(points) // _MOST_POINTS)])
    corners = near[scan.faces].any(axis=1)
    faces = scan.faces[corners]
    a, b, c = (scan.vertices_mm[faces[:, k]] for k in range(3))
    area_mm2 = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    count = int(np.clip(_PER_MM2 * area_mm2, 1_000, _MOST_POINTS))
    samples = spread(scan.vertices_mm, faces, scan.normals, count)
    # The inside of mouth and nostrils is behind the face.
    return np.asarray(samples.points_mm[samples.normals[:, 1] < -_FRONT])
