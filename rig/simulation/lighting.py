"""Light on the head: soft boxes, their soft shadows, and light from everywhere.

How much of each light reaches each vertex is found once by ray casting, for the head at rest;
the light's angle is taken anew for each picture. Both change slowly over the surface, so they
are worked out at the vertices and interpolated. A head that turns by some degrees keeps the
shadows it had; its shading follows.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Floats
from geometry.raycast import Occluder
from rig.simulation.motion import HeadPlacement
from rig.simulation.settings import LightSettings

Singles = NDArray[np.float32]

_LIGHT_RAYS = 16
_SKY_RAYS = 48
_LIFT_MM = 0.3
_WRAP = np.array([0.25, 0.13, 0.09])
"""How far light creeps round into the shade, red, green and blue: skin is no plaster."""

_GLOSS = 14.0


def openness(
    occluder: Occluder, normals: Floats, lights: tuple[LightSettings, ...], seed: int = 0
) -> Singles:
    """Share of each light and, last, of the surroundings that each vertex sees, (V, L + 1)."""
    rng = np.random.default_rng(seed)
    start = occluder.vertices_mm + _LIFT_MM * normals
    seen = np.ones((len(start), len(lights) + 1), dtype=np.float32)
    for number, light in enumerate(lights):
        free = np.zeros(len(start))
        for spot in _spots(light, rng):
            free += ~occluder.hidden(occluder.vertices_mm, normals, spot)
        seen[:, number] = free / _LIGHT_RAYS
    sky = np.zeros(len(start))
    for _ in range(_SKY_RAYS):
        # A direction of the unit sphere added to the normal is distributed as the cosine.
        way = rng.normal(size=start.shape)
        way = way / np.linalg.norm(way, axis=1, keepdims=True) + normals
        way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
        triangle, distance = occluder.first_hits(start, way)
        sky += (triangle < 0) | (distance > 250.0)
    seen[:, -1] = sky / _SKY_RAYS
    return seen


def _spots(light: LightSettings, rng: np.random.Generator) -> Floats:
    """Places spread over the disk of a soft box that faces the origin, (N, 3)."""
    middle = np.array(light.position_rig_mm)
    ahead = -middle / np.linalg.norm(middle)
    side = np.cross(ahead, np.eye(3)[np.abs(ahead).argmin()])
    side /= np.linalg.norm(side)
    over = np.cross(ahead, side)
    turn = np.pi * (1.0 + np.sqrt(5.0)) * np.arange(_LIGHT_RAYS) + rng.uniform(0.0, 2.0 * np.pi)
    radius = 0.5 * light.size_mm * np.sqrt((np.arange(_LIGHT_RAYS) + 0.5) / _LIGHT_RAYS)
    return np.asarray(
        middle + np.outer(radius * np.cos(turn), side) + np.outer(radius * np.sin(turn), over)
    )


def vertex_light(
    vertices_mm: Floats,
    normals: Floats,
    seen: Singles,
    lights: tuple[LightSettings, ...],
    ambient: float,
    sheen: float,
    placement: HeadPlacement,
    eye_rig_mm: Floats,
) -> Singles:
    """Light on each vertex, (V, 4): red, green, blue for a white surface, and gloss.

    ``seen`` (V, L + 1) as :func:`openness` gives it. The gloss is what ``eye_rig_mm`` (3,) sees
    and is added to what the skin's colour returns.
    """
    turned = (normals @ placement.rotation.T).astype(np.float32)
    sight = eye_rig_mm - placement.to_rig(vertices_mm)
    sight /= np.linalg.norm(sight, axis=1, keepdims=True)
    out = np.empty((len(vertices_mm), 4), dtype=np.float32)
    out[:, :3] = ambient * seen[:, -1:]
    out[:, 3] = 0.0
    for number, light in enumerate(lights):
        way = np.array(light.position_rig_mm)
        way = way / np.linalg.norm(way)
        cosine = turned @ way.astype(np.float32)
        reach = light.power * seen[:, number]
        for channel in range(3):
            wrapped = np.maximum(cosine + _WRAP[channel], 0.0) / (1.0 + _WRAP[channel])
            out[:, channel] += light.colour[channel] * reach * wrapped
        half = (sight + way).astype(np.float32)
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        gloss = np.maximum((turned * half).sum(axis=1), 0.0) ** _GLOSS
        out[:, 3] += sheen * reach * gloss * np.clip(8.0 * cosine, 0.0, 1.0)
    return out


def card_light(normal_rig: Floats, lights: tuple[LightSettings, ...], ambient: float) -> Singles:
    """Light on a flat white card that faces ``normal_rig``, (3,)."""
    out = np.full(3, ambient)
    for light in lights:
        way = np.array(light.position_rig_mm)
        cosine = float(normal_rig @ way / np.linalg.norm(way))
        out += light.power * np.array(light.colour) * max(cosine, 0.0)
    return out.astype(np.float32)
