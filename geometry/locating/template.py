"""What a face looks like: an average one, and the ways in which faces differ.

Made by ``benchmarks/face_template.py`` from people of the ICT FaceKit model with expressions and
heads of the bundled generator. The frame's origin is the nose tip; its axes are those of the rig
frame for a head that stands upright and looks at the cameras: X to the subject's left, Y into
the head, Z up.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.resources import files

import numpy as np

from geometry.arrays import Floats, frozen

RADIUS_MM = 108.0
"""The template reaches this far from the nose tip: forehead, cheeks, chin."""

_EYE_MM = (44.5, 45.7, 33.6)


@dataclass(frozen=True, eq=False)
class FaceTemplate:
    """``points_mm`` (N, 3) of a face with outward ``normals`` (N, 3).

    ``modes_mm`` (N, 3, m): how each point moves when a face differs from the average by one
    standard deviation in each of m independent ways, the greatest first. ``left_eye_mm`` and
    ``right_eye_mm`` (3,) are the outer corners of the subject's eyes.
    """

    points_mm: Floats
    normals: Floats
    modes_mm: Floats
    left_eye_mm: Floats
    right_eye_mm: Floats

    def thinned(self, every: int) -> FaceTemplate:
        """With one point in ``every``."""
        return replace(
            self,
            points_mm=self.points_mm[::every],
            normals=self.normals[::every],
            modes_mm=self.modes_mm[::every],
        )


@lru_cache(maxsize=1)
def face_template() -> FaceTemplate:
    """The average face, in an order in which every n-th point is spread over all of it."""
    with (files("geometry.locating") / "faces.npz").open("rb") as file, np.load(file) as kept:
        points, normals, modes = (
            np.asarray(kept[name], dtype=np.float64)
            for name in ("points_mm", "normals", "modes_mm")
        )
    order = np.random.default_rng(0).permutation(len(points))
    eye = np.array(_EYE_MM)
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return FaceTemplate(
        frozen(points[order]),
        frozen(normals[order]),
        frozen(modes[order]),
        frozen(eye),
        frozen(eye * [-1.0, 1.0, 1.0]),
    )
