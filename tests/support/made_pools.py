"""Candidates with made-up information, for searches that need no subject."""

from __future__ import annotations

import numpy as np
import rigs

from solver.search.candidates import Candidates


def pool(seed: int, count: int = 25) -> Candidates:
    """Candidates with made-up information: places on a sphere, half of the points seen by each."""
    rng = np.random.default_rng(seed)
    place = rng.normal(size=(count, 3))
    place *= 900.0 / np.linalg.norm(place, axis=1, keepdims=True)
    seen = rng.random((count, 8)) < 0.5
    arm = rng.normal(size=(count, 3, 3, 8))
    matrix = np.einsum("mikp,mjkp->mijp", arm, arm) * seen[:, None, None]
    entries = np.stack(
        [matrix[:, i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))], axis=1
    )
    camera = rigs.face_cameras(rigs.face(20, 30), 1)[0]
    return Candidates(
        (camera,) * count,
        entries,
        seen,
        np.full(8, 1.0 / 8.0),
        0.1,
        place,
        np.linalg.norm(place, axis=1),
        2,
    )
