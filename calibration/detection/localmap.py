"""How a small flat target maps to the picture: affine, perspective, and a bend of the lens.

A pixel p lies at (u, v) of the target::

    q = p - centre,   q' = q - |q|^2 bend,   (u, v) = A q' / (1 + tilt . q')

``centre`` is exactly where the target's origin appears: the eccentricity of an ellipse's middle
under perspective, and its like under lens distortion, are part of the map and need no
correction afterwards. ``bend`` is the part of a radial distortion's second order that no
perspective can imitate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats

SIZE = 10
"""Parameters: centre x, y; A row by row; tilt x, y; bend x, y."""

CENTRE, MATRIX, TILT, BEND = slice(0, 2), slice(2, 6), slice(6, 8), slice(8, 10)

BEND_SIGMA = 1e-4
"""Prior sigma of the bend, 1/px: k1 r / f of a lens with k1 = -0.2, half-way out, f = 1000 px."""


def tilt_sigma(image_px: tuple[int, int]) -> float:
    """Prior sigma of the tilt, 1/px: a target at 60 degrees, a field of view of 60 degrees."""
    return 2.0 / max(image_px)


@dataclass(frozen=True, eq=False)
class Mapped:
    """Pixels in target units.

    ``place`` (n, 2), its partials by the parameters (n, 2, SIZE) and by the pixel (n, 2, 2).
    """

    place: Floats
    by_parameter: Floats
    by_pixel: Floats


def places(parameters: Floats, pixels: Floats) -> Floats:
    """Places on the target (n, 2) of pixels (n, 2), without partials."""
    q = pixels - parameters[CENTRE]
    straight = q - np.einsum("ni,ni->n", q, q)[:, None] * parameters[BEND]
    affine = straight @ parameters[MATRIX].reshape(2, 2).T
    return np.asarray(affine / (1.0 + straight @ parameters[TILT])[:, None])


def to_target(parameters: Floats, pixels: Floats) -> Mapped:
    """Places on the target of pixels (n, 2)."""
    matrix = parameters[MATRIX].reshape(2, 2)
    tilt, bend = parameters[TILT], parameters[BEND]
    q = pixels - parameters[CENTRE]
    square = np.einsum("ni,ni->n", q, q)
    straight = q - square[:, None] * bend
    divisor = 1.0 + straight @ tilt
    affine = straight @ matrix.T
    place = affine / divisor[:, None]
    by_straight = (matrix[None] - place[:, :, None] * tilt[None, None]) / divisor[:, None, None]
    unbend = np.eye(2) - 2.0 * bend[None, :, None] * q[:, None, :]
    by_pixel = by_straight @ unbend
    partials = np.zeros((len(q), 2, SIZE))
    partials[:, :, CENTRE] = -by_pixel
    scaled = straight / divisor[:, None]
    partials[:, 0, 2:4] = scaled
    partials[:, 1, 4:6] = scaled
    partials[:, :, TILT] = -place[:, :, None] * scaled[:, None, :]
    partials[:, :, BEND] = -by_straight * square[:, None, None]
    return Mapped(place, partials, by_pixel)


def to_picture(parameters: Floats, places: Floats) -> Floats:
    """Pixels (n, 2) of places on the target, by a few Newton steps."""
    matrix = parameters[MATRIX].reshape(2, 2)
    pixels = parameters[CENTRE] + places @ np.linalg.inv(matrix).T
    for _ in range(6):
        mapped = to_target(parameters, pixels)
        miss = places - mapped.place
        pixels = pixels + np.linalg.solve(mapped.by_pixel, miss[..., None])[..., 0]
    return np.asarray(pixels)


def affine_start(centre_px: Floats, axes_px: Floats) -> Floats:
    """Parameters without tilt and bend; ``axes_px`` (2, 2) columns are one u and one v."""
    parameters = np.zeros(SIZE)
    parameters[CENTRE] = centre_px
    parameters[MATRIX] = np.linalg.inv(axes_px).ravel()
    return parameters


def perspective_start(homography: Floats) -> Floats:
    """Parameters of a homography (3, 3) from target places to pixels, about its origin."""
    centre = homography[:2, 2] / homography[2, 2]
    inverse = np.linalg.inv(homography)
    shift = np.array([[1.0, 0.0, centre[0]], [0.0, 1.0, centre[1]], [0.0, 0.0, 1.0]])
    local = inverse @ shift
    local /= local[2, 2]
    parameters = np.zeros(SIZE)
    parameters[CENTRE] = centre
    parameters[MATRIX] = local[:2, :2].ravel()
    parameters[TILT] = local[2, :2]
    return parameters
