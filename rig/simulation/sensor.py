"""From light to numbers: vignetting, exposure, shot and read noise, full wells, coding."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rig.acquisition.cameras.base import Image
from rig.simulation.sampling import srgb_of_linear
from rig.simulation.settings import SensorSettings

Singles = NDArray[np.float32]

_CODE_STEPS = 4096
"""Codes of the analogue-digital converter of an 8-bit picture (12 bits)."""

_TILE_VALUES = 262_144


def developed(
    light: Singles,
    table: Singles,
    settings: SensorSettings,
    *,
    exposure: float,
    gain: float,
    deep: bool,
    rng: np.random.Generator,
) -> Image:
    """The picture (H, W) or (H, W, 3) that the sensor makes of light (H, W, C).

    ``exposure`` is relative to the reference, ``gain`` a factor; ``deep`` pictures have 16 bits
    and are linear, others 8 bits on the sRGB curve. Shot noise is Gaussian with the variance of
    the mean signal, which is what counting photons comes to above some ten electrons.
    """
    height, width, channels = light.shape
    steps = 65536 if deep else _CODE_STEPS
    codes = np.arange(steps) / (steps - 1)
    coded = np.round(codes * 65535 if deep else srgb_of_linear(codes) * 255)
    curve = coded.astype(np.uint16 if deep else np.uint8)
    out = np.empty(light.shape, dtype=curve.dtype)
    rows = max(1, _TILE_VALUES // (width * channels))
    well, read = np.float32(settings.full_well_e), np.float32(settings.read_noise_e)
    for top in range(0, height, rows):
        part = slice(top, min(top + rows, height))
        electrons = light[part] * _falloff(table[part], settings.vignetting)[..., None]
        electrons *= well * np.float32(exposure)
        noise = rng.standard_normal(electrons.shape, dtype=np.float32)
        noise *= np.sqrt(electrons + read * read)
        electrons += noise
        np.clip(electrons, 0.0, well, out=electrons)
        electrons *= np.float32(gain * (steps - 1)) / well
        np.minimum(electrons, np.float32(steps - 1), out=electrons)
        out[part] = curve[np.rint(electrons).astype(np.uint16)]
    return out[..., 0] if channels == 1 else out


def _falloff(rays: Singles, strength: float) -> Singles:
    """Share of the light that reaches each pixel: cos^4 of its angle to the axis."""
    square = np.float32(1.0) + rays[..., 0] ** 2 + rays[..., 1] ** 2
    power = square**2 if strength == 1.0 else square ** np.float32(2.0 * strength)
    return np.asarray(np.float32(1.0) / power, dtype=np.float32)
