"""One region's classifier: PCA, LDA, and the likelihood ratio of two faces being one person's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from common.errors import InputError
from geometry.arrays import Bools, Floats, Ints, frozen

MOST_COMPONENTS = 60
MOST_DIMENSIONS = 40
LEAST_SHARE = 0.6
"""A region of which less was measured has no vote."""

_VARIANCE = 0.998
_FLOOR_MM = 0.15
"""What a capture adds at least, and training on scans does not show: noise, registration."""


@dataclass(frozen=True, eq=False)
class Features:
    """``values`` (n, d): faces in the space of a region; ``known`` (n,): whether each has any."""

    values: Floats
    known: Bools


@dataclass(frozen=True, eq=False)
class RegionClassifier:
    """``mean_mm`` (p,), ``basis`` (p, k) orthonormal, ``spread_mm`` (k,), ``project`` (k, d).

    In the space of ``project`` captures of one person scatter by one about their mean in each
    dimension, and the persons by ``between`` (d,), a variance. Raises :class:`InputError` where
    the arrays do not fit together.
    """

    mean_mm: Floats
    basis: Floats
    spread_mm: Floats
    project: Floats
    between: Floats

    def __post_init__(self) -> None:
        for name in ("mean_mm", "basis", "spread_mm", "project", "between"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        places, components, dimensions = len(self.mean_mm), len(self.spread_mm), len(self.between)
        fits = (
            self.basis.shape == (places, components)
            and self.project.shape == (components, dimensions)
            and self.between.shape == (dimensions,)
            and all(
                np.isfinite(a).all()
                for a in (self.mean_mm, self.basis, self.spread_mm, self.project, self.between)
            )
            and (self.between > 0.0).all()
            and (self.spread_mm > 0.0).all()
        )
        if not fits:
            raise InputError(
                "classifier", "the arrays of a classifier do not fit together", "train it again"
            )

    def features(self, depth_mm: Floats) -> Features:
        """Range values (n, p) of the region, NaN for holes, as points of its space."""
        there = np.isfinite(depth_mm)
        known = there.mean(axis=1) >= LEAST_SHARE
        whole = there.all(axis=1)
        centred = np.where(there, depth_mm - self.mean_mm, 0.0)
        components = centred @ self.basis
        for row in np.flatnonzero(known & ~whole):
            components[row] = self._fitted(centred[row], there[row])
        values = components @ self.project
        values[~known] = 0.0
        return Features(values, known)

    def _fitted(self, centred: Floats, there: Bools) -> Floats:
        """Components of a face with holes: the most likely ones given what is there."""
        part = self.basis[there]
        prior = np.diag((_FLOOR_MM / self.spread_mm) ** 2)
        return np.asarray(np.linalg.solve(part.T @ part + prior, part.T @ centred[there]))

    def ratio(self, enrolled: Floats, captures: Ints, probes: Floats) -> Floats:
        """Log likelihood ratios (n, m) of enrolled (n, d) and probes (m, d) being one person.

        ``enrolled`` are means of ``captures`` (n,) captures each. Both are normal: what persons
        have in common with themselves is ``between``, each capture adds a scatter of one.
        """
        own = self.between + 1.0
        mean = self.between + 1.0 / captures[:, None]
        rho2 = self.between**2 / (own * mean)
        rest = 2.0 * (1.0 - rho2)
        # Both are scaled to unit variance; rho is their correlation when one person.
        x2 = enrolled**2 / mean
        gain = -0.5 * np.log1p(-rho2).sum(axis=1) - (rho2 / rest * x2).sum(axis=1)
        cross = (2.0 * self.between / (mean * own) / rest * enrolled) @ probes.T
        square = (rho2 / rest) @ (probes**2 / own).T
        return np.asarray(gain[:, None] + cross - square)


def train_classifier(depth_mm: Floats, person: Ints) -> RegionClassifier:
    """A classifier from range values (n, p) without holes and the person (n,) of each."""
    mean = depth_mm.mean(axis=0)
    basis, spread = _principal(depth_mm - mean)
    components = (depth_mm - mean) @ basis
    numbers, index, count = np.unique(person, return_inverse=True, return_counts=True)
    means = np.stack(
        [np.bincount(index, components[:, k]) / count for k in range(components.shape[1])], axis=1
    )
    rest = components - means[index]
    freedom = max(len(components) - len(numbers), 1)
    within = rest.T @ rest / freedom
    # Few captures leave directions in which nobody happened to vary.
    within += np.eye(len(within)) * (_floor(len(mean)) + 0.01 * np.trace(within) / len(within))
    among = np.cov(means.T, aweights=count).reshape(within.shape)
    values, vectors = eigh(among, within)
    most = min(MOST_DIMENSIONS, len(numbers) - 1, len(values))
    order = np.argsort(values)[::-1][:most]
    captures = len(components) / len(numbers)
    # Means of few captures scatter by more than the persons do.
    between = np.maximum(values[order] - 1.0 / captures, 0.01)
    return RegionClassifier(mean, basis, spread, vectors[:, order], between)


def _floor(places: int) -> float:
    """Variance of one component, mm2: errors are alike over some ten places of the grid."""
    return _FLOOR_MM**2 * min(10.0, places)


def _principal(centred: Floats) -> tuple[Floats, Floats]:
    """Principal directions (p, k) of rows (n, p), and the spread (k,) along each, mm."""
    count, places = centred.shape
    if count <= places:
        values, vectors = np.linalg.eigh(centred @ centred.T)
        order = np.argsort(values)[::-1]
        values, vectors = np.maximum(values[order], 0.0), vectors[:, order]
        kept = _kept(values, count)
        basis = centred.T @ vectors[:, :kept] / np.sqrt(values[:kept])
    else:
        values, vectors = np.linalg.eigh(centred.T @ centred)
        order = np.argsort(values)[::-1]
        values, basis = np.maximum(values[order], 0.0), vectors[:, order]
        kept = _kept(values, count)
        basis = basis[:, :kept]
    return np.asarray(basis), np.sqrt(values[:kept] / max(count - 1, 1))


def _kept(values: Floats, count: int) -> int:
    share = np.cumsum(values) / max(float(values.sum()), 1e-30)
    enough = int(np.searchsorted(share, _VARIANCE)) + 1
    positive = int((values > 1e-9 * max(float(values[0]), 1e-30)).sum())
    return max(1, min(enough, MOST_COMPONENTS, count - 1, positive))
