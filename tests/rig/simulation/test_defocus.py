"""Depth-of-field blur against thin-lens optics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from simulated_rigs import lens, placed

from geometry.camera import RigCamera
from geometry.frames import Pose
from geometry.optics import blur_disk_mm
from rig.simulation.defocus import disk_kernel
from rig.simulation.flatsettings import BoardSettings, PlaceSettings, TargetSettings
from rig.simulation.settings import HeadSettings, SceneSettings, SensorSettings
from rig.simulation.studio import Shot, Studio

SHOT = Shot("cam01", 4000.0, pixel_format="Mono16")
SHARP = SensorSettings(depth_of_field=False)


@pytest.mark.parametrize("diameter", [0.5, 1.2, 1.79, 1.81, 2.5, 4.0, 7.3, 15.0])
def test_the_kernel_is_as_wide_as_the_disk(diameter: float) -> None:
    kernel = disk_kernel(diameter).astype(np.float64)
    place = np.arange(len(kernel)) - len(kernel) // 2
    assert kernel.sum() == pytest.approx(1.0, abs=1e-6)
    variance = (kernel.sum(axis=0) * place**2).sum()
    # The disk's own variance along an axis is d^2 / 16; 16 x 16 cells a pixel resolve 1 %.
    assert variance == pytest.approx(diameter**2 / 16.0, rel=0.02, abs=0.002)


def edge_width_px(picture: np.ndarray) -> float:
    """Standard deviation of the spread of the edge that each row crosses."""
    slope = np.abs(np.diff(picture.mean(axis=0)))
    slope = np.where(slope > 1e-4 * slope.max(), slope, 0.0)
    place = np.arange(len(slope))
    mean = (slope * place).sum() / slope.sum()
    return float(np.sqrt((slope * (place - mean) ** 2).sum() / slope.sum()))


@pytest.mark.parametrize(("f_number", "depth_mm"), [(2.0, 900.0), (4.0, 620.0), (2.8, 1100.0)])
def test_an_edge_is_as_soft_as_optics_says(f_number: float, depth_mm: float) -> None:
    focus = 750.0
    camera = placed(
        lens(800, f_number=f_number), (0.0, -depth_mm, 0.0), target_mm=(0, 0, 0), focus_mm=focus
    )
    size = 240.0
    marker = TargetSettings("aruco", PlaceSettings((0.5 * size, 0.0, 0.0)), size)
    scene = SceneSettings(with_head=False, targets=(marker,))
    # The outer border of the marker lies in the middle of the picture, upright.
    # Border and outermost cell are 30 mm and more, so that nothing else is near.
    box = (slice(290, 310), slice(370, 430))
    soft = Studio([camera], scene).light(SHOT)[..., 0][box]
    sharp = Studio([camera], scene, SHARP).light(SHOT)[..., 0][box]
    spread = np.sqrt(edge_width_px(soft) ** 2 - edge_width_px(sharp) ** 2)
    disk = blur_disk_mm(np.array([depth_mm]), focus, camera.camera.focal_length_mm, f_number)
    wanted = disk[0] / camera.camera.pixel_pitch_mm / 4.0
    assert wanted > 0.5
    assert spread == pytest.approx(wanted, rel=0.03)


def thin_lens(camera: RigCamera, scene: SceneSettings, rays: int) -> np.ndarray:
    """The picture of a real aperture: the mean of pinholes spread over it.

    A pinhole moved by a within the lens sees the plane of focus s where it was if its principal
    point moves by f a / s.
    """
    f, n, s = camera.camera.focal_length_mm, camera.camera.f_number, camera.focus_distance_mm
    diameter = f * s / (n * (s - f))
    turn = np.pi * (1.0 + np.sqrt(5.0)) * np.arange(rays)
    radius = 0.5 * diameter * np.sqrt((np.arange(rays) + 0.5) / rays)
    total = 0.0
    for x, y in np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1):
        pose = Pose(
            camera.pose.to_rig(np.array([[x, y, 0.0]]))[0], camera.pose.rotation_rig_to_camera
        )
        moved = (
            camera.camera.principal_point_px + camera.camera.focal_length_px * np.array([x, y]) / s
        )
        pinhole = RigCamera("cam01", replace(camera.camera, principal_point_px=moved), pose, s)
        total = total + Studio([pinhole], scene, SHARP).light(SHOT)[..., 0]
    return np.asarray(total / rays)


@pytest.mark.slow
def test_layers_agree_with_a_thin_lens() -> None:
    camera = placed(
        lens(200, f_number=0.45), (0.0, -700.0, 0.0), target_mm=(0, 0, 0), focus_mm=700.0
    )
    slanted = TargetSettings(
        "charuco", PlaceSettings((0.0, 0.0, 0.0), (1.2, -1.0, 0.0)), 40.0, squares=(9, 7)
    )
    scene = SceneSettings(with_head=False, targets=(slanted,))
    layered = Studio([camera], scene).light(SHOT)[..., 0]
    true = thin_lens(camera, scene, 48)
    sharp = Studio([camera], scene, SHARP).light(SHOT)[..., 0]
    contrast = sharp.max() - sharp.min()
    error = np.sqrt(((layered - true) ** 2).mean()) / contrast
    left_out = np.sqrt(((sharp - true) ** 2).mean()) / contrast
    assert left_out > 0.05, "the scene must be out of focus for this to say anything"
    # 48 pinholes leave steps of 1/48 in each blurred edge, a uniform error of 0.5 % rms; disks of
    # layers a third apart in blur add about as much.
    assert error < 0.015
    assert error < left_out / 6.0


@pytest.mark.slow
def test_a_backdrop_does_not_shine_through_the_face() -> None:
    bright = replace(
        SceneSettings(head=HeadSettings(subdivisions=0, grain_contrast=0.0)),
        backdrop=replace(SceneSettings().backdrop, centre=(9.0,) * 3, edge=(9.0,) * 3),
    )
    dark = replace(bright, backdrop=replace(bright.backdrop, centre=(0.0,) * 3, edge=(0.0,) * 3))
    camera = placed(lens(160, f_number=2.0), focus_mm=700.0)
    over_bright = Studio([camera], bright).light(SHOT)[..., 0]
    over_dark = Studio([camera], dark).light(SHOT)[..., 0]
    face = (slice(40, 80), slice(65, 95))
    assert np.allclose(over_bright[face], over_dark[face], atol=1e-5)
    assert over_bright[0, 0] > 8.0
    assert over_dark[0, 0] == 0.0


def test_a_scene_within_the_depth_of_field_stays_as_it_is() -> None:
    camera = placed(
        lens(160, f_number=45.0), (0.0, -800.0, 0.0), target_mm=(0, 0, 0), focus_mm=800.0
    )
    scene = SceneSettings(with_head=False, board=BoardSettings(PlaceSettings((0.0, 0.0, 0.0))))
    assert np.array_equal(
        Studio([camera], scene).light(SHOT), Studio([camera], scene, SHARP).light(SHOT)
    )
