"""Detection, identification, adaptation: one cause after the other until the rest is noise.

All single hypotheses are tested at once. The one farthest beyond its own limit is accepted and
its parameters set free, and the rest is tested anew. When several cameras are found, all sets of
as many cameras are compared, so that two causes cannot hide behind a third.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from calibration.adjustment.state import State
from calibration.check.alike import alike
from calibration.check.epoch import Epoch
from calibration.check.fit import Fit, again, fit, refit
from calibration.check.hypotheses import Cause, Hypothesis, hypotheses, log_tail
from calibration.check.linear import Linear
from calibration.check.scores import Outcomes, ScoreTests, estimate
from calibration.check.shared import fewest
from calibration.check.suspects import convicted, fit_with, is_lens
from geometry.arrays import Bools, Floats, Ints

MOST_CAUSES = 16
ROW_CHANCE = 0.01
"""Chance that a check of good images leaves one point out as a blunder; that alarms nobody."""

MOST_OUTLIERS = 0.05
LARGE_PX = 3.0
"""Changes beyond this are compared by full fits: the linear statistics mislead there."""

SHORTLIST = 6
MOST_SETS = 2000


@dataclass(frozen=True, eq=False)
class Prepared:
    """What does not change from check to check of one rig with one set of sights."""

    linear: Linear
    tests: ScoreTests

    @classmethod
    def of(cls, epoch: Epoch, state: State) -> Prepared:
        """For an epoch about a state near its fit."""
        linear = Linear(epoch, state)
        return cls(linear, ScoreTests(hypotheses(epoch), linear))


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What was found.

    ``first``: fit, tests and their outcomes with nothing changed; ``last``: the fit with all
    ``accepted`` causes free. ``epoch`` is without the ``outliers`` rows (of the given one).
    ``start``: the state that the fits began with.
    """

    epoch: Epoch
    first: Fit
    tests: ScoreTests
    outcomes: Outcomes
    accepted: tuple[Hypothesis, ...]
    last: Fit
    outliers: int
    start: State

    @property
    def nobody_stands(self) -> bool:
        """Whether so many cameras changed that nobody can say which did: two must agree."""
        blamed = {h.subject for h in self.accepted if h.cause in (Cause.POSE, Cause.LENS)}
        return len(blamed) > 1 and len(np.unique(self.epoch.camera)) - len(blamed) < 2


def diagnose(
    epoch: Epoch, state: State, suspects: tuple[int, ...] = (), prepared: Prepared | None = None
) -> Diagnosis:
    """What happened, one cause after the other; see the module.

    ``suspects``: cameras that are so far off that linear tests would mislead: they are set free
    from the beginning.
    """
    first = fit(epoch, state, prepared.linear if prepared else None)
    if not suspects:
        epoch, first, lost = _cleaned(epoch, first)
    else:
        lost = 0
    if prepared is not None and first.linear is prepared.linear:
        tests = prepared.tests
    else:
        tests = ScoreTests(hypotheses(epoch), first.linear)
    outcomes = tests.run(first.score)
    last, accepted, present, current = first, [], outcomes, tests
    if suspects:
        accepted = list(alike(epoch, state, tests.hypotheses))
        accepted = accepted or convicted(epoch, state, tests.hypotheses, suspects, first)
        last = fit_with(epoch, state, accepted)
        epoch, last, lost = _cleaned(epoch, last)
        current = ScoreTests(tests.hypotheses, last.linear)
        present = current.run(last.score)
    while len(accepted) < MOST_CAUSES and present.margin.max(initial=-np.inf) > 0.0:
        chosen = _chosen(epoch, last, current, present)
        if chosen in accepted:
            break  # free already and still failing: no cause that is known here explains the rest
        better = [*accepted, chosen]
        if not suspects:
            better = _best_cameras(better, tests, first)
        if _size_px(epoch, last, chosen) > LARGE_PX:
            # The last fit bent the reference to what it did not know of: start without it.
            last = fit_with(epoch, state, better)
        elif better[:-1] == accepted:
            last = refit(epoch, last, _together([chosen], last), near=True)
        else:
            same = len(first.v) == len(epoch.pixel)
            last = refit(epoch, first, _together(better, first), near=same)
        accepted = better
        current = ScoreTests(tests.hypotheses, last.linear)
        present = current.run(last.score)
    accepted, last = _pruned(epoch, state, accepted, last)
    accepted, last = fewest(epoch, state, tests.hypotheses, accepted, last)
    return Diagnosis(epoch, first, tests, outcomes, tuple(accepted), last, lost, state)


def _pruned(
    epoch: Epoch, state: State, accepted: list[Hypothesis], last: Fit
) -> tuple[list[Hypothesis], Fit]:
    """Without causes that were accepted early and that later ones explain as well."""
    if len(accepted) < 2 or len({h.cause for h in accepted}) < 2:
        return accepted, last
    whole, kept = fit_with(epoch, state, accepted), list(accepted)
    for one in accepted:
        if one.cause is Cause.POSE:
            continue
        fewer = [h for h in kept if h is not one]
        without = fit_with(epoch, state, fewer)
        if without.chi2 - whole.chi2 < chdtri(one.ways.shape[1], one.alpha):
            kept, last = fewer, without
    return kept, last


