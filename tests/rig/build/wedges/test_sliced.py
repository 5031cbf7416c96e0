"""Every printed part of a rig through a slicer of Debian: no support, and it stands by itself."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import trimesh
from held_mounts import AROUND
from rigs import face, face_cameras
from scipy.spatial import ConvexHull

from geometry.arrays import Floats
from rig.build.mounts.systemfile import system_from_mapping
from rig.build.wedges import print_part, wedge_stl
from rig.build.wedges.shape import STANDS_SHARE

PROGRAM = "slic3r"
NOZZLE_MM, LAYER_MM = 0.6, 0.4
SLICED_SHARE = 0.8 * STANDS_SHARE
"""The promise is of a solid part. Sliced, its walls weigh more than its inside, and the middle of
the outermost stroke lies half a stroke (0.3 mm) within the face: of the 5 mm that are asked under
a centre 50 mm up, that may take a fifth."""

MOVE = re.compile(r"G1 X([-\d.]+) Y([-\d.]+)(?: E([-\d.]+))?[^;]*; (.*)")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.needs_slicer,
    pytest.mark.skipif(shutil.which(PROGRAM) is None, reason=f"{PROGRAM} is not installed"),
]


@dataclass(frozen=True)
class Printed:
    """What the printer is told: strokes' middles (N, 3) in mm, filament and purpose of each."""

    middles_mm: Floats
    filament_mm: Floats
    purposes: tuple[str, ...]

    @property
    def supported(self) -> int:
        return sum("support" in purpose for purpose in self.purposes)


def printed(stl: Path) -> Printed:
    """The part as sliced; support is asked for wherever it overhangs by more than 60 degrees.

    The slicer's threshold is counted from the level: 30 degrees. A bridge needs no support.
    """
    out = stl.with_suffix(".gcode")
    done = subprocess.run(
        [
            PROGRAM, "--no-gui", "--support-material", "--support-material-threshold", "30",
            "--dont-support-bridges", "--gcode-comments", "--nozzle-diameter", str(NOZZLE_MM),
            "--layer-height", str(LAYER_MM), "--first-layer-height", str(LAYER_MM),
            "--fill-density", "10%", "--skirts", "0",
            "--output", str(out), str(stl),
        ],
        capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    said = done.stdout + done.stderr
    assert done.returncode == 0, said
    assert not re.search("warn|error|repair|degenerate|empty", said, re.IGNORECASE), said
    return read_gcode(out.read_text())


def read_gcode(text: str) -> Printed:
    here, height, fed = np.zeros(2), 0.0, 0.0
    middles, filament, purposes = [], [], []
    for line in text.splitlines():
        if line.startswith("G92 E0"):
            fed = 0.0
        elif raised := re.match(r"G1 Z([-\d.]+)", line):
            height = float(raised[1])
        elif unloaded := re.match(r"G1 E([-\d.]+)", line):
            fed = float(unloaded[1])
        elif move := MOVE.match(line):
            there = np.array([float(move[1]), float(move[2])])
            if move[3]:
                middles.append([*(here + there) / 2.0, height])
                filament.append(float(move[3]) - fed)
                purposes.append(move[4])
                fed = float(move[3])
            here = there
    return Printed(np.array(middles), np.array(filament), tuple(purposes))


def test_the_slicer_sees_what_hangs(tmp_path: Path) -> None:
    """A bar across a block, and the same bar hovering: both are given support."""
    block = trimesh.creation.box((10.0, 10.0, 6.0))
    block.apply_translation([0.0, 0.0, 3.0])
    bar = trimesh.creation.box((40.0, 10.0, 3.0))
    bar.apply_translation([0.0, 0.0, 7.0])
    stl = tmp_path / "hammer.stl"
    trimesh.boolean.union([block, bar]).export(stl)
    assert printed(stl).supported > 0
    bar.apply_translation([0.0, 0.0, 2.0])
    trimesh.util.concatenate([block, bar]).export(stl)
    assert printed(stl).supported > 0


def test_all_parts_of_a_plate_print_without_support_and_stand(tmp_path: Path) -> None:
    """Of the mounts only the plate has printed parts: a wedge for each of seven cameras."""
    spec = system_from_mapping({"kind": "plate"})
    wedges = spec.system.hold(face_cameras(face(), 7), AROUND).build().structure.wedges
    assert len(wedges) == 7
    for wedge in wedges:
        stl = tmp_path / f"{wedge.camera}.stl"
        stl.write_bytes(wedge_stl(print_part(wedge, spec.system.catalogue)))
        sliced = printed(stl)
        assert sliced.supported == 0, wedge.id
        layers = np.unique(sliced.middles_mm[:, 2])
        # A layer that is missing would leave a gap of two.
        assert np.diff(layers).max() < 1.5 * LAYER_MM
        first = sliced.middles_mm[:, 2] == layers[0]
        on_bed = ConvexHull(sliced.middles_mm[first, :2]).equations
        share = sliced.filament_mm / sliced.filament_mm.sum()
        centre = share @ sliced.middles_mm
        inside = -(on_bed[:, :2] @ centre[:2] + on_bed[:, 2]).max()
        assert inside >= SLICED_SHARE * centre[2], wedge.id
