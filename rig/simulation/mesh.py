"""A triangle mesh with a picture on it, and its rounding by Loop subdivision."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from common.errors import InputError
from geometry.arrays import Floats, Ints
from geometry.scan import vertex_normals

_ROUND_THE_FACE = ((0, 1), (1, 2), (2, 0))


@dataclass(frozen=True, eq=False)
class TexturedMesh:
    """``vertices_mm`` (V, 3), ``faces`` (F, 3), wound outward, one vertex for each place.

    ``texture_px`` (F, 3, 2) float32 holds column and row of ``picture`` (H, W, 3), sRGB, for each
    corner of each face: at a seam of the texture one vertex has several. ``tint`` (V, 3) multiplies
    the picture's linear colours. ``values`` (V, K) are further numbers of the vertices, none or
    K each, halved along the edges like the tint.
    """

    vertices_mm: Floats
    faces: Ints
    texture_px: NDArray[np.float32]
    picture: NDArray[np.uint8]
    tint: NDArray[np.float32]
    values: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 0), np.float32))

    def __post_init__(self) -> None:
        sound = (
            len(self.faces) > 0
            and self.texture_px.shape == (len(self.faces), 3, 2)
            and self.tint.shape == self.vertices_mm.shape
            and self.picture.ndim == 3
        )
        if not sound:
            raise InputError(
                "simulation-mesh",
                "the mesh to be photographed has no faces, or its texture does not fit it",
                "give a scan with faces and texture coordinates",
            )

    @property
    def normals(self) -> Floats:
        """Smooth unit normals of the vertices, (V, 3)."""
        return vertex_normals(self.vertices_mm, self.faces)


def subdivided(mesh: TexturedMesh, times: int) -> TexturedMesh:
    """The mesh with every face cut in four and rounded, ``times`` over (C. Loop, 1987).

    Open borders keep to themselves, so the mesh does not shrink away from its cuts. Texture
    coordinates are halved along the edges.
    """
    for _ in range(times):
        mesh = _once(mesh)
    return mesh


def _once(mesh: TexturedMesh) -> TexturedMesh:
    faces, count = mesh.faces, len(mesh.vertices_mm)
    edges, edge_of_side, uses = _edges(faces, count)
    opposite = faces[:, [2, 0, 1]].ravel()
    middles = mesh.vertices_mm[edges].mean(axis=1)
    across = _sums(edge_of_side, mesh.vertices_mm[opposite], len(edges))
    inner = uses == 2
    middles[inner] = 0.75 * middles[inner] + 0.125 * across[inner]
    vertices = np.concatenate([_moved(mesh.vertices_mm, edges, uses), middles])
    sides = edge_of_side.reshape(-1, 3) + count
    a, b, c = faces.T
    ab, bc, ca = sides.T
    parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    uv = mesh.texture_px
    halves = np.stack([0.5 * (uv[:, i] + uv[:, j]) for i, j in _ROUND_THE_FACE], axis=1)
    places = [
        (uv[:, 0], halves[:, 0], halves[:, 2]),
        (halves[:, 0], uv[:, 1], halves[:, 1]),
        (halves[:, 2], halves[:, 1], uv[:, 2]),
        (halves[:, 0], halves[:, 1], halves[:, 2]),
    ]
    return TexturedMesh(
        vertices,
        np.concatenate([np.stack(part, axis=1) for part in parts]),
        np.concatenate([np.stack(place, axis=1) for place in places]).astype(np.float32),
        mesh.picture,
        _halved(mesh.tint, edges),
        _halved(mesh.values, edges) if len(mesh.values) else mesh.values,
    )


def _halved(values: NDArray[np.float32], edges: Ints) -> NDArray[np.float32]:
    """The vertices' values and, after them, those of the middles of the edges."""
    return np.concatenate([values, values[edges].mean(axis=1, dtype=np.float32)])


def _edges(faces: Ints, count: int) -> tuple[Ints, Ints, Ints]:
    """Edges (E, 2), the edge of each side (3 F,), and how many faces use each edge (E,)."""
    sides = np.sort(faces[:, _ROUND_THE_FACE].reshape(-1, 2), axis=1)
    key, edge_of_side, uses = np.unique(
        sides[:, 0] * count + sides[:, 1], return_inverse=True, return_counts=True
    )
    return np.stack(np.divmod(key, count), axis=1), edge_of_side.ravel(), uses


def _sums(index: Ints, values: Floats, count: int) -> Floats:
    return np.stack([np.bincount(index, column, count) for column in values.T], axis=1)


def _moved(vertices: Floats, edges: Ints, uses: Ints) -> Floats:
    """The old vertices in their new places."""
    ends, others = edges.ravel(), edges[:, ::-1].ravel()
    valence = np.bincount(ends, minlength=len(vertices)).astype(np.float64)
    around = _sums(ends, vertices[others], len(vertices))
    near = np.maximum(valence, 1.0)
    beta = (0.625 - (0.375 + 0.25 * np.cos(2.0 * np.pi / near)) ** 2) / near
    moved = (1.0 - valence * beta)[:, None] * vertices + beta[:, None] * around
    # Edges of one face (a border) or of more than two (a fault of the mesh) follow a curve of
    # their own; where more than two such edges meet the vertex stays.
    border = edges[uses != 2]
    ends, others = border.ravel(), border[:, ::-1].ravel()
    met = np.bincount(ends, minlength=len(vertices))
    along = _sums(ends, vertices[others], len(vertices))
    curve = 0.75 * vertices + 0.125 * along
    moved[met == 2] = curve[met == 2]
    stays = (met > 0) & (met != 2)
    moved[stays] = vertices[stays]
    return np.asarray(moved)
