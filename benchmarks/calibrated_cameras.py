"""Cameras as a calibration finds them: the same simulated rig photographs targets first.

A plate and a scale bar are held up in another place for each capture, before a sheet that stands
still: the target set of ``rigwright practice``, where the subject will be.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calibration.adjustment import CalibratedCamera, Calibration, CalibrationOptions, calibrate
from calibration.detection.pictures import TakenPicture, detect_pictures
from calibration.exports import rig_cameras
from calibration.targets.faces import carrier_face
from calibration.targets.files import targets_from
from calibration.targets.kinds import TargetPlan
from geometry.arrays import Floats
from geometry.camera import RigCamera
from rig.simulation.flatsettings import HeldSettings, PlaceSettings, TargetSettings
from rig.simulation.settings import SceneSettings
from rig.simulation.studio import Shot, Studio
from service.practice import practice_files

_PLACES: dict[str, tuple[tuple[float, float, float], HeldSettings | None]] = {
    "plate": ((0.0, 0.0, 25.0), HeldSettings((45.0, 40.0, 30.0), 35.0, seed=1)),
    "stand": ((0.0, 150.0, 0.0), None),
    "scale": ((0.0, -40.0, -125.0), HeldSettings((25.0, 20.0, 8.0), 20.0, 5.0, seed=2)),
}
"""From the middle of the subject, mm, and how each is held, as the practice station has them."""


def calibrated(
    cameras: Sequence[RigCamera],
    centre_mm: Floats,
    captures: int,
    exposure_us: float,
    kept: Path | None = None,
) -> tuple[tuple[RigCamera, ...], Calibration]:
    """The cameras as found from ``captures`` captures of targets about ``centre_mm`` (3,).

    Pictures that are in the folder ``kept`` are taken from there, others are put into it.
    """
    plan = targets_from(practice_files()["targets.toml"].decode())
    with tempfile.TemporaryDirectory() as folder:
        studio = Studio(cameras, _scene(plan, centre_mm, Path(folder)))
        pictures = [
            TakenPicture(
                name,
                f"{capture:03d}",
                photographed(
                    studio,
                    Shot(
                        name,
                        exposure_us,
                        pixel_format="Mono8",
                        seed=(2, capture, number),
                        capture=capture,
                    ),
                    kept,
                ),
            )
            for capture in range(captures)
            for number, name in enumerate(studio.cameras)
        ]
    seen = detect_pictures(pictures, plan)
    start = tuple(CalibratedCamera.from_rig(camera) for camera in cameras)
    done = calibrate(seen.observations, CalibrationOptions(start=start))
    return rig_cameras(done.cameras, cameras), done


def photographed(studio: Studio, shot: Shot, kept: Path | None) -> NDArray[np.uint8]:
    """A photograph, from the folder of kept ones where it is there."""
    width, height = studio.cameras[shot.camera].camera.image_size_px
    seed = "-".join(str(part) for part in shot.seed)
    file = f"{shot.camera}-{shot.pixel_format}-{seed}-{width}x{height}.npy"
    return taken(kept, file, lambda: np.asarray(studio.photograph(shot), dtype=np.uint8))


def taken(kept: Path | None, name: str, take: Callable[[], NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """The picture of that name in the folder ``kept``, or what ``take`` takes, kept there."""
    if kept is None:
        return take()
    file = kept / name
    if not file.exists():
        kept.mkdir(parents=True, exist_ok=True)
        # Whole or not at all: whoever is stopped goes on where they were.
        begun = file.with_suffix(".begun.npy")
        np.save(begun, take())
        begun.rename(file)
    return np.asarray(np.load(file))


def _scene(plan: TargetPlan, centre_mm: Floats, folder: Path) -> SceneSettings:
    targets = []
    for kind in plan.carriers:
        face, (place, held) = carrier_face(kind), _PLACES[kind.name]
        image = folder / f"{kind.name}.png"
        image.write_bytes(face.png)
        x, y, z = (float(v) for v in centre_mm + np.array(place))
        targets.append(
            TargetSettings(
                "image",
                PlaceSettings((x, y, z)),
                face.width_mm,
                image=image,
                sharp=True,
                held=held,
            )
        )
    return SceneSettings(with_head=False, targets=tuple(targets))
