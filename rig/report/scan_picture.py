"""What a scan was understood to be, as a picture: its front and its left side in the rig frame."""

from __future__ import annotations

from io import BytesIO

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Floats
from geometry.raycast import Occluder
from geometry.scan import Scan

_HEIGHT_PX = 480
_MOST_WIDE = 2.0
_LIGHT = np.array([0.35, -0.35, 0.87])
_BACKGROUND = 245
_NOSE_RGB = (220, 30, 30)
_AXES_RGB = ((220, 30, 30), (30, 90, 220), (30, 150, 60))
_AXIS_MM = 45.0

FRONT = (np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
"""Right in the picture and into it: as the cameras see the head."""

LEFT = (np.array([0.0, 1.0, 0.0]), np.array([-1.0, 0.0, 0.0]))
"""From the subject's left."""


def scan_picture(scan: Scan) -> bytes:
    """PNG bytes: front and left side, the nose tip marked, with the face's own axes.

    The axis to the subject's left is red, into the head blue, up green.
    """
    # Imported here: a design that draws nothing needs no image library.
    from PIL import Image

    occluder = scan.occluder()
    views = [_view(scan, occluder, right, into) for right, into in (FRONT, LEFT)]
    buffer = BytesIO()
    Image.fromarray(np.concatenate(views, axis=1)).save(buffer, "PNG")
    return buffer.getvalue()


def _view(scan: Scan, occluder: Occluder, right: Floats, into: Floats) -> NDArray[np.uint8]:
    from PIL import Image, ImageDraw

    up = np.array([0.0, 0.0, 1.0])
    low, high = scan.vertices_mm.min(axis=0), scan.vertices_mm.max(axis=0)
    middle = (low + high) / 2.0
    span = np.abs([(high - low) @ right, (high - low) @ up]) * 1.08 + 1.0
    cell_mm = float(max(span[1], span[0] / _MOST_WIDE)) / _HEIGHT_PX
    width = int(np.ceil(span[0] / cell_mm))
    column, row = np.meshgrid(np.arange(width), np.arange(_HEIGHT_PX))
    across = (column.ravel() - width / 2.0) * cell_mm
    above = (_HEIGHT_PX / 2.0 - row.ravel()) * cell_mm
    far = float(np.linalg.norm(high - low)) + 10.0
    origins = middle + across[:, None] * right + above[:, None] * up - far * into
    hit, _ = occluder.first_hits(origins, np.tile(into, (len(origins), 1)))
    a, b, c = (occluder.vertices_mm[occluder.faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    # Every surface is lit from the side it is seen from.
    normals = np.where((normals @ into)[:, None] > 0.0, -normals, normals)
    shade = np.clip(70.0 + 150.0 * (normals @ _LIGHT), 40.0, 230.0)
    grey = np.where(hit >= 0, shade[np.maximum(hit, 0)], _BACKGROUND).astype(np.uint8)
    image = Image.fromarray(grey.reshape(_HEIGHT_PX, width)).convert("RGB")
    if scan.face is not None:
        draw = ImageDraw.Draw(image)

        def at(point_mm: Floats) -> tuple[float, float]:
            local = point_mm - middle
            return (
                float(width / 2.0 + local @ right / cell_mm),
                float(_HEIGHT_PX / 2.0 - local @ up / cell_mm),
            )

        tip = scan.face.nose_tip_mm
        for axis, colour in zip(scan.face.axes_rig, _AXES_RGB, strict=True):
            draw.line([at(tip), at(tip + _AXIS_MM * axis)], fill=colour, width=2)
        x, y = at(tip)
        draw.ellipse([x - 4.0, y - 4.0, x + 4.0, y + 4.0], outline=_NOSE_RGB, width=2)
    return np.asarray(image, dtype=np.uint8)
