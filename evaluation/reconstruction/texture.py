"""A picture on a measured surface: each triangle shows the camera that sees it best.

The atlas is cut from the undistorted pictures themselves, one rectangle for each camera: nothing is
resampled but by the correction that lets colours meet along seams. After Waechter, Moehrle and
Goesele (2014), with one label field smoothed over the surface instead of a graph cut.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from common.errors import InputError
from evaluation.reconstruction.bestviews import NOBODY, area_px, best_views, seen_vertices
from evaluation.reconstruction.cloud import Bytes
from evaluation.reconstruction.seams import corners, corrections, gains, vertex_colours
from evaluation.reconstruction.surface import SurfaceMesh
from evaluation.reconstruction.views import Singles, View
from geometry.arrays import Bools, Floats, Ints
from geometry.raycast import Occluder

LARGEST_PX = 8192
"""Sides that graphics cards take: a larger atlas is made smaller."""

_REACH, _LEAST_REACH_PX = 1.5, 2.0
"""How far a vertex' correction reaches, in spacings of vertices and at least. Twice as far the
picture goes on beside what is used: viewers make smaller copies, which mix neighbours."""
_BLOCK_PX = 4
"""A triangle that no camera sees whole has a block of one colour, that of its points."""


_SHEET_GROWS = 1.05


@dataclass(frozen=True, eq=False)
class Texture:
    """A picture on a surface.

    ``image`` (H, W, 3) RGB of 8 bits. Vertices are split along seams: ``vertex`` (W,) which of the
    mesh's it is, ``uv`` (W, 2) its place in the picture, 0 to 1 from the left and from below,
    ``faces`` (F, 3) the mesh's triangles by split vertices. ``unseen``: triangles that no camera
    sees whole; they have the colours of their points.
    """

    image: Bytes
    vertex: Ints
    uv: Floats
    faces: Ints
    unseen: int


@dataclass(frozen=True, eq=False)
class _Piece:
    """A rectangle of the atlas, and where some split vertices are in it, pixels."""

    image: Bytes
    rows: Ints
    place_px: Floats


def textured(mesh: SurfaceMesh, views: Sequence[View], largest_px: int = LARGEST_PX) -> Texture:
    """A picture for a mesh from the views that it was measured in.

    Raises :class:`InputError` where no view shows a whole triangle of it.
    """
    occluder = Occluder(mesh.vertices_mm, mesh.faces)
    pixels, seen = zip(*(seen_vertices(v, mesh, occluder) for v in views), strict=True)
    label = best_views(pixels, seen, mesh)
    known = label != NOBODY
    if not known.any():
        raise InputError(
            "texture-unseen",
            "no picture shows a triangle of the mesh whole and not overexposed",
            "take a smaller --cell, or go without --texture",
        )
    colours = vertex_colours(views, pixels)
    gain = gains(colours, np.stack(seen))
    vertex, own, split = corners(mesh.faces[known], label[known])
    more = corrections(vertex, split, gain[own] * colours[own, vertex])
    pieces = []
    for k, view in enumerate(views):
        rows = np.flatnonzero(own == k)
        if len(rows):
            covered = area_px(pixels[k], mesh.faces[label == k]).sum()
            reach = max(_LEAST_REACH_PX, _REACH * float(np.sqrt(covered / len(rows))))
            pieces.append(_cut(view, gain[k], pixels[k][vertex[rows]], more[rows], rows, reach))
    faces = np.empty_like(mesh.faces)
    faces[known] = split
    if not known.all():
        faces[~known] = len(vertex) + np.arange(3 * int((~known).sum())).reshape(-1, 3)
        pieces.append(_blocks(mesh, ~known, len(vertex)))
        vertex = np.r_[vertex, mesh.faces[~known].ravel()]
    image, uv = _packed(pieces, len(vertex), largest_px)
    return Texture(image, vertex, uv, faces, int((~known).sum()))


def _cut(
    view: View, gain: Floats, pixel: Floats, more: Singles, rows: Ints, reach_px: float
) -> _Piece:
    """The part of a picture that is used, its colours brought to meet the others'."""
    margin = int(np.ceil(2.0 * reach_px))
    low = np.maximum(np.floor(pixel.min(axis=0)).astype(int) - margin, 0)
    high = np.ceil(pixel.max(axis=0)).astype(int) + margin + 1
    part = view.colour[low[1] : high[1], low[0] : high[0]]
    place = pixel - low
    added, used = _spread(part.shape[:2], place, more, reach_px)
    image = np.where(used[..., None], part * gain.astype(np.float32) + added, 0.0)
    return _Piece(np.rint(np.clip(image, 0.0, 255.0)).astype(np.uint8), rows, place)


