"""The head to be photographed: a scan with its texture, or the painted synthetic head."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from common.errors import InputError, NotFoundError
from geometry.arrays import Floats, Ints
from geometry.cleaning import unique_rows
from geometry.reading import read_scan
from geometry.scanoptions import ScanOptions
from rig.simulation.mesh import TexturedMesh
from rig.simulation.settings import HeadSettings
from rig.simulation.skin import painted_head

_WELD_SHARE = 1e-7
_PLAIN_SKIN = (205, 165, 145)
_LARGEST_PX = 4096
_BAND_ROWS = 256
_SHRINK = cv2.INTER_AREA


def head_mesh(settings: HeadSettings) -> TexturedMesh:
    """The mesh of the head in the rig frame, not yet rounded.

    Raises :class:`InputError` or :class:`NotFoundError` for files that cannot be used.
    """
    return painted_head(settings.seed) if settings.scan is None else _scanned(settings)


def read_picture(path: Path, flags: int = cv2.IMREAD_COLOR_RGB) -> NDArray[np.uint8]:
    """A picture file, RGB unless ``flags`` say otherwise, 8 bits."""
    if not path.is_file():
        raise NotFoundError("picture", f"there is no picture {path}", "check its name")
    data = np.fromfile(path, dtype=np.uint8)
    picture = cv2.imdecode(data, flags) if len(data) else None
    if picture is None:
        raise InputError("picture", f"{path} is not a picture that can be read", "give PNG or JPEG")
    return np.asarray(picture, dtype=np.uint8)


def _scanned(settings: HeadSettings) -> TexturedMesh:
    path = Path(settings.scan or "")
    options = ScanOptions(units=settings.units, up=settings.up, front=settings.front)
    rig_from_file = read_scan(path, options).rig_from_file
    if settings.texture is None:
        _require_decoder()
    vertices, faces, uv, embedded = _textured(path)
    vertices = vertices @ rig_from_file[:3, :3].T + rig_from_file[:3, 3]
    vertices, faces, uv = _welded(vertices, faces, uv)
    if settings.texture is not None:
        picture = read_picture(settings.texture)[:: -1 if settings.flip_texture else 1]
    elif embedded is not None:
        picture = embedded
    else:
        picture = np.full((64, 64, 3), _PLAIN_SKIN, dtype=np.uint8)
    if settings.displacement is not None:
        picture = _detailed(picture, settings)
    height, width = picture.shape[:2]
    # OBJ and trimesh count v from the bottom, pictures from the top.
    texture = np.stack([uv[..., 0] * width - 0.5, (1.0 - uv[..., 1]) * height - 0.5], axis=-1)
    tint = np.ones(vertices.shape, dtype=np.float32)
    picture = np.ascontiguousarray(picture)
    return TexturedMesh(vertices, faces, texture.astype(np.float32), picture, tint)


def _textured(path: Path) -> tuple[Floats, Ints, Floats, NDArray[np.uint8] | None]:
    """Vertices (V, 3), faces (F, 3), texture coordinates (F, 3, 2), and the file's own picture.

    The file was checked and read before; here only the texture is new.
    """
    import trimesh

    scene: Any = trimesh.load_scene(path, process=False, allow_remote=False)
    vertices, faces, uv, picture, start = [], [], [], None, 0
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        part = scene.geometry[name]
        if not isinstance(part, trimesh.Trimesh):
            continue
        coordinates = getattr(part.visual, "uv", None)
        if coordinates is None:
            coordinates = np.zeros((len(part.vertices), 2))
        picture = _own_picture(part) if picture is None else picture
        turn = -1 if np.linalg.det(matrix[:3, :3]) < 0.0 else 1
        corners = np.asarray(part.faces, dtype=np.int64)[:, ::turn]
        vertices.append(np.asarray(part.vertices) @ matrix[:3, :3].T + matrix[:3, 3])
        faces.append(corners + start)
        uv.append(np.asarray(coordinates, dtype=np.float64)[corners])
        start += len(part.vertices)
    if not faces:
        raise InputError("simulation-scan", f"{path} has no mesh", "give a scan with faces")
    return np.concatenate(vertices), np.concatenate(faces), np.concatenate(uv), picture


def _require_decoder() -> None:
    """Without Pillow trimesh leaves pictures out in silence, and the head would be plain."""
    if importlib.util.find_spec("PIL") is None:
        raise InputError(
            "simulation-texture",
            "pictures inside a scan cannot be read: Pillow is not installed",
            "run pip install pillow, or give the picture as texture",
        )


def _own_picture(part: Any) -> NDArray[np.uint8] | None:  # noqa: ANN401 - an untyped trimesh mesh
    material = getattr(part.visual, "material", None)
    picture = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    return None if picture is None else np.asarray(picture.convert("RGB"), dtype=np.uint8)


def _welded(vertices: Floats, faces: Ints, uv: Floats) -> tuple[Floats, Ints, Floats]:
    """One vertex for each place: files split them along the seams of the texture.

    Left split, subdivision would open the mesh along the seams.
    """
    size = float(np.ptp(vertices, axis=0).max())
    places = np.round((vertices - vertices.min(axis=0)) / (size * _WELD_SHARE)).astype(np.int64)
    first, inverse = unique_rows(places)
    faces = inverse[faces]
    sound = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return vertices[first], faces[sound], uv[sound]


def _detailed(picture: NDArray[np.uint8], settings: HeadSettings) -> NDArray[np.uint8]:
    """The picture with the fine part of the displacement map as light and dark.

    Hollows between pores and wrinkles get less light; a map minus its own blur says where.
    """
    path = settings.displacement
    if path is None:
        return picture
    height = read_picture(path, cv2.IMREAD_GRAYSCALE)[:: -1 if settings.flip_texture else 1]
    scale = min(1.0, _LARGEST_PX / max(height.shape))
    fine: Any = cv2.resize(
        height.astype(np.float32), None, fx=scale, fy=scale, interpolation=_SHRINK
    )
    fine -= cv2.GaussianBlur(fine, (0, 0), settings.detail_width_px)
    rms = float(np.sqrt((fine[fine != 0.0] ** 2).mean())) if fine.any() else 1.0
    larger: Any = cv2.resize(picture, fine.shape[::-1], interpolation=cv2.INTER_CUBIC)
    for top in range(0, len(fine), _BAND_ROWS):
        part = slice(top, top + _BAND_ROWS)
        factor = np.clip(1.0 + settings.detail_contrast / rms * fine[part], 0.4, 1.6)
        # The eye and the sRGB curve agree that equal ratios of light look equal.
        coded = larger[part].astype(np.float32) * factor[..., None] ** np.float32(1.0 / 2.2)
        larger[part] = np.clip(np.round(coded), 0, 255).astype(np.uint8)
    return np.asarray(larger, dtype=np.uint8)
