"""When an exposure was, from the share of it for which each bit of a Gray-coded counter was 1.

Times are in ticks of the counter. Bit k of the Gray code of n is 1 while ``n mod 2**(k+2)`` is in
``[2**k, 3 * 2**k)``, so its integral over any interval has a closed form, and the shares of all
bits are known functions of the interval's middle and length. Those two are fitted by least
squares: the slow bits say roughly when, bits that change within the interval say exactly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import Floats

_ZOOMS = 11
_SIDE = 13
_KEPT = 3
_ZOOMED = 10
_WIDENINGS = 3
_RIVAL = 4.0
"""Standard deviations within which another place explains the shares nearly as well."""
_NOMINAL_SIGMA = 0.1
"""An exposure time that a camera states is believed to this share of itself."""

_SHORTEST_TICKS = 0.02
_SHORT_TICKS = 4.0
"""Below this length the slopes of the shares say too little, and the whole likelihood is taken."""


@dataclass(frozen=True)
class Interval:
    """An exposure in ticks, with standard deviations; ``residual`` is the rms misfit of shares."""

    middle_ticks: float
    length_ticks: float
    middle_sigma_ticks: float
    length_sigma_ticks: float
    residual: float


def lit_shares(middle_ticks: Floats, length_ticks: Floats, bits: int) -> Floats:
    """Share of each exposure for which each bit was 1: (..., bits) for arrays (...)."""
    start = np.asarray(middle_ticks - 0.5 * length_ticks)[..., None]
    end = np.asarray(middle_ticks + 0.5 * length_ticks)[..., None]
    return np.asarray((_lit_before(end, bits) - _lit_before(start, bits)) / (end - start))


def _lit_before(ticks: Floats, bits: int) -> Floats:
    """Ticks for which each bit was 1 between 0 and ``ticks`` (..., 1): (..., bits)."""
    quarter = 2.0 ** np.arange(bits)
    # The top bit has no bit above it to turn it off half way: it is 1 for the upper half.
    rise = quarter.copy()
    fall = 3.0 * quarter
    rise[-1] = quarter[-1]
    fall[-1] = 2.0 * quarter[-1]
    period = 4.0 * quarter
    period[-1] = 2.0 * quarter[-1]
    turns = np.floor(ticks / period)
    rest = ticks - turns * period
    return np.asarray(turns * (fall - rise) + np.clip(rest - rise, 0.0, fall - rise))


def solve_interval(
    shares: Floats, sigmas: Floats, nominal_length_ticks: float | None = None
) -> Interval:
    """The exposure that explains ``shares`` (bits,) with standard deviations ``sigmas`` best.

    The middle is between 0 and ``2**bits``, the length at most a quarter of that.
    """
    bits = len(shares)
    starts: list[tuple[float, float, float, float]] = []
    for level in range(-3, bits - 2):
        starts += _starts(shares, sigmas, level, nominal_length_ticks)
    if not starts:
        # The stated length is beyond what the board can show; all lengths are tried instead.
        return solve_interval(shares, sigmas)
    found = _zoom(shares, sigmas, np.array(sorted(starts)[:_ZOOMED]), nominal_length_ticks)
    _, middle, length = found[0]
    if length < _SHORT_TICKS:
        best = _averaged_short(shares, sigmas, middle, nominal_length_ticks)
    else:
        best = _with_errors(shares, sigmas, middle, length, nominal_length_ticks)
    return _with_rivals(best, found, _misfit_scale(shares, sigmas, middle, length))


def _with_rivals(best: Interval, found: Floats, scale: float) -> Interval:
    """``best``, known no better than to a third of the way to any other place that may be it.

    ``found`` (n, 3): cost, middle and length of each place where the cost is least, best first.
    """
    rivals = found[:, 0] - found[0, 0] < (_RIVAL * scale) ** 2
    apart = np.abs(found[rivals, 1:] - found[0, 1:]).max(axis=0) / 3.0
    return replace(
        best,
        middle_sigma_ticks=max(best.middle_sigma_ticks, float(apart[0])),
        length_sigma_ticks=max(best.length_sigma_ticks, float(apart[1])),
    )


def _starts(
    shares: Floats, sigmas: Floats, level: int, nominal: float | None
) -> list[tuple[float, float, float, float]]:
    """Places to search from, for lengths of ``2**level`` to ``2**(level + 1)`` ticks.

    Each is (cost, middle, length, how far the middle may be off). A bit whose value lasts longer
    than the exposure changes at most once in it, and then its larger share is its value in the
    middle; so those bits give the middle to within one such time, by plain Gray decoding.
    """
    low, high = 2.0**level, 2.0 ** (level + 1)
    if nominal is not None and not 0.6 * low <= nominal <= 1.6 * high:
        return []
    bits = len(shares)
    first = min(max(level, 0), bits - 1)
    bit = shares[first:] > 0.5
    binary = np.logical_xor.accumulate(bit[::-1])[::-1]
    count = float((binary * 2.0 ** np.arange(first, bits)).sum())
    step = 2.0**first
    middles, lengths = count + step * np.linspace(-1.5, 2.5, 81), np.geomspace(low, high, 9)
    grid_m, grid_l = np.meshgrid(middles, lengths, indexing="ij")
    cost = _cost(shares, sigmas, grid_m, grid_l, nominal)
    best = np.argsort(cost, axis=None)[: 4 * _KEPT : 4]
    return [
        (float(cost.flat[k]), float(grid_m.flat[k]), float(grid_l.flat[k]), 0.08 * step)
        for k in best
    ]


def _cost(
    shares: Floats, sigmas: Floats, middle: Floats, length: Floats, nominal: float | None
) -> Floats:
    misfit = (lit_shares(middle, length, len(shares)) - shares) / sigmas
    cost = (misfit**2).sum(axis=-1)
    if nominal is not None:
        cost = cost + ((length / nominal - 1.0) / _NOMINAL_SIGMA) ** 2
    return np.asarray(cost)


def _zoom(shares: Floats, sigmas: Floats, starts: Floats, nominal: float | None) -> Floats:
    """Least cost near each start (n, 4), and where: (n, 3) cost, middle, length; least first.

    The cost is piecewise smooth with kinks at every tick, so grids that shrink round the best
    place are surer than following slopes.
    """
    here, half_m, half_l = starts[:, :3].copy(), starts[:, 3], 0.12 * starts[:, 2]
    side, rows = np.linspace(-1.0, 1.0, _SIDE), np.arange(len(starts))
    for _ in range(_ZOOMS):
        middles = here[:, 1, None] + half_m[:, None] * np.repeat(side, _SIDE)
        lengths = here[:, 2, None] + half_l[:, None] * np.tile(side, _SIDE)
        lengths = np.maximum(lengths, _SHORTEST_TICKS)
        cost = _cost(shares, sigmas, middles, lengths, nominal)
        k = cost.argmin(axis=1)
        there = np.stack([cost[rows, k], middles[rows, k], lengths[rows, k]], axis=1)
        here = np.where((there[:, 0] < here[:, 0])[:, None], there, here)
        half_m, half_l = 0.45 * half_m, 0.45 * half_l
    return np.asarray(here[np.argsort(here[:, 0])])


def _with_errors(
    shares: Floats, sigmas: Floats, middle: float, length: float, nominal: float | None
) -> Interval:
    """The interval, averaged as far about the best place as the slopes of the shares say."""
    bits = len(shares)
    step = 1e-3 * length
    moved = np.array([[step, 0.0], [-step, 0.0], [0.0, step], [0.0, -step]])
    values = lit_shares(middle + moved[:, 0], length + moved[:, 1], bits)
    slopes = np.stack([values[0] - values[1], values[2] - values[3]], axis=1) / (2.0 * step)
    weighted = slopes / sigmas[:, None]
    # No reading is worse than not knowing where in its length the interval lies.
    prior = np.array([0.3 * length, 0.5 * length if nominal is None else _NOMINAL_SIGMA * nominal])
    covariance = np.linalg.inv(weighted.T @ weighted + np.diag(prior**-2.0))
    width_m, width_l = np.sqrt(np.diag(covariance))
    best = Interval(middle, length, 0.0, 0.0, 0.0)
    # A kink near the best place makes its slopes steeper than the hill is: as far as it goes.
    for _ in range(_WIDENINGS):
        middles = middle + 6.0 * width_m * np.linspace(-1.0, 1.0, 121)
        lengths = length + 6.0 * width_l * np.linspace(-1.0, 1.0, 61)
        lengths = lengths[lengths > 0.2 * length]
        best = _averaged(shares, sigmas, middles, lengths, nominal)
        wide_m, wide_l = best.middle_sigma_ticks, best.length_sigma_ticks
        if wide_m < 1.3 * width_m and wide_l < 1.3 * width_l:
            break
        width_m, width_l = max(width_m, wide_m), max(width_l, wide_l)
    return best


def _averaged_short(
    shares: Floats, sigmas: Floats, middle: float, nominal: float | None
) -> Interval:
    """Over all short intervals about ``middle``.

    An exposure shorter than a tick may show no change at all: every place within the tick is
    then as likely as any other, which no slope at one place can tell.
    """
    middles = middle + np.linspace(-2.0, 2.0, 321)
    lengths = np.geomspace(_SHORTEST_TICKS, 2.0 * _SHORT_TICKS, 120)
    found = _averaged(shares, sigmas, middles, lengths, nominal)
    return replace(
        found,
        # The grid itself is no finer than this.
        middle_sigma_ticks=float(np.hypot(found.middle_sigma_ticks, 0.005)),
        length_sigma_ticks=float(np.hypot(found.length_sigma_ticks, 0.02 * found.length_ticks)),
    )


def _averaged(
    shares: Floats, sigmas: Floats, middles: Floats, lengths: Floats, nominal: float | None
) -> Interval:
    """Mean and standard deviation of the intervals of a grid, by their likelihood."""
    grid_m, grid_l = np.meshgrid(middles, lengths, indexing="ij")
    cost = _cost(shares, sigmas, grid_m, grid_l, nominal)
    k = int(cost.argmin())
    top = float(grid_m.flat[k]), float(grid_l.flat[k])
    weight = np.exp(-0.5 * (cost - cost.min()) / _misfit_scale(shares, sigmas, *top) ** 2)
    weight /= weight.sum()
    mean_m, mean_l = float((weight * grid_m).sum()), float((weight * grid_l).sum())
    return Interval(
        mean_m,
        mean_l,
        float(np.sqrt((weight * (grid_m - mean_m) ** 2).sum())),
        float(np.sqrt((weight * (grid_l - mean_l) ** 2).sum())),
        _residual(shares, *top),
    )


def _residual(shares: Floats, middle: float, length: float) -> float:
    misfit = lit_shares(np.array(middle), np.array(length), len(shares)) - shares
    return float(np.sqrt((misfit**2).mean()))


def _misfit_scale(shares: Floats, sigmas: Floats, middle: float, length: float) -> float:
    """By how much the stated errors are too small, at least 1.

    Squared: what misfits by more than chance is no chance, and pulls the middle further than as
    much noise would.
    """
    misfit = (lit_shares(np.array(middle), np.array(length), len(shares)) - shares) / sigmas
    return max(1.0, float((misfit**2).sum() / max(len(shares) - 2, 1)))