def _spread(
    shape: tuple[int, ...], place: Floats, values: Singles, reach_px: float
) -> tuple[Singles, Bools]:
    """Values at places (N, 2) as a smooth picture (H, W, 3), and which pixels are near one."""
    column, row = np.rint(place).astype(np.int64).T
    total = np.zeros((*shape, 4), dtype=np.float32)
    np.add.at(total, (row, column), np.concatenate([values, np.ones_like(values[:, :1])], axis=1))
    near = np.ones((2 * int(np.ceil(2.0 * reach_px)) + 1,) * 2, np.uint8)
    used = cv2.dilate((total[..., 3] > 0.0).astype(np.uint8), near) > 0
    smooth = cv2.GaussianBlur(total, (0, 0), reach_px)
    # Two sigmas off, in both directions, exp(-4) of a vertex' weight is left.
    least = 0.1 * np.exp(-4.0) / (2.0 * np.pi * reach_px**2)
    return np.asarray(smooth[..., :3] / np.maximum(smooth[..., 3:], least)), np.asarray(used)


def _blocks(mesh: SurfaceMesh, unseen: Bools, first: int) -> _Piece:
    """Blocks of colour for triangles that nobody sees; their corners are rows from ``first``."""
    colour = mesh.colours[mesh.faces[unseen]].mean(axis=1)
    count = len(colour)
    across = int(np.ceil(np.sqrt(count)))
    cells = np.zeros((across * across, 3), dtype=np.uint8)
    cells[:count] = np.rint(colour)
    image = cells.reshape(across, across, 3).repeat(_BLOCK_PX, axis=0).repeat(_BLOCK_PX, axis=1)
    row, column = np.divmod(np.arange(count), across)
    middle = (np.stack([column, row], axis=1) + 0.5) * _BLOCK_PX - 0.5
    return _Piece(image, first + np.arange(3 * count), middle.repeat(3, axis=0))


def sheet_corners(sizes: Ints) -> Ints:
    """Where rectangles (P, 2) begin on a square sheet, about as small as they find room on, (P, 2).

    A long strip would have to be made smaller where a square needs not.
    """
    # Imported here: trimesh takes a third of a second.
    from trimesh.path.packing import rectangles

    side = float(max(sizes.max(), np.sqrt(sizes.prod(axis=1).sum())))
    while True:
        found, taken = rectangles(
            sizes.astype(np.float64), size=(side, side), rotate=False, iterations=10, seed=0
        )
        if taken.all():
            return np.asarray(np.rint(found[:, 0]).astype(np.int64))
        side *= _SHEET_GROWS


def _packed(pieces: Sequence[_Piece], count: int, largest_px: int) -> tuple[Bytes, Floats]:
    """All pieces in one picture, and the places (W, 2) of the split vertices in it, 0 to 1."""
    sizes = np.array([piece.image.shape[1::-1] for piece in pieces])
    corner = sheet_corners(sizes)
    width, height = (corner + sizes).max(axis=0)
    image = np.zeros((height, width, 3), dtype=np.uint8)
    uv = np.zeros((count, 2))
    for piece, (x, y), (w, h) in zip(pieces, corner, sizes, strict=True):
        image[y : y + h, x : x + w] = piece.image
        place = piece.place_px + (x, y) + 0.5
        uv[piece.rows] = np.stack([place[:, 0] / width, 1.0 - place[:, 1] / height], axis=1)
    scale = largest_px / max(width, height)
    if scale < 1.0:
        size = (round(width * scale), round(height * scale))
        image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    return image, uv
