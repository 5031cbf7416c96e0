"""Cameras that the others speak against, on pictures and surfaces known to the last bit."""

from __future__ import annotations

from dataclasses import replace

import cv2
import matching_scenes as scenes
import numpy as np
import pytest

from common.errors import InputError
from evaluation.reconstruction.agreement import Doubt, doubts, pair_agreement
from evaluation.reconstruction.depthmaps import DepthMap
from evaluation.reconstruction.reconstructing import require_agreement
from evaluation.reconstruction.views import View
from geometry.frames import Pose

ODD = 2
"""The camera with which something is wrong."""


def exact_map(view: View, stride: int = 4) -> DepthMap:
    rho = scenes.true_inverse_depth(view)
    dy, dx = np.gradient(rho)
    grid = (slice(None, None, stride), slice(None, None, stride))
    shape = rho[grid].shape
    return DepthMap(
        view, stride, rho[grid], np.stack([dx, dy], axis=-1)[grid], np.full(shape, 1e-12),
        np.ones(shape, np.float32), np.full(shape, 2, np.int8),
    )  # fmt: skip


@pytest.fixture(scope="module")
def views() -> list[View]:
    return scenes.plane_views(0.002)


def told(views: list[View], odd: View) -> tuple[Doubt, ...]:
    shown = [odd if k == ODD else v for k, v in enumerate(views)]
    maps = [exact_map(v) for v in shown]
    pairs = [
        found
        for k in range(len(shown))
        for n in range(len(shown))
        if k != n and (found := pair_agreement(maps, k, n, shown[n])) is not None
    ]
    return doubts(pairs, [v.name for v in shown])


def test_nothing_is_said_of_cameras_that_agree(views: list[View]) -> None:
    assert told(views, views[ODD]) == ()


@pytest.mark.parametrize("way", [(0.4, 0.0, 0.0), (0.0, 0.0, -0.4)], ids=["across", "up"])
def test_a_camera_that_moved_is_named_with_its_pixels(
    views: list[View], way: tuple[float, float, float]
) -> None:
    odd = views[ODD]
    pose = Pose(odd.pose.position_rig_mm + np.array(way), odd.pose.rotation_rig_to_camera)
    (doubt,) = told(views, replace(odd, pose=pose))
    assert (doubt.camera, doubt.kind) == ("cam3", "moved")
    # 0.4 mm at 420 mm and 900 px are 0.86 px; across, the camera looks along it a little.
    pixels = float(doubt.words.split(" by ")[1].split(" px")[0])
    assert 0.5 < pixels < 1.1


@pytest.mark.parametrize("kind", ["foreign", "black", "blurred", "dark"])
def test_a_picture_that_does_not_fit_is_named(views: list[View], kind: str) -> None:
    odd, rng = views[ODD], np.random.default_rng(5)
    grey = {
        "foreign": rng.random(odd.grey.shape),
        "black": np.zeros(odd.grey.shape),
        "blurred": cv2.GaussianBlur(odd.grey, (0, 0), 3.0),
        # Two stops as a picture with the sRGB curve has them.
        "dark": 0.54 * odd.grey,
    }[kind]
    (doubt,) = told(views, replace(odd, grey=grey.astype(np.float32)))
    assert doubt.camera == "cam3"
    assert doubt.kind == ("foreign" if kind == "black" else kind)


def test_of_two_cameras_none_is_blamed(views: list[View]) -> None:
    pair = [views[0], replace(views[1], grey=np.zeros_like(views[1].grey))]
    maps = [exact_map(v) for v in pair]
    found = pair_agreement(maps, 0, 1, pair[1])
    assert found is not None
    assert doubts([found], ["cam1", "cam2"]) == ()


@pytest.mark.parametrize(("points", "word"), [(0, "no surface"), (499, "contradict one another")])
def test_pictures_that_hardly_agree_are_refused(points: int, word: str) -> None:
    with pytest.raises(InputError, match=word):
        require_agreement(points, 10_000)


def test_half_of_the_patches_is_as_usual() -> None:
    require_agreement(5_000, 10_000)
