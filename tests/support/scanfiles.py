"""Scan files for tests: a plain head with shoulders of rotation, and the real head if present."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

REAL_HEAD = "data/heads/lee-perry-smith/LeePerrySmith.glb"


def real_head_path() -> Path | None:
    """The real head scan in the first ``shared`` folder upward, None when there is none."""
    for folder in Path(__file__).resolve().parents:
        path = folder / "shared" / REAL_HEAD
        if path.is_file():
            return path
    return None


def plain_head() -> trimesh.Trimesh:
    """An ellipsoid with a nose, cut flat at the neck; rig frame, mm, about 150 x 210 x 240."""
    ball = trimesh.creation.icosphere(subdivisions=5)
    unit = ball.vertices
    vertices = unit * np.array([75.0, 90.0, 130.0])
    front = unit[:, 1] < 0.0
    nose = 30.0 * np.exp(-((vertices[:, 0] / 9.0) ** 2) - ((vertices[:, 2] + 10.0) / 22.0) ** 2)
    vertices[:, 1] -= np.where(front, nose, 0.0)
    vertices[:, 2] = np.maximum(vertices[:, 2], -110.0)
    return trimesh.Trimesh(vertices, ball.faces, process=True)
