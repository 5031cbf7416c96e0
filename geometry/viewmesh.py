"""A mesh light enough to look at: scans have millions of faces, pages and scenes cannot."""

from __future__ import annotations

import numpy as np

from geometry.arrays import Floats, Ints


def simplified(vertices_mm: Floats, faces: Ints, most_faces: int) -> tuple[Floats, Ints]:
    """Vertices (V, 3) and faces (F, 3) with at most ``most_faces`` faces.

    Vertices that share a cell of a grid become their mean; the grid is coarsened until the
    faces are few enough. Good for looking, not for measuring.
    """
    cell = (
        _mean_edge_mm(vertices_mm, faces) * np.sqrt(len(faces) / most_faces) if len(faces) else 1.0
    )
    light, kept = vertices_mm, faces
    while len(kept) > most_faces:
        light, kept = _merged(vertices_mm, faces, cell)
        cell *= 1.15
    return light, kept


def _mean_edge_mm(vertices_mm: Floats, faces: Ints) -> float:
    sample = faces[:: max(1, len(faces) // 10_000)]
    edges = vertices_mm[sample[:, 0]] - vertices_mm[sample[:, 1]]
    return max(float(np.linalg.norm(edges, axis=1).mean()), 1e-6)


def _merged(vertices_mm: Floats, faces: Ints, cell_mm: float) -> tuple[Floats, Ints]:
    cells = np.floor((vertices_mm - vertices_mm.min(axis=0)) / cell_mm).astype(np.int64)
    _, owner = np.unique(cells, axis=0, return_inverse=True)
    owner = owner.reshape(-1)
    counts = np.bincount(owner)
    sums = [np.bincount(owner, weights=vertices_mm[:, axis]) for axis in range(3)]
    mapped = owner[faces]
    whole = (
        (mapped[:, 0] != mapped[:, 1])
        & (mapped[:, 1] != mapped[:, 2])
        & (mapped[:, 2] != mapped[:, 0])
    )
    return np.stack(sums, axis=1) / counts[:, None], np.unique(mapped[whole], axis=0)
