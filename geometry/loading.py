"""The arrays of a scan file, as they stand in it."""

from __future__ import annotations

import io
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from common.errors import InputError, RigwrightError
from geometry.arrays import Floats, Ints
from geometry.scanlimits import check_counts, format_error
from geometry.textforms import has_decimal_commas, plain_obj, plain_points, strip_faces


@dataclass(frozen=True, eq=False)
class RawScan:
    """``vertices`` (V, 3), ``faces`` (F, 3), ``normals`` (V, 3) or None, in the file's frame.

    ``unit`` is the unit the file declares or its format prescribes, None when neither does.
    Nothing is checked: values may be NaN.
    """

    vertices: Floats
    faces: Ints
    normals: Floats | None = None
    unit: str | None = None


def load_raw(path: Path, kind: str) -> RawScan:
    """The content of a file whose kind and size were checked.

    Raises :class:`InputError` when it cannot be read.
    """
    try:
        # Readers warn about flaws that are checked for later; their words would only confuse.
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            raw = _load_text_points(path) if kind == "XYZ" else _load_with_trimesh(path, kind)
    except RigwrightError:
        raise
    except Exception as error:
        if has_decimal_commas(_beginning(path)):
            raise format_error(kind, "its numbers have commas for decimal points") from error
        if kind == "PLY" and b"element tristrips" in _beginning(path):
            problem = "the PLY file holds triangle strips in a form that is not read"
            raise InputError("scan-format", problem, "export it with triangles") from error
        raise format_error(kind, str(error)[:120] or type(error).__name__) from error
    check_counts(len(raw.faces), len(raw.vertices))
    return raw


def _beginning(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(1 << 16)


def _load_with_trimesh(path: Path, kind: str) -> RawScan:
    import trimesh

    options: dict[str, Any] = {"process": False, "skip_materials": True, "allow_remote": False}
    scene: Any
    if kind == "glTF":
        scene = trimesh.load_scene(path, **options)
    else:
        # Without the path the reader cannot follow references to other files.
        with path.open("rb") as file:
            source = io.BytesIO(plain_obj(file.read())) if kind == "OBJ" else file
            scene = trimesh.load_scene(source, file_type=path.suffix[1:].lower(), **options)
    found = [_part(scene, name) for name in scene.graph.nodes_geometry]
    parts = [part for part in found if part is not None]
    unit = "m" if kind in ("GLB", "glTF") else _unit(scene) if kind == "3MF" else None
    return _joined(parts, unit)


def _unit(scene: Any) -> str | None:  # noqa: ANN401 - a trimesh scene, which is untyped
    names = {"millimeter": "mm", "centimeter": "cm", "meter": "m", "inch": "inch"}
    return names.get(str(scene.units).removesuffix("s"))


def _part(scene: Any, node: str) -> RawScan | None:  # noqa: ANN401 - a trimesh scene, untyped
    import trimesh

    matrix, name = scene.graph[node]
    geometry = scene.geometry[name]
    if not isinstance(geometry, trimesh.Trimesh | trimesh.PointCloud):
        return None
    vertices = np.asarray(geometry.vertices, dtype=np.float64).reshape(-1, 3)
    faces = np.asarray(getattr(geometry, "faces", np.zeros((0, 3))), dtype=np.int64).reshape(-1, 3)
    faces = np.concatenate([faces, _strips(geometry, len(vertices))])
    # A mirroring transform turns faces inside out.
    if np.linalg.det(matrix[:3, :3]) < 0.0:
        faces = faces[:, ::-1]
    normals = None if len(faces) else _cloud_normals(geometry, len(vertices))
    if normals is not None:
        normals = normals @ np.linalg.inv(matrix[:3, :3])
    return RawScan(vertices @ matrix[:3, :3].T + matrix[:3, 3], faces, normals)


def _strips(geometry: Any, count: int) -> Ints:  # noqa: ANN401 - untyped trimesh
    """Triangles (n, 3) of the strips that PLY files may have beside faces or instead."""
    element = geometry.metadata.get("_ply_raw", {}).get("tristrips")
    if element is None:
        return np.zeros((0, 3), dtype=np.int64)
    problem = format_error("PLY", "its triangle strips are damaged")
    rows = [np.append(row, -1) for row in _ply_lists(element.get("data"))]
    if not rows:
        raise problem
    corners = np.concatenate(rows)
    if corners.max() >= count or corners.min() < -1:
        raise problem
    return strip_faces(corners)


def _ply_lists(data: Any) -> list[Ints]:  # noqa: ANN401 - whatever trimesh made of an element
    """The first list of each row of an element: text gives objects, binary counted fields."""
    rows: Any = []
    if isinstance(data, dict):
        rows = next(iter(data.values()), [])
    elif isinstance(data, np.ndarray) and data.dtype.names:
        first = data[data.dtype.names[0]]
        rows = first["f1"] if first.dtype.names and "f1" in first.dtype.names else []
    return [np.ravel(row).astype(np.int64) for row in rows]


def _cloud_normals(cloud: Any, count: int) -> Floats | None:  # noqa: ANN401 - untyped trimesh
    raw = cloud.metadata.get("_ply_raw", {}).get("vertex", {}).get("data")
    try:
        columns = [
            np.asarray(raw[name], dtype=np.float64).reshape(count) for name in ("nx", "ny", "nz")
        ]
    except (KeyError, IndexError, TypeError, ValueError):
        return None
    return np.stack(columns, axis=1)


def _joined(parts: list[RawScan], unit: str | None) -> RawScan:
    # Stray points beside a mesh (markers, say) are no surface and are left out.
    if any(len(part.faces) for part in parts):
        parts = [part for part in parts if len(part.faces)]
    if not parts:
        return RawScan(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64), None, unit)
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = [part.faces + start for part, start in zip(parts, starts, strict=False)]
    normals = [part.normals for part in parts if part.normals is not None]
    return RawScan(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate(faces),
        np.concatenate(normals) if len(normals) == len(parts) else None,
        unit,
    )


def _first_bad_line(text: str) -> str:
    width = 0
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split("#")[0].split()
        try:
            [float(word) for word in words]
        except ValueError:
            return f"line {number} holds {line.strip()[:40]!r}, not numbers"
        if words and width and len(words) != width:
            return f"line {number} has {len(words)} numbers, the lines before have {width}"
        width = len(words) or width
    return "its lines are not numbers"


def _load_text_points(path: Path) -> RawScan:
    text = plain_points(path.read_text(encoding="utf-8-sig"))
    if not text.strip():
        raise InputError(
            "scan-empty", "the scan file is empty", "export it again with its geometry"
        )
    try:
        table = np.loadtxt(io.StringIO(text), comments="#", ndmin=2)
    except ValueError as error:
        raise format_error("XYZ", _first_bad_line(text)) from error
    faces = np.zeros((0, 3), dtype=np.int64)
    if len(table) == 0 or table.shape[1] < 3:
        raise format_error("XYZ", "each line must hold x y z, or x y z and a normal")
    normals = table[:, 3:6] if table.shape[1] >= 6 else None
    if normals is not None and not 0.9 < np.nanmedian(np.linalg.norm(normals, axis=1)) < 1.1:
        # Columns four to six are colours then.
        normals = None
    return RawScan(table[:, :3], faces, normals)