def _together(causes: list[Hypothesis], last: Fit) -> Floats:
    base = last.linear.columns.count
    return np.concatenate([h.directions(base) for h in causes], axis=1)


def _cleaned(epoch: Epoch, first: Fit) -> tuple[Epoch, Fit, int]:
    """Without single blunders: points that fail alone while their cameras and targets do not."""
    lost, limit = 0, chdtri(2, ROW_CHANCE / max(len(epoch.pixel), 1))
    while lost < MOST_OUTLIERS * len(epoch.pixel):
        t = np.sum(first.v**2 / np.maximum(1.0 - first.linear.leverage, 1e-3), axis=1)
        bad = _lonely(epoch, t, float(limit))
        if not bad.any():
            break
        lost += int(bad.sum())
        epoch = epoch.with_rows(~bad)
        first = again(epoch, first)
    return epoch, first, lost


def _lonely(epoch: Epoch, t: Floats, limit: float) -> Bools:
    """Failing points whose camera and target are fine otherwise, the worst of each target."""
    bad = t > limit
    if not bad.any():
        return bad
    worst = np.zeros(int(epoch.points.max()) + 1)
    np.maximum.at(worst, epoch.points, t)
    bad &= t >= worst[epoch.points]
    # A cause that touches a whole camera, view or target is a finding and no blunder.
    for group in (epoch.view, epoch.target):
        middle = np.array(
            [
                np.median(t[group == k]) if (group == k).any() else 0.0
                for k in range(int(group.max()) + 1)
            ]
        )
        bad &= t > 25.0 * np.maximum(middle[group], 1.0) / 2.0
    return bad


def _chosen(epoch: Epoch, last: Fit, tests: ScoreTests, outcomes: Outcomes) -> Hypothesis:
    """The cause that explains most for its freedom."""
    order = np.argsort(-outcomes.margin)[:SHORTLIST]
    best = int(order[0])
    if _size_px(epoch, last, tests.hypotheses[best]) > LARGE_PX:
        best = _by_full_fits(epoch, last, tests, order[outcomes.margin[order] > 0.0])
    chosen = tests.hypotheses[best]
    if chosen.cause in (Cause.POSE, Cause.LENS):
        return _pose_or_lens(epoch, last, tests, chosen.subject)
    return chosen


def _size_px(epoch: Epoch, last: Fit, hypothesis: Hypothesis) -> float:
    """Largest shift of an image point by the most likely change."""
    change, _ = estimate(hypothesis, last.linear, last.score)
    translation = last.linear.design @ (hypothesis.directions(last.linear.columns.count) @ change)
    return float(np.abs(translation.reshape(-1, 2) * epoch.sigma_px).max())


def _by_full_fits(epoch: Epoch, last: Fit, tests: ScoreTests, order: Ints) -> int:
    margins = []
    for k in order:
        hypothesis = tests.hypotheses[int(k)]
        gain = _gain(epoch, last, [hypothesis])
        margins.append(float(np.log(hypothesis.alpha)) - log_tail(gain, int(tests.dof[k])))
    return int(order[int(np.argmax(margins))])


def _gain(epoch: Epoch, last: Fit, causes: list[Hypothesis]) -> float:
    """How much of chi-square causes explain, by a full fit with them free."""
    return last.chi2 - refit(epoch, last, _together(causes, last), near=False).chi2


def _pose_or_lens(epoch: Epoch, last: Fit, tests: ScoreTests, camera: int) -> Hypothesis:
    """Whether a camera moved or its lens changed."""
    own = {(h.cause, h.subject): h for h in tests.hypotheses}
    pose, lens = own[Cause.POSE, camera], own[Cause.LENS, camera]
    sets = ([pose], [lens], [pose, lens])
    if max(_size_px(epoch, last, pose), _size_px(epoch, last, lens)) > LARGE_PX:
        gains = [_gain(epoch, last, s) for s in sets]
    else:
        gains = [_statistic(s, last) for s in sets]
    return lens if is_lens(*gains) else pose


def _statistic(causes: list[Hypothesis], last: Fit) -> float:
    """The joint statistic of several causes."""
    directions = _together(causes, last)
    inner = directions.T @ last.linear.spread @ directions
    right = directions.T @ last.score
    scale = np.sqrt(np.maximum(np.diag(inner), 1e-300))
    inverse = np.linalg.pinv(inner / np.outer(scale, scale), rcond=1e-9, hermitian=True)
    return float((right / scale) @ inverse @ (right / scale))


def _best_cameras(accepted: list[Hypothesis], tests: ScoreTests, first: Fit) -> list[Hypothesis]:
    """The accepted cameras, exchanged for another set of as many when that explains more."""
    moved = [h for h in accepted if h.cause is Cause.POSE]
    others = [h for h in accepted if h.cause is not Cause.POSE]
    poses = [h for h in tests.hypotheses if h.cause is Cause.POSE]
    count = len(moved)
    if count < 2 or others or _choices(len(poses), count) > MOST_SETS:
        return accepted
    sets = [list(s) for s in itertools.combinations(poses, count)]
    return max(sets, key=lambda s: _statistic(s, first))


def _choices(n: int, k: int) -> int:
    out = 1
    for j in range(k):
        out = out * (n - j) // (j + 1)
    return out
