"""What is adjusted: observations by index, priors, and what is free. No values of unknowns."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from calibration.adjustment.camera import PER_CAMERA
from calibration.adjustment.model import ObservationIndex
from geometry.arrays import Bools, Floats, Ints


@dataclass(frozen=True, eq=False)
class Priors:
    """Observed values of unknowns with their sigmas: 0 holds fast, infinity says nothing.

    ``interior`` and ``interior_sigma`` (n, 13); ``centre`` (n, 3), ``rotation`` (n, 3, 3) and
    ``exterior_sigma`` (n, 6) in mm and radians; ``target`` and ``target_sigma`` (m, 3).
    """

    interior: Floats
    interior_sigma: Floats
    centre: Floats
    rotation: Floats
    exterior_sigma: Floats
    target: Floats
    target_sigma: Floats


@dataclass(frozen=True, eq=False)
class Lengths:
    """Measured distances: ``first``, ``second`` (d,) index targets; mm."""

    first: Ints
    second: Ints
    length_mm: Floats
    sigma_mm: Floats


NO_LENGTHS = Lengths(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0), np.empty(0))


@dataclass(frozen=True, eq=False)
class Network:
    """One adjustment.

    ``observed`` (n,), ``pixel`` and ``sigma_px`` (n, 2): the image points, sorted by camera.
    ``pose_sigma`` (k, 6), mm and radians, of the places of carriers about their start: 0 holds
    one fast (it then defines the frame of an unknown carrier), a finite value only keeps turns
    that nothing observes, such as a bar's about itself, where they are.
    ``datum``: whether the frame is free, and ``datum_scale``: whether the scale is, too.
    """

    observed: ObservationIndex
    pixel: Floats
    sigma_px: Floats
    priors: Priors
    pose_sigma: Floats
    lengths: Lengths = NO_LENGTHS
    datum: bool = True
    datum_scale: bool = False
    camera_names: tuple[str, ...] = field(default=())

    @property
    def camera_count(self) -> int:
        """Number of cameras."""
        return len(self.priors.interior)

    @property
    def pose_count(self) -> int:
        """Number of placed carriers."""
        return len(self.pose_sigma)

    @property
    def target_count(self) -> int:
        """Number of targets."""
        return len(self.priors.target)

    @property
    def core_count(self) -> int:
        """Number of unknowns of cameras and carriers, held ones included."""
        return PER_CAMERA * self.camera_count + 6 * self.pose_count

    @cached_property
    def camera_free(self) -> Bools:
        """Which of its parameters each camera may change, (n, 19)."""
        p = self.priors
        return np.concatenate([p.interior_sigma > 0.0, p.exterior_sigma > 0.0], axis=1)

    @cached_property
    def core_free(self) -> Bools:
        """Which unknowns of the core may change, (core_count,)."""
        return np.concatenate([self.camera_free.ravel(), (self.pose_sigma > 0.0).ravel()])

    @cached_property
    def target_free(self) -> Bools:
        """Which target coordinates may change, (m, 3)."""
        return self.priors.target_sigma > 0.0

    @cached_property
    def kept(self) -> Ints:
        """Targets that stay in the core: measured distances tie them to one another."""
        both = np.concatenate([self.lengths.first, self.lengths.second])
        return np.unique(both).astype(np.int64)

    @cached_property
    def eliminated(self) -> Ints:
        """Targets that the Schur complement takes out."""
        return np.setdiff1d(np.arange(self.target_count), self.kept).astype(np.int64)

    @cached_property
    def unknown_count(self) -> int:
        """Number of free unknowns less the defect of the datum."""
        defect = (6 + self.datum_scale) if self.datum else 0
        return int(self.core_free.sum() + self.target_free.sum()) - defect

    @cached_property
    def observation_count(self) -> int:
        """Number of observed values: pixels, distances and finite priors."""
        finite = sum(int((np.isfinite(s) & (s > 0.0)).sum()) for s in self._prior_sigmas())
        return 2 * len(self.pixel) + len(self.lengths.length_mm) + finite

    def _prior_sigmas(self) -> tuple[Floats, ...]:
        p = self.priors
        return p.interior_sigma, p.exterior_sigma, p.target_sigma

    @cached_property
    def camera_rows(self) -> Ints:
        """Where the image points of each camera begin and end, (n + 1,)."""
        return np.searchsorted(self.observed.camera, np.arange(self.camera_count + 1))
