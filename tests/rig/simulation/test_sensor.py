"""Noise, exposure, full wells and coding of the simulated sensor, on an even grey field."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from simulated_rigs import lens, placed

from rig.acquisition.cameras.base import Image
from rig.simulation.raytable import ray_table
from rig.simulation.sensor import developed
from rig.simulation.settings import BackdropSettings, SceneSettings, SensorSettings
from rig.simulation.studio import Shot, Studio

GREY = 0.2
SENSOR = SensorSettings(vignetting=0.0)
SHOT = Shot("cam01", 4000.0, pixel_format="Mono16")


def even_field(radiance: float = GREY, sensor: SensorSettings = SENSOR) -> Studio:
    even = (radiance,) * 3
    scene = SceneSettings(with_head=False, backdrop=BackdropSettings(centre=even, edge=even))
    return Studio([placed(lens(400))], scene, sensor)


def electrons(picture: Image, sensor: SensorSettings = SENSOR) -> np.ndarray:
    return picture.astype(np.float64) / 65535.0 * sensor.full_well_e


@pytest.mark.parametrize("exposure_us", [200.0, 1000.0, 4000.0, 16000.0])
def test_shot_noise_follows_the_signal_and_read_noise_stays(exposure_us: float) -> None:
    found = electrons(even_field().photograph(replace(SHOT, exposure_us=exposure_us)))
    mean = GREY * SENSOR.full_well_e * exposure_us / 4000.0
    variance = mean + SENSOR.read_noise_e**2
    # 120,000 pixels: the mean is known to sigma / 346, the variance to sqrt(2 / N) = 0.41 %.
    assert abs(found.mean() - mean) < 5.0 * np.sqrt(variance) / np.sqrt(found.size)
    assert abs(found.var() / variance - 1.0) < 5.0 * np.sqrt(2.0 / found.size)


def test_light_is_proportional_to_exposure_gain_and_the_square_of_the_aperture() -> None:
    studio = even_field(0.05)
    base = electrons(studio.photograph(SHOT)).mean()
    for changed, factor in (
        (replace(SHOT, exposure_us=12000.0), 3.0),
        (replace(SHOT, gain_db=12.0), 10.0 ** (12.0 / 20.0)),
        (replace(SHOT, f_number=8.0), 4.0),
    ):
        got = electrons(studio.photograph(changed)).mean()
        # Standard error of a mean of 500 electrons over 120,000 pixels is 0.07, a ten-thousandth.
        assert got / base == pytest.approx(factor, rel=1e-3)


def test_overexposed_pixels_are_full_and_no_more() -> None:
    picture = even_field(5.0).photograph(replace(SHOT, pixel_format="RGB8"))
    assert picture.min() == 255


def test_black_has_read_noise_only() -> None:
    found = electrons(even_field().photograph(replace(SHOT, black=True)))
    assert found.max() < 6.0 * SENSOR.read_noise_e
    # Half of a normal distribution is cut at 0: mean sigma / sqrt(2 pi).
    assert found.mean() == pytest.approx(SENSOR.read_noise_e / np.sqrt(2.0 * np.pi), rel=0.05)


def test_eight_bits_follow_the_srgb_curve() -> None:
    quiet = SensorSettings(full_well_e=1e7, read_noise_e=0.0, vignetting=0.0)
    picture = even_field(GREY, quiet).photograph(replace(SHOT, pixel_format="Mono8"))
    code = 255.0 * (1.055 * GREY ** (1.0 / 2.4) - 0.055)
    assert np.abs(picture - code).max() <= 1.0
    assert picture.mean() == pytest.approx(code, abs=0.5)


def test_light_falls_off_as_the_fourth_power_of_the_cosine() -> None:
    camera = lens(400, 60.0)
    table = ray_table(camera)
    sensor = SensorSettings(full_well_e=1e7, read_noise_e=0.0)
    light = np.full((300, 400, 1), 0.5, dtype=np.float32)
    picture = developed(
        light, table, sensor, exposure=1.0, gain=1.0, deep=True, rng=np.random.default_rng(0)
    )
    corner_cosine = camera.rays(np.array([[0.0, 0.0]]))[0, 2]
    fall = picture[0, 0] / picture[149:151, 199:201].mean()
    assert fall == pytest.approx(corner_cosine**4, rel=5e-3)
    assert fall < 0.75


def test_pictures_repeat_to_the_bit_for_a_seed_and_differ_for_another() -> None:
    first = even_field().photograph(replace(SHOT, seed=(1, 2)))
    again = even_field().photograph(replace(SHOT, seed=(1, 2)))
    other = even_field().photograph(replace(SHOT, seed=(1, 3)))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    assert abs(np.corrcoef(first.ravel(), other.ravel())[0, 1]) < 0.02


@pytest.mark.parametrize(
    ("pixel_format", "shape", "dtype"),
    [
        ("Mono8", (300, 400), np.uint8),
        ("Mono16", (300, 400), np.uint16),
        ("RGB8", (300, 400, 3), np.uint8),
        ("RGB16", (300, 400, 3), np.uint16),
    ],
)
def test_pixel_formats(pixel_format: str, shape: tuple[int, ...], dtype: type) -> None:
    picture = even_field().photograph(replace(SHOT, pixel_format=pixel_format))
    assert (picture.shape, picture.dtype) == (shape, dtype)
