"""A target's own picture fitted to grey levels: Gauss-Newton on everything that shapes it.

The expected picture is made from the pattern that was printed: mapped, blurred by a Gaussian and
averaged over pixels, all in one, so small and strongly blurred targets are expected as they look
and nothing needs to be left out. Its gradient tells how it changes with the map. Ink that
spreads, and cameras that are not linear, push all edges towards white or black alike: one more
parameter.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.special import ndtr

from calibration.detection import localmap
from calibration.targets.patterns import SOFTNESS, Pattern
from geometry.arrays import Bools, Floats

SAMPLES = 3
BLUR, BLACK, STEP, SLOPE, SPREAD = 10, 11, 12, slice(13, 15), 15
SIZE = 16
"""Parameters: the map's ten, blur (px), level of black, step to white, slope x and y, spread."""

_STEPS = 20
_ENOUGH_PX = 2e-4
_SMALLEST_BLUR, _LARGEST_BLUR = 0.2, 8.0
_SPREAD_SIGMA_PX = 0.5
_HELD_MATRIX, _HELD_TILT = 1e-3, 2e-5
"""0.05 px over 50 px between neighbours, and over the square of that (1/px)."""


@dataclass(frozen=True, eq=False)
class Window:
    """A piece of a picture, ``values`` (h, w); pixel (0, 0) has its middle at ``corner_px``.

    ``pitch_px``: side of its pixels in pixels of the picture (more than 1 where they were
    binned). Pixels that were binned are averages of whole blocks.
    """

    values: Floats
    corner_px: tuple[float, float]
    pitch_px: int = 1

    @property
    def pixels(self) -> Floats:
        """Middles of its pixels, (h * w, 2), in pixels of the picture."""
        height, width = self.values.shape
        x = self.corner_px[0] + self.pitch_px * np.arange(width)
        y = self.corner_px[1] + self.pitch_px * np.arange(height)
        return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)

    def binned(self, factor: int) -> Window:
        """The same with blocks of ``factor`` pixels each way averaged."""
        height, width = (n // factor * factor for n in self.values.shape)
        blocks = self.values[:height, :width].reshape(
            height // factor, factor, width // factor, factor
        )
        shift = (factor - 1) / 2.0 * self.pitch_px
        corner = self.corner_px[0] + shift, self.corner_px[1] + shift
        return Window(blocks.mean(axis=(1, 3)), corner, self.pitch_px * factor)


@dataclass(frozen=True, eq=False)
class TemplateFit:
    """A fitted target.

    ``parameters`` (SIZE,) and their ``covariance`` from the residuals; ``noise`` the rms
    residual in grey levels, ``patch`` the largest mean residual of 3 x 3 pixels; ``used`` how
    many pixels took part.
    """

    parameters: Floats
    covariance: Floats
    noise: float
    used: int
    converged: bool
    patch: float = 0.0

    @property
    def centre_px(self) -> Floats:
        """Where the target's origin appears, (2,)."""
        return np.asarray(self.parameters[localmap.CENTRE])

    @property
    def blur_px(self) -> float:
        """Sigma of the lens's blur."""
        return float(self.parameters[BLUR])

    @property
    def step(self) -> float:
        """Grey level of white less that of black."""
        return float(self.parameters[STEP])


@dataclass(frozen=True, eq=False)
class Expected:
    """Share of white (h, w), its derivatives along x and y (1/px) and by the blur."""

    white: Floats
    along_x: Floats
    along_y: Floats
    by_blur: Floats


def fit_template(
    pattern: Pattern,
    window: Window,
    start: Floats,
    image_px: tuple[int, int],
    held_map: bool = False,
) -> TemplateFit | None:
    """Fit ``pattern`` to a window from the map ``start``; None when the fit runs away.

    ``image_px`` is the size of the whole picture, from which a likely focal length follows.
    ``held_map``: all of the map but its centre is known, as from the targets round about.
    """
    prior_mean, prior_sigma = _held(start) if held_map else _prior(image_px)
    state = np.concatenate([start, [0.8 * window.pitch_px, 0.0, 1.0, 0.0, 0.0, 0.0]])
    values, pixels = window.values.ravel(), window.pixels
    fit = None
    for step in range(_STEPS):
        weight = _weight(pattern, state, pixels)
        used = int(weight.sum())
        if used < SIZE + 8 or not _sound(state):
            return None
        expected = synthesise(pattern, state, window)
        if step == 0:
            state = _with_levels(state, expected.white.ravel(), values, weight)
        partials, grey = _partials(state, expected, pixels)
        residual = values - grey
        normal, right, noise = _equations(
            partials, residual, weight, state, prior_mean, prior_sigma
        )
        inverse = _inverse(normal)
        if inverse is None:
            return None
        move = inverse @ right
        largest = float(np.abs(move[:2]).max())
        fit = TemplateFit(state, inverse * noise**2, noise, used, largest < 0.01)
        state = state + move / max(largest / max(0.7 * state[BLUR], 0.5 * window.pitch_px), 1.0)
        state[BLUR] = np.clip(state[BLUR], _SMALLEST_BLUR, _LARGEST_BLUR * window.pitch_px)
        if largest < _ENOUGH_PX:
            break
    if fit is None:
        return None
    return replace(fit, patch=_largest_patch(residual, weight, window.values.shape))


def _largest_patch(residual: Floats, weight: Bools, shape: tuple[int, ...]) -> float:
    """The largest mean residual of 3 x 3 pixels of a window that all take part; 0 without one."""
    kept, counted = (
        sliding_window_view(v.reshape(shape), (3, 3)).sum(axis=(2, 3))
        for v in (np.where(weight, residual, 0.0), weight.astype(np.int64))
    )
    return float(np.abs(kept[counted == 9]).max(initial=0.0)) / 9.0


def _prior(image_px: tuple[int, int]) -> tuple[Floats, Floats]:
    sigma = np.full(SIZE, np.inf)
    sigma[localmap.TILT] = localmap.tilt_sigma(image_px)
    sigma[localmap.BEND] = localmap.BEND_SIGMA
    sigma[SPREAD] = _SPREAD_SIGMA_PX
    return np.zeros(SIZE), sigma


def _held(start: Floats) -> tuple[Floats, Floats]:
    """A map known from neighbours some radii away, whose middles are out by 0.05 px at first."""
    mean, sigma = np.zeros(SIZE), np.full(SIZE, np.inf)
    mean[: localmap.SIZE] = start
    sigma[localmap.MATRIX] = _HELD_MATRIX * float(np.abs(start[localmap.MATRIX]).max())
    sigma[localmap.TILT] = _HELD_TILT
    sigma[localmap.BEND] = 0.2 * localmap.BEND_SIGMA
    sigma[SPREAD] = _SPREAD_SIGMA_PX
    return mean, sigma


def _sound(state: Floats) -> bool:
    matrix = state[localmap.MATRIX].reshape(2, 2)
    return bool(np.isfinite(state).all()) and abs(float(np.linalg.det(matrix))) > 1e-9


def _weight(pattern: Pattern, state: Floats, pixels: Floats) -> Bools:
    """Which pixels lie on the target's paper and show nothing of its edge, where there is room."""
    left, _, right, _ = pattern.extent_mm
    place = localmap.places(state, pixels)
    pixel_mm = float(np.linalg.norm(state[localmap.MATRIX].reshape(2, 2), axis=1).max())
    guard = min(pixel_mm * (0.7 + 2.5 * float(state[BLUR])), 0.08 * (right - left))
    return np.asarray(pattern.within_mm(place[:, 0], place[:, 1]) > guard)


def synthesise(pattern: Pattern, state: Floats, window: Window) -> Expected:
    """The expected picture of a pattern in a window."""
    height, width = window.values.shape
    pitch, blur = window.pitch_px, float(state[BLUR]) / window.pitch_px
    samples = SAMPLES
    reach = int(np.ceil(4.0 * blur)) + 1
    share = _sampled(pattern, state, window, reach, samples)
    across, down = (_kernels(n, reach, samples, round(blur, 6)) for n in (width, height))
    rows, rows_by = share @ across[0].T, share @ across[1].T
    white, along_x = down[0] @ rows, down[0] @ rows_by / pitch
    along_y = down[1] @ rows / pitch
    by_blur = (down[2] @ rows + down[0] @ (share @ across[2].T)) / pitch
    return Expected(white, along_x, along_y, by_blur)


def _sampled(pattern: Pattern, state: Floats, window: Window, reach: int, samples: int) -> Floats:
    """Share of white on the fine grid; pixels of one colour are asked once."""
    height, width = (n + 2 * reach for n in window.values.shape)
    pitch = window.pitch_px
    x = window.corner_px[0] + pitch * (np.arange(width) - reach)
    y = window.corner_px[1] + pitch * (np.arange(height) - reach)
    middles = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    size = np.linalg.norm(state[localmap.MATRIX].reshape(2, 2), axis=1) * pitch
    place = localmap.places(state, middles)
    fine_box = float(size[0]) / samples, float(size[1]) / samples
    coarse_box = float(size[0]), float(size[1])
    if 2.0 * max(coarse_box) < pattern.finest_mm:
        coarse = pattern.white_share(place[:, 0], place[:, 1], coarse_box)
        mixed = (coarse > 1e-9) & (coarse < 1.0 - 1e-9)
    else:
        coarse, mixed = np.zeros(len(place)), np.ones(len(place), dtype=bool)
    steps = ((np.arange(samples) + 0.5) / samples - 0.5) * pitch
    offsets = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    inner = (middles[mixed][:, None] + offsets[None]).reshape(-1, 2)
    at = localmap.places(state, inner)
    blocks = np.repeat(coarse[:, None], samples**2, axis=1)
    blocks[mixed] = pattern.white_share(at[:, 0], at[:, 1], fine_box).reshape(-1, samples**2)
    grid = blocks.reshape(height, width, samples, samples).transpose(0, 2, 1, 3)
    return grid.reshape(height * samples, width * samples)


@lru_cache(maxsize=256)
def _kernels(pixels: int, reach: int, samples: int, blur: float) -> tuple[Floats, Floats, Floats]:
    """Weights of samples in pixels, and their derivatives by place and by blur.

    Each (pixels, samples); lengths in pixels of the window. The samples' own box is part of
    the blur already, and is taken off.
    """
    place = (np.arange((pixels + 2 * reach) * samples) + 0.5) / samples - 0.5 - reach
    away = place[None, :] - np.arange(pixels)[:, None]
    sigma = np.sqrt(max(blur**2 - (SOFTNESS / samples) ** 2, 0.01))
    upper, lower = (away + 0.5) / sigma, (away - 0.5) / sigma
    weight = ndtr(upper) - ndtr(lower)
    density = [np.exp(-0.5 * z * z) / np.sqrt(2.0 * np.pi) for z in (upper, lower)]
    by_place = (density[1] - density[0]) / sigma
    by_sigma = (lower * density[1] - upper * density[0]) / sigma
    total = weight.sum(axis=1, keepdims=True)
    return weight / total, by_place / total, by_sigma * (blur / sigma) / total


def _with_levels(state: Floats, white: Floats, values: Floats, weight: Bools) -> Floats:
    design = np.column_stack([np.ones(int(weight.sum())), white[weight]])
    state = state.copy()
    state[[BLACK, STEP]] = np.linalg.lstsq(design, values[weight], rcond=None)[0]
    return state


def _partials(state: Floats, expected: Expected, pixels: Floats) -> tuple[Floats, Floats]:
    """Partials (n, SIZE) of the grey levels, and the grey levels (n,)."""
    step = state[STEP]
    gradient = np.stack([expected.along_x.ravel(), expected.along_y.ravel()], axis=1)
    edge = np.linalg.norm(gradient, axis=1)
    mapped = localmap.to_target(state[: localmap.SIZE], pixels)
    by_place = np.linalg.solve(np.swapaxes(mapped.by_pixel, 1, 2), gradient[..., None])[..., 0]
    away = pixels - state[localmap.CENTRE]
    partials = np.empty((len(pixels), SIZE))
    partials[:, : localmap.SIZE] = step * np.einsum("ni,nij->nj", by_place, mapped.by_parameter)
    partials[:, BLUR] = step * expected.by_blur.ravel()
    partials[:, BLACK] = 1.0
    partials[:, STEP] = expected.white.ravel() + state[SPREAD] * edge
    partials[:, SLOPE] = away
    partials[:, SPREAD] = step * edge
    grey = state[BLACK] + step * partials[:, STEP] + away @ state[SLOPE]
    return partials, grey


def _equations(
    partials: Floats,
    residual: Floats,
    weight: Bools,
    state: Floats,
    prior_mean: Floats,
    prior_sigma: Floats,
) -> tuple[Floats, Floats, float]:
    rows, rest = partials[weight], residual[weight]
    normal, right = rows.T @ rows, rows.T @ rest
    noise = float(np.sqrt((rest**2).sum() / max(len(rest) - SIZE, 1)))
    certainty = max(noise, 0.05) ** 2 / prior_sigma**2
    normal[np.diag_indices(SIZE)] += certainty
    return normal, right + certainty * (prior_mean - state), noise


def _inverse(normal: Floats) -> Floats | None:
    # The parameters differ by ten powers of ten in size: scaled, the matrix is well behaved.
    scale = 1.0 / np.sqrt(np.maximum(np.diag(normal), 1e-30))
    try:
        inverse = np.linalg.inv(normal * np.outer(scale, scale))
    except np.linalg.LinAlgError:
        return None
    return np.asarray(inverse * np.outer(scale, scale)) if np.isfinite(inverse).all() else None
