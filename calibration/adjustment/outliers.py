"""After an adjustment: which image points are blunders, and how good the others really are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from calibration.adjustment.components import Component, image_components
from calibration.adjustment.levenberg import Solution, misfits
from calibration.adjustment.network import Network
from calibration.adjustment.options import CalibrationOptions
from calibration.adjustment.reliability import Reliability
from geometry.arrays import Bools, Floats

LEAST_SIGMA_PX = 0.01
"""Residuals may make stated sigmas smaller, but not below this: what fits to a few thousandths of
a pixel is still pulled by paper, light and optics, differently in each picture. Tests with
smaller sigmas would raise alarms about nothing that matters."""

LATE = 2.5
LEAST_VIEWS = 5
LEAST_IN_VIEW = 4
"""A view (one camera, one place of a carrier) is late when half its points are off by more than
this many times what is usual, for the camera and for its sigmas: nothing in the picture is wrong,
but its moment."""

_USUAL = float(np.sqrt(2.0 * np.log(2.0)))
"""Median length of a residual in sigmas: two degrees of freedom."""

BLUNDER_CHANCE = 0.01
"""Chance that a set of good observations loses one of them to the test."""

MOST_LOST = 0.25
"""A camera whose model is wrong would lose its border; it may lose no more than this share."""

OWN_FACTOR = 1.25
"""A camera gets a sigma of its own when it is worse than all together by this, not by chance."""


def settle(
    solution: Solution,
    network: Network,
    found: Reliability,
    options: CalibrationOptions,
    equal: bool,
    moving: Bools,
) -> tuple[Bools, Floats]:
    """Blunders (n,), and factors (cameras,) by which stated sigmas are to be changed.

    ``moving`` (places,): see :func:`late_points`.

    Cameras get sigmas of their own once, when nothing bad is left and they have none yet
    (``equal``). Repeated, the best would be believed more and more: it would take the moving
    plates for itself, fit them ever better, and drive the residuals into the others.
    """
    count = network.camera_count
    bad = np.zeros(len(found.t), bool)
    if options.reject:
        bad = late_points(solution, network, moving)
        # Views go first: their points would each look like a blunder of its own.
        bad = bad if bad.any() else _blunders(network, found, options.rescale)
    if not options.rescale:
        return bad, np.ones(count)
    # Good points count in full even where the loss holds them back: a camera that is noisier
    # than stated would otherwise seem half as noisy as it is.
    good = np.where(bad, 0.0, 1.0)
    whole, *each = image_components(replace(solution, weights=good), network, _kept(found, ~bad))
    if bad.any() or not equal:
        change = np.full(count, whole.factor if whole.significant else 1.0)
    else:
        change = _own_factors(each)
    return bad, np.maximum(change, _least_factor(network))


def _least_factor(network: Network) -> float:
    """How much smaller the sigmas in use may become."""
    rows = network.camera_rows
    own = [network.sigma_px[rows[k] : rows[k + 1]] for k in range(network.camera_count)]
    usual = np.array([np.median(sigmas) if sigmas.size else LEAST_SIGMA_PX for sigmas in own])
    return float(np.minimum(1.0, LEAST_SIGMA_PX / usual).max())


def _own_factors(each: list[Component]) -> Floats:
    """Factors of cameras, common to all that are not much worse than the rest."""
    factor = np.array([c.factor for c in each])
    freedom = np.array([max(c.redundancy, 1.0) for c in each])
    relative = factor / np.median(factor)
    worse = (relative > OWN_FACTOR) & (relative**2 - 1.0 > 3.0 * np.sqrt(2.0 / freedom))
    others = ~worse
    pooled = float(np.sqrt(np.sum((factor**2 * freedom)[others]) / freedom[others].sum()))
    shared = Component("", pooled, float(freedom[others].sum()), 0)
    return np.where(worse, factor, pooled if shared.significant else 1.0)


def _kept(found: Reliability, good: Bools) -> Reliability:
    return Reliability(found.redundancy * good[:, None], found.w, found.t)


def late_points(solution: Solution, network: Network, moving: Bools) -> Bools:
    """Points (n,) of views that were taken at another moment than the other cameras' views.

    Of each place the worst view only: the others may have suffered from it. Only places of what
    is ``moving`` (places,) count: what stands still is where it is at every moment.
    """
    observed, misfit = network.observed, misfits(solution.residuals, network)
    keys = observed.camera * network.pose_count + observed.pose
    views, view = np.unique(keys, return_inverse=True)
    view = view.reshape(-1)
    middle = np.array([np.median(misfit[view == k]) for k in range(len(views))])
    counts, camera, place = (
        np.bincount(view),
        views // network.pose_count,
        views % network.pose_count,
    )
    late = np.zeros(len(views), bool)
    for c in range(network.camera_count):
        own = camera == c
        if own.sum() >= LEAST_VIEWS:
            late[own] = middle[own] > LATE * max(float(np.median(middle[own])), _USUAL)
    worst = np.zeros(network.pose_count)
    np.maximum.at(worst, place, middle)
    late &= (counts >= LEAST_IN_VIEW) & (middle >= worst[place]) & moving[place]
    return np.asarray(late[view])


def _blunders(network: Network, found: Reliability, rescale: bool) -> Bools:
    """Points that fail the test, the worst of each target at a place first.

    A blunder also spoils the residuals of the other images of its target: those must wait for
    the next adjustment, which goes without it.
    """
    t = found.t.copy()
    rows = network.camera_rows
    if rescale:
        for k in range(network.camera_count):
            own = slice(rows[k], rows[k + 1])
            if rows[k + 1] > rows[k]:
                # The median of chi-square with two degrees of freedom is 2 log 2.
                t[own] /= max(1.0, float(np.median(t[own])) / (2.0 * np.log(2.0)))
    bad = t > chdtri(2, BLUNDER_CHANCE / max(len(t), 1))
    key = network.observed.pose * network.target_count + network.observed.target
    worst = np.zeros(int(key.max(initial=0)) + 1)
    np.maximum.at(worst, key, t)
    bad &= t >= worst[key]
    for k in range(network.camera_count):
        own = slice(rows[k], rows[k + 1])
        if bad[own].sum() > MOST_LOST * (rows[k + 1] - rows[k]):
            bad[own] = False
    return bad
