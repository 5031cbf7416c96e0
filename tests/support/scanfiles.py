"""Scan files for tests: a plain head, and the real head if present."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import trimesh

from geometry.head import HeadShape, head_field

REAL_HEAD = "data/heads/lee-perry-smith/LeePerrySmith.glb"


def real_head_path() -> Path | None:
    """The real head scan in the first ``shared`` folder upward, None when there is none."""
    for folder in Path(__file__).resolve().parents:
        path = folder / "shared" / REAL_HEAD
        if path.is_file():
            return path
    return None


@cache
def _plain_head() -> trimesh.Trimesh:
    """The bundled head of average measures as seen from its middle, so in a second."""
    ball = trimesh.creation.icosphere(subdivisions=5)
    way, field = np.asarray(ball.vertices), head_field(HeadShape())
    middle, reach = np.array([0.0, -10.0, -10.0]), np.full(len(way), 230.0)
    for _ in range(40):
        reach -= 0.8 * field(middle + reach[:, None] * way)
    return trimesh.Trimesh(middle + reach[:, None] * way, ball.faces, process=True)


def plain_head() -> trimesh.Trimesh:
    """A head without its hidden parts, cut at the neck; rig frame, mm, about 170 x 210 x 255."""
    return _plain_head().copy()


def shared_case(name: str) -> Path:
    """A case of the first ``shared`` folder upward; the test is skipped where it is absent."""
    for folder in Path(__file__).resolve().parents:
        path = folder / "shared" / "cases" / name
        if path.is_file():
            return path
    pytest.skip(f"{name} is absent")
