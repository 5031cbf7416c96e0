"""What is made of the stated sigmas of image points when residuals contradict them.

Stated sigmas that are too large are all made smaller by one factor. Where residuals are larger
than stated, something that nobody stated is added to every point alike (cameras that are not
quite synchronised, paper that is not flat, a lens that the model does not fit): the sharpest
points have the smallest stated sigmas and would, were all multiplied, get nearly all the weight,
though that something spoils them just as much.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from geometry.arrays import Floats, Ints, frozen


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """The sigma in use of a camera's image point is ``hypot(scale * stated, added_px)``, (n,)."""

    scale: Floats
    added_px: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "scale", frozen(self.scale))
        object.__setattr__(self, "added_px", frozen(self.added_px))

    @classmethod
    def stated(cls, cameras: int) -> Self:
        """Sigmas as they are stated."""
        return cls(np.ones(cameras), np.zeros(cameras))

    @property
    def plain(self) -> bool:
        """Whether all cameras are treated alike."""
        return bool(np.ptp(self.scale) == 0.0 and np.ptp(self.added_px) == 0.0)

    def sigmas_px(self, stated_px: Floats, camera: Ints) -> Floats:
        """Sigmas in use (k, 2) of image points with stated ones (k, 2), by their cameras (k,)."""
        scaled = stated_px * self.scale[camera][:, None]
        return np.asarray(np.hypot(scaled, self.added_px[camera][:, None]))

    def changed(self, factor: Floats, stated_px: Floats, camera: Ints) -> Self:
        """With the usual sigma of each camera ``factor`` (n,) times what it is now."""
        now = self.sigmas_px(stated_px, camera)
        count = np.maximum(np.bincount(camera, minlength=len(factor)), 1)
        squares = np.bincount(camera, np.mean(now**2, axis=1), minlength=len(factor)) / count
        less = np.minimum(factor, 1.0)
        more = np.maximum(factor**2 - 1.0, 0.0) * squares
        return type(self)(self.scale * less, np.sqrt((self.added_px * less) ** 2 + more))
