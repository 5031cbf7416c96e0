"""Joint least-squares matching of one slanted patch over all views: the compiled inner loop.

A patch of the reference picture is a plane in space, and a plane's inverse depth is linear in the
picture: ``rho(u + i, v + j) = rho + a i + b j`` (1/mm). A view shows the patch's pixel at

    x = M (u, v, 1) + rho m,    M = K R R_ref' K_ref^-1,    m = K R (C_ref - C)

so three numbers describe its place and slant exactly. Grey values of each view are tied to the
reference's by a gain and an offset of its own, fitted anew in each step. Gauss-Newton on the
grey values of all views at once: least squares matching (Ackermann 1984, Gruen 1985) with the
geometry of the rig instead of free affinities.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

Singles = NDArray[np.float32]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FIELDS = 8
"""Numbers of a result: rho, a, b, variance of rho, correlation, views, last step (px), spread."""


@njit(cache=True, fastmath=True, inline="always")
def _normal_equations(
    reference: Singles,
    grey: Singles,
    matrix: Floats,
    shift: Floats,
    u: float,
    v: float,
    rho: float,
    a: float,
    b: float,
    half: int,
    step: int,
    work: Floats,
    system: Floats,
    total: Floats,
) -> tuple[float, float]:
    """Adds one view's normal equations to ``system`` (3 x 4); returns (sum r2, correlation).

    ``total`` (n, 3) gathers the derivatives of all views at each sample, for the covariance.

    A correlation of -2 says that the patch leaves the picture.
    """
    height, width = grey.shape
    count = 0
    s_r = s_j = s_rr = s_jj = s_rj = 0.0
    s0 = s1 = s2 = 0.0
    for j in range(-half, half + 1):
        dv = float(j * step)
        for i in range(-half, half + 1):
            du = float(i * step)
            pu, pv = u + du, v + dv
            inverse = rho + a * du + b * dv
            x = matrix[0, 0] * pu + matrix[0, 1] * pv + matrix[0, 2] + inverse * shift[0]
            y = matrix[1, 0] * pu + matrix[1, 1] * pv + matrix[1, 2] + inverse * shift[1]
            w = matrix[2, 0] * pu + matrix[2, 1] * pv + matrix[2, 2] + inverse * shift[2]
            if w <= 1e-9:
                return 0.0, -2.0
            iw = 1.0 / w
            px, py = x * iw, y * iw
            if px < 1.0 or py < 1.0 or px >= width - 2.0 or py >= height - 2.0:
                return 0.0, -2.0
            cx, cy = int(px), int(py)
            fx, fy = px - cx, py - cy
            g00, g01 = grey[cy, cx], grey[cy, cx + 1]
            g10, g11 = grey[cy + 1, cx], grey[cy + 1, cx + 1]
            top, bottom = g00 + fx * (g01 - g00), g10 + fx * (g11 - g10)
            value = top + fy * (bottom - top)
            gx = (g01 - g00) + fy * ((g11 - g10) - (g01 - g00))
            gy = bottom - top
            # How the image point moves with the inverse depth.
            along = (gx * (shift[0] - px * shift[2]) + gy * (shift[1] - py * shift[2])) * iw
            ref = reference[int(pv), int(pu)]
            work[count, 0], work[count, 1], work[count, 2] = ref, value, along
            s_r += ref
            s_j += value
            s_rr += ref * ref
            s_jj += value * value
            s_rj += ref * value
            s0 += along
            s1 += along * du
            s2 += along * dv
            count += 1
    n = float(count)
    mean_r, mean_j = s_r / n, s_j / n
    var_r, var_j = s_rr / n - mean_r * mean_r, s_jj / n - mean_j * mean_j
    cov = s_rj / n - mean_r * mean_j
    if var_r <= 1e-12 or var_j <= 1e-12:
        return 0.0, -1.0
    gain = cov / var_j
    correlation = cov / math.sqrt(var_r * var_j)
    if gain <= 0.0:
        return 0.0, correlation
    m0, m1, m2 = s0 / n, s1 / n, s2 / n
    # The gain takes its part of each derivative away, as the offset takes the mean.
    part_0 = part_1 = part_2 = 0.0
    index = 0
    for j in range(-half, half + 1):
        dv = float(j * step)
        for i in range(-half, half + 1):
            du = float(i * step)
            centred = work[index, 1] - mean_j
            along = work[index, 2]
            part_0 += along * centred
            part_1 += along * du * centred
            part_2 += along * dv * centred
            index += 1
    q = 1.0 / (n * var_j)
    part_0, part_1, part_2 = part_0 * q, part_1 * q, part_2 * q
    index = 0
    rss = 0.0
    for j in range(-half, half + 1):
        dv = float(j * step)
        for i in range(-half, half + 1):
            du = float(i * step)
            centred = work[index, 1] - mean_j
            along = work[index, 2]
            residual = (work[index, 0] - mean_r) - gain * centred
            d0 = gain * (along - m0 - part_0 * centred)
            d1 = gain * (along * du - m1 - part_1 * centred)
            d2 = gain * (along * dv - m2 - part_2 * centred)
            system[0, 0] += d0 * d0
            system[0, 1] += d0 * d1
            system[0, 2] += d0 * d2
            system[1, 1] += d1 * d1
            system[1, 2] += d1 * d2
            system[2, 2] += d2 * d2
            system[0, 3] += d0 * residual
            system[1, 3] += d1 * residual
            system[2, 3] += d2 * residual
            total[index, 0] += d0
            total[index, 1] += d1
            total[index, 2] += d2
            rss += residual * residual
            index += 1
    return rss, correlation


@njit(cache=True, fastmath=True, inline="always")
def _solved(
    s: Floats,
    answer: Floats,
) -> float:
    """The symmetric 3 x 3 system by cofactors into ``answer``; returns the inverse's (0, 0)."""
    c00 = s[1, 1] * s[2, 2] - s[1, 2] * s[1, 2]
    c01 = s[0, 2] * s[1, 2] - s[0, 1] * s[2, 2]
    c02 = s[0, 1] * s[1, 2] - s[0, 2] * s[1, 1]
    det = s[0, 0] * c00 + s[0, 1] * c01 + s[0, 2] * c02
    if not det > 1e-9 * s[0, 0] * s[1, 1] * s[2, 2] or s[0, 0] <= 0.0:
        return -1.0
    c11 = s[0, 0] * s[2, 2] - s[0, 2] * s[0, 2]
    c12 = s[0, 1] * s[0, 2] - s[0, 0] * s[1, 2]
    c22 = s[0, 0] * s[1, 1] - s[0, 1] * s[0, 1]
    answer[0] = (c00 * s[0, 3] + c01 * s[1, 3] + c02 * s[2, 3]) / det
    answer[1] = (c01 * s[0, 3] + c11 * s[1, 3] + c12 * s[2, 3]) / det
    answer[2] = (c02 * s[0, 3] + c12 * s[1, 3] + c22 * s[2, 3]) / det
    return float(c00 / det)


