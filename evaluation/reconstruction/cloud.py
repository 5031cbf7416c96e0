"""The result of a reconstruction: points with normals, colour, sigma and number of views."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.errors import InputError
from geometry.arrays import Floats, frozen

Bytes = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Cloud:
    """Measured points of a surface.

    ``points_mm``, ``normals`` (N, 3) in the rig frame, ``colours`` (N, 3) RGB of 8 bits,
    ``sigma_mm`` (N,) standard deviation along the normal, ``views`` (N,) cameras that agreed.
    """

    points_mm: Floats
    normals: Floats
    colours: Bytes
    sigma_mm: Floats
    views: NDArray[np.uint8]

    def __post_init__(self) -> None:
        count = len(self.points_mm)
        shapes = (
            self.points_mm.shape == (count, 3)
            and self.normals.shape == (count, 3)
            and self.colours.shape == (count, 3)
            and self.sigma_mm.shape == (count,)
            and self.views.shape == (count,)
        )
        if not shapes or not np.isfinite(self.points_mm).all():
            raise InputError(
                "cloud", "a cloud's points, normals, colours, sigmas and views do not match",
                "give one of each for every point",
            )  # fmt: skip
        object.__setattr__(self, "points_mm", frozen(self.points_mm))
        object.__setattr__(self, "normals", frozen(self.normals))
        object.__setattr__(self, "sigma_mm", frozen(self.sigma_mm))

    def __len__(self) -> int:
        return len(self.points_mm)
