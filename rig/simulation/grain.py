"""Grain of the skin: noise that belongs to the places of the surface, so all cameras see the same.

Value noise: a random number at every node of a cubic lattice, smoothly interpolated. The
numbers come from hashing the node's indices, so there is no table and no period. Each lattice is
faded out where it is finer than a pixel on the surface: what a pixel averages over is no detail,
and sampling it at one place would give each camera another picture of it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SPACINGS_MM = (0.12, 0.35, 1.1)
"""Distances of the lattices' nodes."""

_CHUNK = 32_768
_PRIMES = np.array([0x8DA6B343, 0xD8163841, 0xCB1AB31F], dtype=np.uint32)
_MIX = np.uint32(0x7FEB352D)

_RMS = float(np.sqrt((26.0 / 35.0) ** 3 / 3.0))
"""Root mean square of the interpolated noise of uniform numbers from -1 to 1."""

Singles = NDArray[np.float32]


def grain(points_mm: Singles, footprint_mm: Singles, contrast: float, seed: int) -> Singles:
    """Factors (N,) about 1 for the albedo at ``points_mm`` (N, 3), rms ``contrast``.

    ``footprint_mm`` (N,): width of a pixel on the surface at each point.
    """
    out = np.ones(len(points_mm), dtype=np.float32)
    if contrast == 0.0:
        return out
    strength = np.float32(contrast / np.sqrt(len(SPACINGS_MM)) / _RMS)
    finest = float(footprint_mm.min(initial=np.inf))
    for number, spacing in enumerate(SPACINGS_MM):
        if _fade(np.array([finest], dtype=np.float32), spacing)[0] == 0.0:
            continue
        salt = np.uint32((seed * 3 + number) * 0x9E3779B1 & 0xFFFFFFFF)
        for low in range(0, len(points_mm), _CHUNK):
            part = slice(low, low + _CHUNK)
            weight = strength * _fade(footprint_mm[part], spacing)
            out[part] += weight * value_noise(points_mm[part] / np.float32(spacing), salt)
    return np.asarray(np.maximum(out, np.float32(0.05)))


def _fade(footprint_mm: Singles, spacing_mm: float) -> Singles:
    """1 where a pixel is narrower than two thirds of the spacing, 0 where wider than it twice."""
    ratio = np.float32(spacing_mm) / footprint_mm
    return np.asarray(np.clip(ratio - np.float32(0.5), 0.0, 1.0), dtype=np.float32)


def value_noise(places: Singles, salt: np.uint32) -> Singles:
    """Noise in (-1, 1), (N,), at ``places`` (N, 3) in units of the lattice's spacing."""
    base = np.floor(places)
    t = places - base
    t = t * t * (np.float32(3.0) - np.float32(2.0) * t)
    # Negative indices wrap round, which is as good a hash as any.
    node = base.astype(np.int32).view(np.uint32)
    x0, y0, z0 = ((node[:, k] + salt) * _PRIMES[k] for k in range(3))
    x1, y1, z1 = x0 + _PRIMES[0], y0 + _PRIMES[1], z0 + _PRIMES[2]
    tx, ty, tz = t[:, 0], t[:, 1], t[:, 2]
    planes = []
    for z in (z0, z1):
        rows = []
        for y in (y0, y1):
            yz = y ^ z
            left = _hashed(x0 ^ yz)
            rows.append(left + tx * (_hashed(x1 ^ yz) - left))
        planes.append(rows[0] + ty * (rows[1] - rows[0]))
    return np.asarray(planes[0] + tz * (planes[1] - planes[0]), dtype=np.float32)


def _hashed(key: NDArray[np.uint32]) -> Singles:
    """Numbers in [-1, 1) that look random, from keys."""
    key = key ^ (key >> np.uint32(15))
    key *= _MIX
    key ^= key >> np.uint32(14)
    key *= _MIX
    return (key.view(np.int32)).astype(np.float32) * np.float32(2.0**-31)
