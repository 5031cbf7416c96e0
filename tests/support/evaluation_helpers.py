"""A small rig's pictures of the bundled head, with the surface that was photographed."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh

from geometry.camera import Camera, RigCamera
from geometry.frames import Pose
from rig.simulation.settings import HeadSettings, SceneSettings
from rig.simulation.studio import Shot, Studio

ROOT = Path(__file__).resolve().parents[2]
AZIMUTHS_DEG = (-30.0, -15.0, 0.0, 15.0, 30.0)
DISTANCE_MM = 700.0


def run(*arguments: object) -> subprocess.CompletedProcess[str]:
    """The command line, in the checkout."""
    return subprocess.run(
        [sys.executable, "-W", "error", "-m", "service.cli", *map(str, arguments)],
        capture_output=True, text=True, check=False, cwd=ROOT,
    )  # fmt: skip


def small_rig(camera: Camera, middle_mm: np.ndarray) -> tuple[RigCamera, ...]:
    """Five level cameras on an arc before the face."""
    out = []
    for number, azimuth in enumerate(np.radians(AZIMUTHS_DEG), 1):
        place = middle_mm + DISTANCE_MM * np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])
        z = (middle_mm - place) / DISTANCE_MM
        x = np.cross(z, [0.0, 0.0, 1.0])
        pose = Pose(place, np.array([x, np.cross(z, x), z]))
        out.append(RigCamera(f"cam{number:02d}", camera, pose, DISTANCE_MM - 60.0))
    return tuple(out)


def photographed(folder: Path) -> Path:
    """Writes pictures/camNN/1.png, design.json, truth.ply and nose.json into ``folder``."""
    import cv2

    from rig.design.designfile import placed_camera
    from rig.specification.examples import example_rig

    kind = example_rig("face").camera
    width = 720
    camera = replace(
        kind,
        image_size_px=(width, round(width * kind.image_size_px[1] / kind.image_size_px[0])),
        pixel_pitch_mm=kind.pixel_pitch_mm * kind.image_size_px[0] / width,
        principal_point_px=np.full(2, np.nan),
    )
    studio = Studio(small_rig(camera, np.array([0.0, -60.0, 0.0])), SceneSettings(HeadSettings()))
    surface = studio.surface
    assert surface is not None
    nose = surface.vertices_mm[np.argmin(surface.vertices_mm[:, 1])]
    studio = Studio(
        small_rig(camera, nose + np.array([0.0, 40.0, 0.0])), SceneSettings(HeadSettings())
    )
    for number, placed in enumerate(studio.cameras.values()):
        image = studio.photograph(Shot(placed.name, 4000.0, seed=(1, number)))
        place = folder / "pictures" / placed.name
        place.mkdir(parents=True)
        cv2.imwrite(str(place / "1.png"), np.asarray(image)[..., ::-1])
    cameras = [placed_camera(c) for c in studio.cameras.values()]
    document = {"schema": "rigwright.design/1", "cameras": cameras}
    (folder / "design.json").write_text(json.dumps(document), encoding="utf-8")
    mesh = trimesh.Trimesh(surface.vertices_mm, surface.faces, process=False)
    mesh.export(folder / "truth.ply")
    (folder / "nose.json").write_text(json.dumps([float(v) for v in nose]))
    return folder
