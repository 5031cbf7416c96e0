"""Distances against those of CloudCompare, another program with another search."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import trimesh

from evaluation.comparison.distances import signed_distances
from evaluation.comparison.referencefile import read_reference
from evaluation.reconstruction.cloudfile import read_points, write_distances

pytest.importorskip("igl")
PROGRAM = "CloudCompare"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.needs_cloudcompare,
    pytest.mark.skipif(shutil.which(PROGRAM) is None, reason=f"{PROGRAM} is not installed"),
]


def scene(folder: Path) -> None:
    """A dented ball of the size of a head, and a cloud about it: 0.3 mm and a few far points."""
    rng = np.random.default_rng(1)
    ball = trimesh.creation.icosphere(5, 1.0)
    way = np.asarray(ball.vertices)
    dents = 6.0 * np.sin(7.0 * way[:, :1]) * np.cos(5.0 * way[:, 1:2] + way[:, 2:])
    solid = trimesh.Trimesh((90.0 + dents) * way, ball.faces, process=False)
    solid.export(folder / "truth.ply")
    places = np.asarray(solid.vertices)[solid.faces].mean(axis=1)[::3]
    off = rng.normal(0.0, 0.3, places.shape)
    off[::50] *= 10.0
    write_distances(folder / "cloud.ply", places + off, np.zeros(len(places)))


def test_distances_are_those_of_cloudcompare(tmp_path: Path) -> None:
    scene(tmp_path)
    done = subprocess.run(
        [
            PROGRAM, "-SILENT", "-NO_TIMESTAMP", "-AUTO_SAVE", "OFF",
            "-C_EXPORT_FMT", "ASC", "-PREC", "9", "-O", "cloud.ply", "-O", "truth.ply",
            "-C2M_DIST", "-SAVE_CLOUDS", "FILE", "theirs.asc",
        ],
        cwd=tmp_path, capture_output=True, text=True, check=False, timeout=120,
        env=os.environ | {"QT_QPA_PLATFORM": "offscreen"},
    )  # fmt: skip
    assert (tmp_path / "theirs.asc").exists(), done.stdout + done.stderr
    theirs = np.loadtxt(tmp_path / "theirs.asc")
    points = read_points(tmp_path / "cloud.ply")
    assert np.abs(theirs[:, :3] - points).max() < 1e-5
    ours, _ = signed_distances(points, read_reference(tmp_path / "truth.ply"))
    # CloudCompare counts in single precision: 90 mm keep 90 x 2^-24 = 0.005 um, and a distance
    # takes some such roundings. A micrometre is what users may rely on.
    assert np.abs(ours - theirs[:, 3]).max() < 1e-3
    assert abs(ours.mean() - theirs[:, 3].mean()) < 0.5e-3
    assert abs(np.sqrt(np.mean(ours**2)) - np.sqrt(np.mean(theirs[:, 3] ** 2))) < 0.5e-3
    assert np.abs(ours).max() > 5.0
