"""Pictures of targets that are held before the four cameras of a small rig, as files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from held_patterns import placed_carrier
from scipy.spatial.transform import Rotation
from simulated_rigs import lens, placed

from calibration.targets.kinds import CarrierKind, CharucoPlate
from calibration.targets.rendering import photographed, render
from geometry.arrays import Floats
from geometry.camera import RigCamera
from geometry.frames import Pose

PLATE = CharucoPlate("plate", 6, 5, 25.0, 18.0, "DICT_4X4_50")
PLATE_TOML = """\
schema = "rigwright.targets/1"
name = "held plate"

[[plates]]
name = "plate"
columns = 6
rows = 5
square_mm = 25.0
marker_mm = 18.0
dictionary = "DICT_4X4_50"
"""
FACING = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""A carrier (x right, y down) that faces cameras in front of the subject, carrier to rig."""

Pictures = Mapping[str, Mapping[str, np.ndarray]]
"""By camera and frame."""


@lru_cache(maxsize=4)
def rig(width_px: int = 400) -> tuple[RigCamera, ...]:
    """Four cameras in a zigzag at 0.9 m."""
    camera = lens(width_px, 24.0)
    spots = ((-300.0, 60.0), (-100.0, -60.0), (100.0, 60.0), (300.0, -60.0))
    return tuple(
        placed(camera, (x, -900.0, z), f"cam{k:02d}", (0.0, 0.0, 0.0), 900.0)
        for k, (x, z) in enumerate(spots, 1)
    )


def shifted(camera: RigCamera, by_mm: tuple[float, float, float]) -> RigCamera:
    """The camera after a knock."""
    pose = Pose(camera.pose.position_rig_mm + by_mm, camera.pose.rotation_rig_to_camera)
    return RigCamera(camera.name, camera.camera, pose, camera.focus_distance_mm)


def held(count: int, seed: int, tilt_deg: float = 35.0) -> tuple[tuple[Floats, Floats], ...]:
    """Attitudes (3, 3), carrier to rig, and places (3,) of the middle, as a hand would."""
    random = np.random.default_rng(seed)
    turns = Rotation.from_euler("xyz", random.uniform(-1.0, 1.0, (count, 3)) * tilt_deg, True)
    places = random.uniform(-1.0, 1.0, (count, 3)) * [40.0, 60.0, 25.0]
    return tuple(zip(FACING @ turns.as_matrix(), places, strict=True))


def shown(
    kind: CarrierKind,
    cameras: Sequence[RigCamera],
    places: Sequence[tuple[Floats, Floats]],
    seed: int = 0,
) -> dict[str, dict[str, np.ndarray]]:
    """What each camera sees of a carrier at each place of its middle: grey, 8 bits."""
    nominal = kind.carrier().nominal_mm
    middle = (nominal.min(axis=0) + nominal.max(axis=0)) / 2.0
    pictures: dict[str, dict[str, np.ndarray]] = {camera.name: {} for camera in cameras}
    for number, (turn, place) in enumerate(places):
        for camera in cameras:
            to_camera = camera.pose.rotation_rig_to_camera
            way = to_camera @ (place - turn @ middle - camera.pose.position_rig_mm)
            grey = render(camera.camera, placed_carrier(kind, to_camera @ turn, way))
            noise = seed + 1000 * number + int(camera.name[-2:])
            pictures[camera.name][f"{number:02d}"] = photographed(grey, 1.0, noise)
    return pictures


def write_pictures(folder: Path, pictures: Pictures, suffix: str = ".png") -> Path:
    """A folder per camera with a file per frame."""
    for camera, frames in pictures.items():
        (folder / camera).mkdir(parents=True, exist_ok=True)
        for frame, picture in frames.items():
            assert cv2.imwrite(str(folder / camera / f"{frame}{suffix}"), picture)
    return folder