@njit(cache=True, fastmath=True, inline="always")
def _variance(
    s: Floats,
    total: Floats,
    count: int,
) -> float:
    """Variance of rho for unit noise of a difference of two grey values; -1 where singular.

    The reference's noise stands in the residuals of all views, each view's own in one. With equal
    noise of s in both, the estimate has ``s^2 A^-1 (A + S) A^-1``, S the normal matrix of the
    views' summed derivatives: views on both sides cancel the reference's noise, views on one
    side repeat it. A residual shows ``s^2 (1 + 4/9)``: sampling between pixels leaves 2/3 x 2/3
    of a view's noise on average, but takes it from the fine waves that a patch averages anyway.
    """
    c00 = s[1, 1] * s[2, 2] - s[1, 2] * s[1, 2]
    c01 = s[0, 2] * s[1, 2] - s[0, 1] * s[2, 2]
    c02 = s[0, 1] * s[1, 2] - s[0, 2] * s[1, 1]
    det = s[0, 0] * c00 + s[0, 1] * c01 + s[0, 2] * c02
    if det <= 0.0:
        return -1.0
    both = 0.0
    for index in range(count):
        part = c00 * total[index, 0] + c01 * total[index, 1] + c02 * total[index, 2]
        both += part * part
    return float(9.0 / 13.0 * (c00 / det + both / (det * det)))


