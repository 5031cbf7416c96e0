"""Stations of simulated cameras that are quick: small pictures of a scene without a head."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from rigs import compact_camera, names

from geometry.camera import RigCamera
from geometry.frames import Pose, look_at_rotation
from rig.design.designfile import placed_camera


def write_station(
    folder: Path,
    *,
    url: str = "fake:",
    cameras: int = 2,
    name: str = "studio",
    more: str = "",
    width_px: int = 96,
) -> Path:
    """A station file with its design in ``folder``; ``more`` is put at its end."""
    folder.mkdir(parents=True, exist_ok=True)
    camera = compact_camera(
        image_size_px=(width_px, width_px * 2 // 3), pixel_pitch_mm=23.1 / width_px
    )
    placed = []
    for k, camera_name in enumerate(names(cameras)):
        place = (120.0 * k - 60.0 * (cameras - 1), -800.0, 0.0)
        pose = Pose(np.array(place), look_at_rotation(np.array(place), np.zeros(3)))
        placed.append(placed_camera(RigCamera(camera_name, camera, pose, 800.0)))
    design = {"schema": "rigwright.design/1", "cameras": placed}
    (folder / "design.json").write_text(json.dumps(design))
    sections = "".join(
        f'\n[[camera]]\nname = "{camera_name}"\nbackend = "simulated"\nid = "{camera_name}"\n'
        f"output = {k}\n"
        for k, camera_name in enumerate(names(cameras), 1)
    )
    path = folder / "station.toml"
    path.write_text(
        f'schema = "rigwright.station/1"\nname = "{name}"\ndesign = "design.json"\n'
        f'\n[trigger]\nurl = "{url}"\n{sections}'
        "\n[capture]\nmin_free_mb = 1.0\nframe_deadline_s = 1.0\n"
        f"\n[simulation]\nworkers = 0\n\n[simulation.scene]\nwith_head = false\n{more}"
    )
    return path
