"""Two cameras with equidistant lenses before a plate, as observations."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from calibration.observations import Observations
from calibration.targets.kinds import CharucoPlate, TargetPlan
from geometry.arrays import Floats


def fisheye(places: Floats, half_deg: float) -> Floats:
    """Pixels (n, 2) of places (n, 3) before an equidistant lens, its half angle in the corner."""
    sideways, angle = np.hypot(places[:, 0], places[:, 1]), np.radians(half_deg)
    radius = 500.0 / angle * np.arctan2(sideways, places[:, 2])
    share = radius / np.maximum(sideways, 1e-12)
    return np.asarray(places[:, :2] * share[:, None] + [399.5, 299.5])


def seen_by_two(half_deg: float) -> Observations:
    """A plate before two cameras 120 mm apart, in eight places that fill their pictures."""
    plate = CharucoPlate("plate", 8, 6, 30.0, 22.0, "DICT_5X5_100", sigma_mm=(0.0, 0.0, 0.0))
    places = plate.carrier().nominal_mm
    random = np.random.default_rng(5)
    rows: list[tuple[int, int, int]] = []
    pixels: list[Floats] = []
    for frame in range(8):
        turn = Rotation.from_euler("xyz", random.uniform(-35.0, 35.0, 3), degrees=True)
        shift = random.uniform([-60.0, -45.0, 110.0], [60.0, 45.0, 190.0])
        for camera, x in enumerate((-60.0, 60.0)):
            before = turn.apply(places - places.mean(axis=0)) + shift - [x, 0.0, 0.0]
            image = fisheye(before, half_deg)
            inside = (image > 10.0).all(axis=1) & (image < [790.0, 590.0]).all(axis=1)
            rows += [(camera, frame, k) for k in np.flatnonzero(inside).tolist()]
            pixels.append(image[inside])
    pixel = np.concatenate(pixels)
    sigma = np.full_like(pixel, 0.05)
    camera, frame, target = np.array(rows).T
    return Observations(
        TargetPlan("set", (plate,)).target_set(),
        ("left", "right"),
        np.array([[800, 600]] * 2),
        tuple(map(str, range(8))),
        camera,
        frame,
        target,
        pixel + random.normal(0.0, 0.05, pixel.shape),
        sigma,
    )
