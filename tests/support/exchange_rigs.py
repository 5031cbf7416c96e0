"""Cameras for the tests of the exports: two whose numbers can be worked out by hand, and many."""

from __future__ import annotations

import numpy as np

from geometry.camera import Body, Camera, RigCamera
from geometry.frames import Pose

DISTORTION = np.array([-0.11, 0.07, 0.003, -0.004, 0.012])


def small_camera(distortion: object = (0.0,) * 5, point: object = (209.5, 94.5)) -> Camera:
    """400 x 200 pixels of 0.01 mm, 4 mm lens: a focal length of 400 pixels.

    The principal point (209.5, 94.5) is, with the image's corner at (0, 0), (210, 95): 10 pixels
    to the right of the middle and 5 above it.
    """
    return Camera(
        "small",
        (400, 200),
        0.01,
        4.0,
        8.0,
        0.02,
        100.0,
        Body([30.0] * 3, [0.0, 0.0, -20.0]),
        principal_point_px=np.array(point),
        distortion=np.array(distortion),
    )


def front_pose() -> Pose:
    """One metre in front of the origin, 200 mm up, level, looking along +Y."""
    return Pose([0.0, -1000.0, 200.0], [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def side_pose() -> Pose:
    """One metre to the subject's left, 200 mm up, level, looking along -X."""
    return Pose([1000.0, 0.0, 200.0], [[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])


def hand_rig(distortion: object = (0.0,) * 5) -> tuple[RigCamera, ...]:
    """The two cameras whose exports are worked out by hand."""
    camera = small_camera(distortion)
    return (
        RigCamera("front", camera, front_pose(), 1000.0),
        RigCamera("side one", camera, side_pose(), 1000.0),
    )


def many_cameras(distorted: bool, count: int = 9, seed: int = 4) -> tuple[RigCamera, ...]:
    """Cameras all about the origin, each with a lens and a principal point of its own."""
    rng = np.random.default_rng(seed)
    cameras = []
    for k in range(count):
        place = rng.normal(size=3) * 400.0 + [0.0, -900.0, 0.0]
        pose = Pose.looking_at(place, rng.normal(size=3) * 50.0, rng.uniform(-180.0, 180.0))
        terms = DISTORTION * rng.uniform(0.2, 1.0) if distorted else np.zeros(5)
        camera = Camera(
            f"kind {k}",
            (4000 + 8 * k, 3000),
            0.00345,
            25.0 + k,
            8.0,
            0.007,
            100.0,
            Body([29.0] * 3, [0.0, 0.0, -20.0]),
            principal_point_px=np.array([2000.0, 1500.0]) + rng.normal(size=2) * 20.0,
            distortion=terms,
        )
        cameras.append(RigCamera(f"cam{k + 1:02d}", camera, pose, 800.0))
    return tuple(cameras)


def points_in_view(seed: int = 7, count: int = 60) -> np.ndarray:
    """Points (N, 3) about the origin, rig frame, millimetres."""
    return np.random.default_rng(seed).uniform(-90.0, 90.0, size=(count, 3))
