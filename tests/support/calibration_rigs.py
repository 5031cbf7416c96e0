"""A station of four simulated cameras that are shown a held plate, for tests of calibration."""

from __future__ import annotations

import json
from pathlib import Path

from simulated_rigs import lens, placed

from geometry.camera import RigCamera
from rig.design.designfile import placed_camera

PLATE = {
    "name": "plate",
    "columns": 9,
    "rows": 7,
    "square_mm": 20.0,
    "marker_mm": 15.0,
    "dictionary": "DICT_4X4_50",
}
TARGETS = {"schema": "rigwright.targets/1", "name": "held plate", "plates": [PLATE]}
WIDTH_PX = 640
FACE_WIDTH_MM = 190.0
"""Nine squares and a border of a quarter square on either side."""


def four_cameras() -> tuple[RigCamera, ...]:
    """Four cameras in a zigzag at 0.9 m, with a lens that distorts."""
    camera = lens(WIDTH_PX, 24.0, (-0.1, 0.05, 0.0, 0.0, 0.0))
    places = [(-300.0, 60.0), (-100.0, -60.0), (100.0, 60.0), (300.0, -60.0)]
    return tuple(
        placed(camera, (x, -900.0, z), f"cam{k:02d}", (0.0, 0.0, 0.0), 900.0)
        for k, (x, z) in enumerate(places, 1)
    )


def write_plate_station(folder: Path, face: Path, faults: str = "", name: str = "studio") -> Path:
    """A station whose cameras see the picture ``face`` of a plate, held up anew each capture."""
    folder.mkdir(parents=True, exist_ok=True)
    cameras = four_cameras()
    design = {"schema": "rigwright.design/1", "cameras": [placed_camera(c) for c in cameras]}
    (folder / "design.json").write_text(json.dumps(design))
    sections = "".join(
        f'\n[[camera]]\nname = "{c.name}"\nbackend = "simulated"\nid = "{c.name}"\noutput = {k}\n'
        for k, c in enumerate(cameras, 1)
    )
    path = folder / "station.toml"
    path.write_text(
        f'schema = "rigwright.station/1"\nname = "{name}"\ndesign = "design.json"\n'
        f'\n[trigger]\nurl = "fake:"\n{sections}'
        "\n[capture]\nmin_free_mb = 1.0\nframe_deadline_s = 60.0\n"
        '\n[simulation]\npixel_format = "Mono8"\nseed = 5\n'
        "\n[simulation.scene]\nwith_head = false\n"
        "\n[[simulation.scene.targets]]\n"
        f'kind = "image"\nimage = "{face}"\nsize_mm = {FACE_WIDTH_MM}\nsharp = true\n'
        "[simulation.scene.targets.place]\nposition_rig_mm = [0.0, 0.0, 0.0]\n"
        "[simulation.scene.targets.held]\nwithin_mm = [50.0, 40.0, 60.0]\nseed = 1\n"
        f"{faults}"
    )
    return path
