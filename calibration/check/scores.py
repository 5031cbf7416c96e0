"""Score tests of all hypotheses at once, from one fit of the unchanged rig.

The score ``g = C^T v`` of a hypothesis with directions C is normal with covariance ``M`` when
nothing happened, so ``T = g^T M^+ g`` is chi-square with rank(M) degrees of freedom; when the
hypothesis is true, T is noncentral and largest for it (Foerstner's form of Baarda's test).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc, chdtri

from calibration.check.hypotheses import Hypothesis, log_tail
from calibration.check.linear import GONE, Linear
from geometry.arrays import Floats, Ints

RANK = 1e-8
"""Directions whose variance is below this share of the hypothesis's largest are not tested: the
images do not show them."""


@dataclass(frozen=True, eq=False)
class Outcomes:
    """``statistic``, ``dof`` and ``log_p`` (h,) of all hypotheses.

    ``margin`` (h,): how far beyond its own limit each is, in natural logarithms of chance:
    above 0 it alarms.
    """

    statistic: Floats
    dof: Ints
    log_p: Floats
    margin: Floats


class ScoreTests:
    """The tests of many hypotheses, prepared: each is a few columns applied to the score."""

    def __init__(self, hypotheses: tuple[Hypothesis, ...], linear: Linear) -> None:
        """``linear``: the model whose score is to be tested."""
        self.hypotheses = hypotheses
        reduced = _reduced(hypotheses, linear)
        roots = [h.ways @ r for h, r in zip(hypotheses, reduced, strict=True)]
        self.dof: Ints = np.array([r.shape[1] for r in roots], dtype=np.int64)
        self._root = np.zeros((linear.columns.count, int(self.dof.sum())))
        self._first = np.concatenate([[0], np.cumsum(self.dof)]).astype(np.int64)
        for k, root in enumerate(roots):
            self._root[hypotheses[k].columns, self._first[k] : self._first[k + 1]] = root
        self._log_alpha = np.log([h.alpha for h in hypotheses])

    def run(self, score: Floats) -> Outcomes:
        """All tests of a score (base,)."""
        parts = (self._root.T @ score) ** 2
        ends = np.concatenate([[0.0], np.cumsum(parts)])
        statistic = ends[self._first[1:]] - ends[self._first[:-1]]
        log_p = self._log_tails(statistic)
        return Outcomes(statistic, self.dof, log_p, self._log_alpha - log_p)

    def _log_tails(self, statistic: Floats) -> Floats:
        dof = np.maximum(self.dof, 1)
        out = np.log(chdtrc(dof, np.minimum(statistic, 500.0)))
        for k in np.flatnonzero(statistic > 500.0):
            out[k] = log_tail(float(statistic[k]), int(dof[k]))
        return np.where(self.dof > 0, out, 0.0)

    def limit(self, index: int) -> float:
        """The statistic at which a hypothesis alarms."""
        return float(chdtri(max(int(self.dof[index]), 1), self.hypotheses[index].alpha))


def _reduced(hypotheses: Sequence[Hypothesis], linear: Linear) -> list[Floats]:
    """R (d, rank) of each, with ``R R^T`` the pseudo-inverse of its covariance (d, d)."""
    out: list[Floats] = [np.zeros((0, 0))] * len(hypotheses)
    shapes: dict[tuple[int, ...], list[int]] = {}
    for k, h in enumerate(hypotheses):
        shapes.setdefault(h.ways.shape, []).append(k)
    # All of one shape at once: there are hundreds, and each is tiny.
    for members in shapes.values():
        same = [hypotheses[k] for k in members]
        for k, root in zip(members, _of_one_shape(same, linear), strict=True):
            out[k] = root
    return out


def _of_one_shape(hypotheses: Sequence[Hypothesis], linear: Linear) -> list[Floats]:
    places, directions = (
        np.stack([h.columns for h in hypotheses]),
        np.stack([h.ways for h in hypotheses]),
    )
    square = places[:, :, None], places[:, None, :]
    own = np.swapaxes(directions, 1, 2) @ linear.spread[square] @ directions
    full = np.sum(directions * (linear.normal[square] @ directions), axis=1)
    diagonal = np.einsum("hdd->hd", own)
    # What others determine has but rounding left: it must not be blown up to a unit.
    kept = diagonal > GONE * full
    scale = np.where(kept, np.sqrt(np.where(kept, diagonal, 1.0)), np.inf)
    sizes, axes = np.linalg.eigh(own / (scale[:, :, None] * scale[:, None, :]))
    good = sizes > RANK * np.maximum(sizes.max(axis=1, initial=0.0), RANK)[:, None]
    roots = axes / scale[:, :, None] / np.sqrt(np.where(good, sizes, 1.0))[:, None, :]
    return [root[:, rows] for root, rows in zip(roots, good, strict=True)]


def estimate(hypothesis: Hypothesis, linear: Linear, score: Floats) -> tuple[Floats, Floats]:
    """The most likely change (d,) along a hypothesis's directions, and its covariance (d, d)."""
    (reduced,) = _reduced((hypothesis,), linear)
    right = hypothesis.ways.T @ score[hypothesis.columns]
    return np.asarray(reduced @ (reduced.T @ right)), np.asarray(reduced @ reduced.T)
