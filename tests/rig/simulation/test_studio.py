"""Whole photographs of the synthetic head: where it is, how it moves, what repeats."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from simulated_rigs import STRONG, lens, placed, three

from common.errors import InputError, NotFoundError
from rig.simulation.motion import placement_at
from rig.simulation.settings import (
    HeadSettings,
    LightSettings,
    MotionSettings,
    SceneSettings,
    SensorSettings,
    SimulationSettings,
)
from rig.simulation.studio import Shot, Studio

SHOT = Shot("cam02", 4000.0, pixel_format="RGB8", seed=(1,))
HEAD = HeadSettings(subdivisions=0)
MOVING = MotionSettings((120.0, 0.0, -80.0))


@pytest.fixture(scope="module")
def studio() -> Studio:
    return Studio(three(lens(480, 30.0, STRONG)), SceneSettings(head=HEAD, motion=MOVING))


@pytest.mark.slow
def test_the_outline_is_where_the_surface_projects(studio: Studio) -> None:
    rig_camera = studio.cameras["cam02"]
    surface = studio.surface
    assert surface is not None
    pixels, _ = rig_camera.camera.project(rig_camera.pose, surface.vertices_mm)
    dark = studio.light(replace(SHOT, camera="cam02", pixel_format="Mono16"))[..., 0]
    empty = Studio(tuple(studio.cameras.values()), SceneSettings(with_head=False)).light(
        replace(SHOT, camera="cam02", pixel_format="Mono16")
    )[..., 0]
    rows, columns = np.nonzero(np.abs(dark - empty) > 0.02)
    found = np.array([columns.min(), columns.max(), rows.min()])
    wanted = np.array([pixels[:, 0].min(), pixels[:, 0].max(), pixels[:, 1].min()])
    # Blur of the lens and of focus reach about two pixels.
    assert np.abs(found - wanted).max() < 3.0


@pytest.mark.slow
def test_a_moving_head_is_displaced_by_velocity_times_time(studio: Studio) -> None:
    """What skew looks like: two exposures 25 ms apart show the head 3 mm to the side."""
    quiet = Studio(tuple(studio.cameras.values()), studio.scene, SensorSettings(1e6, 0.5))
    later = 0.025
    shots = [replace(SHOT, start_s=t - 2e-3, pixel_format="Mono16") for t in (0.0, later)]
    first, second = (quiet.photograph(shot).astype(np.float64) for shot in shots)
    rig_camera = quiet.cameras["cam02"]
    forehead = np.array([[10.0, -95.0, 10.0]])
    moved = placement_at(MOVING, later).to_rig(forehead)
    (start,), (end,) = (rig_camera.camera.project(rig_camera.pose, p)[0] for p in (forehead, moved))
    wanted = end - start
    assert np.linalg.norm(wanted) > 2.0
    # A window of 60 px of skin; grain and freckles register to a few hundredths of a pixel.
    x, y = np.round(start).astype(int)
    found = shift_of(first[y - 30 : y + 30, x - 30 : x + 30], second, x - 30, y - 30, wanted)
    assert np.abs(found - wanted).max() < 0.08


def shift_of(
    patch: np.ndarray, picture: np.ndarray, left: int, top: int, guess: np.ndarray
) -> np.ndarray:
    """Shift (2,) in pixels by least squares: gain, offset and place of the patch."""
    from scipy.ndimage import map_coordinates

    rows, columns = np.mgrid[: patch.shape[0], : patch.shape[1]]
    shift = guess.copy()
    for _ in range(20):
        place = [rows + top + shift[1], columns + left + shift[0]]
        there = map_coordinates(picture, place, order=3)
        slope_y, slope_x = np.gradient(there)
        design = np.stack([slope_x, slope_y, there, np.ones_like(there)], axis=-1).reshape(-1, 4)
        step = np.linalg.lstsq(design, (patch - there).ravel(), rcond=None)[0]
        shift = shift + step[:2]
    return np.asarray(shift)


@pytest.mark.slow
def test_motion_within_the_exposure_blurs(studio: Studio) -> None:
    long = replace(SHOT, exposure_us=40_000.0, start_s=-0.02, pixel_format="Mono16")
    fast = replace(studio.scene, motion=replace(MOVING, samples=8))
    frozen = studio.light(long)[..., 0]
    blurred = Studio(tuple(studio.cameras.values()), fast).light(long)[..., 0]
    face = (slice(120, 220), slice(190, 290))
    # 4.8 mm sideways are 9 px; freckles and grain are much finer and vanish across that.
    fine = np.abs(np.diff(frozen[face], axis=1)).mean()
    assert np.abs(np.diff(blurred[face], axis=1)).mean() < 0.75 * fine


def test_light_from_the_left_lights_the_left() -> None:
    cameras = [placed(lens(160))]
    sides = []
    for x in (-1000.0, 1000.0):
        light = LightSettings((x, -300.0, 200.0), 1.0)
        scene = SceneSettings(head=HEAD, lights=(light,), ambient=0.0)
        picture = Studio(cameras, scene).light(replace(SHOT, camera="cam01"))[..., 1]
        sides.append(picture[40:80, 55:75].mean() / picture[40:80, 85:105].mean())
    assert sides[0] > 2.0
    assert sides[1] < 0.5


def test_the_same_shot_gives_the_same_bits_in_another_studio(studio: Studio) -> None:
    again = Studio(tuple(studio.cameras.values()), studio.scene, studio.sensor)
    assert np.array_equal(studio.photograph(SHOT), again.photograph(SHOT))
    other = studio.photograph(replace(SHOT, seed=(2,)))
    assert not np.array_equal(studio.photograph(SHOT), other)


def test_all_cameras_see_the_same_grain(studio: Studio) -> None:
    """A patch of forehead in two views, brought to one another through the surface."""
    from scipy.ndimage import map_coordinates

    surface = studio.surface
    assert surface is not None
    still = Studio(
        three(lens(1200, 12.0)),
        SceneSettings(head=replace(HEAD, sheen=0.0)),
        SensorSettings(1e6, 0.5, depth_of_field=False),
    )
    x, z = np.meshgrid(np.linspace(-8.0, 8.0, 60), np.linspace(44.0, 52.0, 40))
    start = np.stack([x.ravel(), np.full(x.size, -300.0), z.ravel()], axis=1)
    triangle, distance = occluder(still).first_hits(
        start, np.tile([0.0, 1.0, 0.0], (len(start), 1))
    )
    assert (triangle >= 0).all()
    places = start + distance[:, None] * [0.0, 1.0, 0.0]
    views = []
    for name in ("cam01", "cam02"):
        rig_camera = still.cameras[name]
        light = still.light(Shot(name, 4000.0, pixel_format="Mono16"))[..., 0]
        pixels, _ = rig_camera.camera.project(rig_camera.pose, places)
        seen = map_coordinates(light, pixels.T[::-1], order=1).reshape(x.shape)
        views.append(seen / smooth(seen))
    assert np.corrcoef(views[0].ravel(), views[1].ravel())[0, 1] > 0.97


def occluder(studio: Studio):  # noqa: ANN201
    from geometry.raycast import Occluder

    surface = studio.surface
    assert surface is not None
    return Occluder(surface.vertices_mm, surface.faces)


def smooth(values: np.ndarray) -> np.ndarray:
    from scipy.ndimage import gaussian_filter

    return np.asarray(gaussian_filter(values, 6.0))


def test_a_camera_that_is_not_there_is_named(studio: Studio) -> None:
    with pytest.raises(NotFoundError, match="cam99"):
        studio.photograph(replace(SHOT, camera="cam99"))


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: SensorSettings(full_well_e=float("nan")), "full_well_e"),
        (lambda: HeadSettings(subdivisions=9), "subdivisions"),
        (lambda: MotionSettings(samples=0), "motion_samples"),
        (lambda: LightSettings((0.0, 0.0, 0.0), 1.0), "light_distance_mm"),
        (lambda: SimulationSettings(pixel_format="RAW12"), "pixel_format"),
        (lambda: SimulationSettings(outputs={"cam01": 0}), "counted from 1"),
    ],
)
def test_impossible_settings_are_refused_in_one_line(make: Callable[[], object], word: str) -> None:
    with pytest.raises(InputError, match=word) as caught:
        make()
    assert "\n" not in str(caught.value)
    assert caught.value.code.startswith("input/simulation-")
