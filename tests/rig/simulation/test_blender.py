"""Blender as the photographer: what it is given, what it returns, and how it fails."""

from __future__ import annotations

import json
import os
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from simulated_rigs import STRONG, lens, three

from common.errors import CancelledError, InputError
from common.progress import Progress
from geometry.raycast import Occluder
from rig.simulation.blender.handoff import SceneForBlender
from rig.simulation.blender.photographing import BlenderPhotographer
from rig.simulation.settings import HeadSettings, SceneSettings, SensorSettings
from rig.simulation.studio import Shot, Studio

BLENDER_PYTHON = os.environ.get("TESTS_BLENDER_PYTHON")
HEAD = HeadSettings(subdivisions=0)


@pytest.fixture(scope="module")
def studio() -> Studio:
    return Studio(three(lens(240, 30.0)), SceneSettings(head=HEAD), SensorSettings())


def shots(studio: Studio) -> list[Shot]:
    return [Shot(name, 4000.0, seed=(1, n)) for n, name in enumerate(studio.cameras)]


def program(tmp_path: Path, body: str) -> str:
    path = tmp_path / "blender"
    path.write_text(f"#!/bin/sh\n{body}\n")
    path.chmod(0o755)
    return str(path)


def test_the_scene_has_head_lights_and_cameras(studio: Studio, tmp_path: Path) -> None:
    surface = studio.surface
    assert surface is not None
    scene = SceneForBlender(studio.scene, samples=7, threads=2, depth_of_field=False)
    scene.write(tmp_path, list(studio.cameras.values()), surface)
    told = json.loads((tmp_path / "scene.json").read_text())
    assert [c["name"] for c in told["cameras"]] == list(studio.cameras)
    assert (told["samples"], told["threads"]) == (7, 2)
    assert len(told["lights"]) == len(studio.scene.lights)
    with np.load(tmp_path / "head.npz") as head:
        assert np.array_equal(head["vertices"], surface.vertices_mm)
        # The middle of the top left pixel, counted from the bottom left corner in shares.
        h, w = surface.picture.shape[:2]
        px = head["uv"] * [w, -h] + [-0.5, h - 0.5]
        assert np.abs(px - surface.texture_px.reshape(-1, 2)).max() < 1e-3


def test_a_lens_with_distortion_is_refused(tmp_path: Path) -> None:
    bent = Studio(three(lens(240, 30.0, STRONG)), SceneSettings(head=HEAD))
    with pytest.raises(InputError, match="the lens of cam01 has distortion"):
        BlenderPhotographer(program(tmp_path, "exit 0"))(bent, shots(bent))


def test_a_program_that_is_not_there_or_fails_is_told(studio: Studio, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be run: No such file"):
        BlenderPhotographer(str(tmp_path / "none"))(studio, shots(studio))
    failing = program(tmp_path, "echo 'Error: no GPU'; exit 3")
    with pytest.raises(InputError, match="ended with code 3: Error: no GPU"):
        BlenderPhotographer(failing)(studio, shots(studio))
    with pytest.raises(InputError, match="rendered 0 of 3 pictures"):
        BlenderPhotographer(program(tmp_path, "echo hello"))(studio, shots(studio))


class Told:
    """Told to stop once the program has begun."""

    def __init__(self, mark: Path) -> None:
        self._mark = mark

    def is_set(self) -> bool:
        return self._mark.exists() and bool(self._mark.read_text())


def test_it_stops_at_once_and_leaves_no_program(studio: Studio, tmp_path: Path) -> None:
    mark = tmp_path / "pid"
    silent = program(tmp_path, f"echo $$ > {mark}; exec sleep 60")
    began = time.monotonic()
    with pytest.raises(CancelledError):
        BlenderPhotographer(silent)(studio, shots(studio), cancel=Told(mark))
    assert time.monotonic() - began < 30.0  # half of what the program would sleep
    with pytest.raises(ProcessLookupError):
        os.kill(int(mark.read_text()), 0)


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.skipif(BLENDER_PYTHON is None, reason="TESTS_BLENDER_PYTHON names no interpreter")
def test_blender_shows_the_head_where_the_studio_shows_it(studio: Studio) -> None:
    sharp = Studio(
        tuple(studio.cameras.values()),
        studio.scene,
        replace(studio.sensor, depth_of_field=False, lens_blur_px=0.0, vignetting=0.0),
    )
    heard: list[Progress] = []
    images = BlenderPhotographer(str(BLENDER_PYTHON), samples=16)(
        sharp, [replace(s, pixel_format="RGB16") for s in shots(sharp)], heard.append
    )
    assert heard[-1].fraction == 1.0
    surface = sharp.surface
    assert surface is not None
    occluder = Occluder(surface.vertices_mm, surface.faces)
    for image, camera in zip(images, sharp.cameras.values(), strict=True):
        height, width = image.shape[:2]
        columns, rows = np.meshgrid(np.arange(width), np.arange(height))
        pixels = np.stack([columns.ravel(), rows.ravel()], axis=1).astype(np.float64)
        rays = camera.camera.rays(pixels) @ camera.pose.rotation_rig_to_camera
        eyes = np.broadcast_to(camera.pose.position_rig_mm, rays.shape)
        hit = (occluder.first_hits(eyes, rays)[0] >= 0).reshape(height, width)
        light = image.astype(np.float64) / 65535.0
        # The backdrop of one colour has the sensor's noise alone: six times it for three channels.
        off = np.abs(light - np.array(sharp.scene.backdrop.centre)).max(axis=2)
        shown = off > 6.0 * np.sqrt(0.25 / sharp.sensor.full_well_e)
        # Pixels on the outline are half and half: they may differ, by half of them on average,
        # and skin that happens to be as bright as the backdrop leaves some holes.
        where = [np.array(np.nonzero(m)).mean(axis=1) for m in (hit, shown)]
        assert np.abs(where[0] - where[1]).max() < 0.5
        assert (hit ^ shown).mean() < 0.02