@njit(cache=True, fastmath=True)
def _refine_one(
    reference: Singles,
    greys: Singles,
    matrices: Floats,
    shifts: Floats,
    pixel: Ints,
    first: Floats,
    half: int,
    step: int,
    most: int,
    least: float,
    out: Floats,
) -> None:
    """One patch from its first guess (rho, a, b); fills ``out`` (FIELDS)."""
    views = matrices.shape[0]
    side = 2 * half + 1
    work = np.empty((side * side, 3))
    total = np.empty((side * side, 3))
    system = np.empty((3, 4))
    answer = np.zeros(3)
    used = np.ones(views, dtype=np.bool_)
    correlation = np.zeros(views)
    rho, a, b = first[0], first[1], first[2]
    u, v = float(pixel[0]), float(pixel[1])
    moved, variance, kept, rss = 1e9, -1.0, 0, 0.0
    for turn in range(most + 1):
        system[:] = 0.0
        total[:] = 0.0
        kept, rss = 0, 0.0
        for k in range(views):
            if used[k]:
                r2, c = _normal_equations(
                    reference, greys[k], matrices[k], shifts[k],
                    u, v, rho, a, b, half, step, work, system, total,
                )  # fmt: skip
                correlation[k] = c
                if c > -1.5:
                    kept += 1
                    rss += r2
                else:
                    used[k] = False
        if kept == 0:
            break
        variance = _solved(system, answer)
        if variance <= 0.0 or turn == most or moved < 0.003:
            break
        # In pixels of the view that sees the change most: what a step may be is told in these.
        scale = 0.0
        for k in range(views):
            if used[k]:
                m, t = matrices[k], shifts[k]
                w = m[2, 0] * u + m[2, 1] * v + m[2, 2] + rho * t[2]
                px = m[0, 0] * u + m[0, 1] * v + m[0, 2] + rho * t[0]
                py = m[1, 0] * u + m[1, 1] * v + m[1, 2] + rho * t[1]
                sx = (t[0] - px / w * t[2]) / w
                sy = (t[1] - py / w * t[2]) / w
                scale = max(scale, math.sqrt(sx * sx + sy * sy))
        moved = abs(answer[0]) * scale
        damp = min(1.0, 1.0 / moved) if moved > 0.0 else 1.0
        rho += damp * answer[0]
        a += damp * answer[1]
        b += damp * answer[2]
        if turn >= 1:
            for k in range(views):
                if used[k] and correlation[k] < least:
                    used[k] = False
    if variance > 0.0:
        variance = _variance(system, total, side * side)
    n = 0
    mean = 0.0
    for k in range(views):
        if used[k] and correlation[k] >= least:
            n += 1
            mean += correlation[k]
    out[0], out[1], out[2] = rho, a, b
    freedom = kept * side * side - 3 - 2 * kept
    out[3] = variance * rss / freedom if (variance > 0.0 and freedom > 0) else -1.0
    out[4] = mean / n if n > 0 else -1.0
    out[5] = float(n)
    out[6] = moved
    out[7] = rss / max(freedom, 1)


@njit(cache=True, parallel=True)
def refine(
    reference: Singles,
    greys: Singles,
    matrices: Floats,
    shifts: Floats,
    pixels: Ints,
    firsts: Floats,
    half: int,
    step: int,
    most: int,
    least: float,
) -> Floats:
    """Refines patches about ``pixels`` (N, 2) int of ``reference`` from ``firsts`` (N, 3).

    ``greys`` (K, H, W) float32, ``matrices`` (K, 3, 3), ``shifts`` (K, 3). The patch reaches
    ``half`` samples of ``step`` pixels to each side; at most ``most`` steps; views whose
    correlation stays below ``least`` are dropped. Returns (N, FIELDS); the variance is -1 where
    the patch cannot be placed.
    """
    out = np.zeros((pixels.shape[0], FIELDS))
    for n in prange(pixels.shape[0]):
        _refine_one(
            reference,
            greys,
            matrices,
            shifts,
            pixels[n],
            firsts[n],
            half,
            step,
            most,
            least,
            out[n],
        )
    return out
