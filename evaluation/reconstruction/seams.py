"""Colours of several cameras made one: a gain for each, then what is left along the seams spread.

The second step is that of Lempitsky and Ivanov (2007): along seams the two colours shall meet, and
what is added to a camera's colours shall change little from one vertex to the next.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from scipy import sparse
from scipy.sparse.linalg import cg

from evaluation.reconstruction.views import Singles, View
from geometry.arrays import Bools, Floats, Ints

_BLUR_PX = 1.5
"""Colours are compared without the noise of single pixels."""
_DARK = 8.0
"""Of 255: darker values say little about a gain."""
_STIFF = 0.1
"""Weight of equal corrections at neighbours, beside that of colours that meet at a seam."""
_HELD = 1e-3
"""Weight of no correction at all: pictures that meet nowhere keep their colours."""
_STEPS, _EXACT = 500, 1e-4


def vertex_colours(views: Sequence[View], pixels: Sequence[Floats]) -> Floats:
    """The colours (K, V, 3), 0 to 255, that each camera shows at the vertices."""
    out = []
    for view, pixel in zip(views, pixels, strict=True):
        smooth = cv2.GaussianBlur(view.colour, (0, 0), _BLUR_PX)
        place = np.nan_to_num(pixel, nan=-1.0, posinf=-1.0, neginf=-1.0).astype(np.float32)
        # Remap refuses more than 32,766 columns: a square of places will do.
        side = int(np.ceil(np.sqrt(len(place))))
        padded = np.zeros((side * side, 2), dtype=np.float32)
        padded[: len(place)] = place
        grid = padded.reshape(side, side, 2)
        read = cv2.remap(smooth, grid[..., 0], grid[..., 1], cv2.INTER_LINEAR)
        out.append(read.reshape(-1, 3)[: len(place)].astype(np.float64))
    return np.stack(out)


def gains(colours: Floats, seen: Bools) -> Floats:
    """What each camera's colours are to be multiplied by, (K, 3), their geometric mean 1.

    From the medians of the ratios that pairs of cameras show where both see the surface.
    """
    count = len(colours)
    rows, values = [], []
    for a in range(count):
        for b in range(a + 1, count):
            both = seen[a] & seen[b] & (np.minimum(colours[a], colours[b]) > _DARK).all(axis=1)
            if both.any():
                row = np.zeros(count)
                row[a], row[b] = 1.0, -1.0
                # By their number: two that hardly meet say little of each other.
                weight = np.sqrt(both.sum())
                rows.append(weight * row)
                ratio = np.log(colours[b][both] / colours[a][both])
                values.append(weight * np.median(ratio, axis=0))
    if not rows:
        return np.ones((count, 3))
    found = np.linalg.lstsq(np.array(rows), np.array(values), rcond=None)[0]
    return np.asarray(np.exp(found - found.mean(axis=0)))


def corners(faces: Ints, label: Ints) -> tuple[Ints, Ints, Ints]:
    """Vertices split along seams: of each its vertex (W,) and label (W,), and the faces (F, 3)."""
    wide = int(faces.max()) + 1
    keys, split = np.unique(label[:, None] * wide + faces, return_inverse=True)
    return keys % wide, keys // wide, split.reshape(-1, 3)


def corrections(vertex: Ints, split: Ints, colours: Floats) -> Singles:
    """What to add to the colours at each split vertex (W, 3).

    ``colours`` (W, 3) that each shows. ``vertex`` and ``split`` from :func:`corners`.
    """
    count = len(vertex)
    order = np.argsort(vertex, kind="stable")
    meet = np.flatnonzero(vertex[order][1:] == vertex[order][:-1])
    one, other = order[meet], order[meet + 1]
    edges = np.unique(np.sort(split[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    seam = _differences(one, other, count)
    even = _differences(edges[:, 0], edges[:, 1], count) * _STIFF
    normal = (seam.T @ seam + even.T @ even + _HELD**2 * sparse.identity(count)).tocsr()
    right = seam.T @ (colours[other] - colours[one])
    scale = sparse.diags(1.0 / normal.diagonal())
    found = [cg(normal, right[:, k], rtol=_EXACT, maxiter=_STEPS, M=scale)[0] for k in range(3)]
    return np.stack(found, axis=1).astype(np.float32)


def _differences(one: Ints, other: Ints, count: int) -> sparse.csr_matrix:
    """Rows of the first less the second of each pair."""
    rows = np.arange(len(one))
    values = np.r_[np.ones(len(one)), -np.ones(len(one))]
    places = (np.r_[rows, rows], np.r_[one, other])
    return sparse.coo_matrix((values, places), shape=(len(one), count)).tocsr()
