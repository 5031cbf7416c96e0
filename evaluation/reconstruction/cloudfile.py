"""Clouds as PLY: ours written, and those of other programs read as they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from common.errors import InputError, NotFoundError
from common.files.writing import write_whole
from evaluation.extras import plyfile
from evaluation.reconstruction.cloud import Cloud
from geometry.arrays import Floats

LARGEST_BYTES = 2_000_000_000


def cloud_ply(cloud: Cloud) -> bytes:
    """The cloud as binary PLY: x y z nx ny nz red green blue sigma_mm views.

    Places as doubles: at head size a float keeps a hundred-thousandth of a millimetre, but other
    programs shift their coordinates.
    """
    import io

    ply = plyfile()
    kinds = [(n, "<f8") for n in "xyz"] + [(n, "<f4") for n in ("nx", "ny", "nz")]
    kinds += [(n, "u1") for n in ("red", "green", "blue")] + [("sigma_mm", "<f4"), ("views", "u1")]
    rows = np.empty(len(cloud), dtype=kinds)
    for k, name in enumerate("xyz"):
        rows[name] = cloud.points_mm[:, k]
        rows["n" + name] = cloud.normals[:, k]
    for k, name in enumerate(("red", "green", "blue")):
        rows[name] = cloud.colours[:, k]
    rows["sigma_mm"], rows["views"] = cloud.sigma_mm, cloud.views
    stream = io.BytesIO()
    ply.PlyData([ply.PlyElement.describe(rows, "vertex")], byte_order="<").write(stream)
    return stream.getvalue()


def write_cloud(path: Path, cloud: Cloud) -> None:
    """Writes the cloud as binary PLY, whole or not at all."""
    write_whole(path, cloud_ply(cloud), overwrite=True)


def read_points(path: Path) -> Floats:
    """The points (N, 3) of a cloud or mesh in a PLY file of whatever program.

    Further properties of a vertex, lists among them (OpenMVS has such), are passed over. Raises
    :class:`InputError` in one line for what is no such file.
    """
    if not path.is_file():
        what = f"{path} is a folder" if path.is_dir() else f"there is no file {path}"
        raise NotFoundError("cloud", what, "check the path")
    if path.stat().st_size > LARGEST_BYTES:
        raise InputError("cloud-too-large", f"{path.name} has more than 2 GB", "thin it out first")
    ply = plyfile()
    try:
        vertex = ply.PlyData.read(str(path))["vertex"]
        points = np.stack([np.asarray(vertex[name], dtype=np.float64) for name in "xyz"], axis=1)
    except (ply.PlyParseError, KeyError, ValueError, OSError, UnicodeDecodeError) as error:
        raise InputError(
            "cloud-ply", f"{path.name} is no PLY file with points", "export the cloud as PLY"
        ) from error
    return _finite(points, path.name)


def _finite(points: NDArray[np.float64], name: str) -> Floats:
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) == 0:
        raise InputError("cloud-empty", f"{name} holds no points", "give a cloud with points")
    return points


def write_distances(path: Path, points_mm: Floats, distances_mm: Floats) -> None:
    """Points (N, 3) with their signed distances (N,) as binary PLY: x y z distance_mm."""
    import io

    ply = plyfile()
    rows = np.empty(len(points_mm), dtype=[(n, "<f8") for n in "xyz"] + [("distance_mm", "<f4")])
    for k, name in enumerate("xyz"):
        rows[name] = points_mm[:, k]
    rows["distance_mm"] = distances_mm
    stream = io.BytesIO()
    ply.PlyData([ply.PlyElement.describe(rows, "vertex")], byte_order="<").write(stream)
    write_whole(path, stream.getvalue(), overwrite=True)
