"""The studio's scene as a folder that Blender can build: head, skin, lights, cameras."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import numpy as np

from common.errors import InputError
from geometry.camera import RigCamera, bends
from geometry.exchange import write_export
from rig.simulation.grain import SPACINGS_MM
from rig.simulation.mesh import TexturedMesh
from rig.simulation.settings import SceneSettings

SUBSURFACE = 0.25
"""Share of the skin's light that went below its surface."""

SUBSURFACE_RADIUS_MM = (1.0, 0.35, 0.2)
"""Mean way of red, green and blue below it: Blender's own figures for skin, times 1 mm."""

ROUGHNESS = 0.5

_GRAIN_GAIN = 3.0
"""Blender's noise spreads over 0 to 1 with an rms of about a sixth: a half over that is three."""


@dataclass(frozen=True)
class SceneForBlender:
    """The studio's scene, and how Blender renders it."""

    scene: SceneSettings
    samples: int
    threads: int
    depth_of_field: bool

    def write(self, folder: Path, cameras: Sequence[RigCamera], surface: TexturedMesh) -> None:
        """``cameras_blender.py``, ``head.npz``, ``skin.png`` and ``scene.json``.

        Raises :class:`InputError` for lenses that bend the picture, which Blender's cameras do not.
        """
        for camera in cameras:
            if bends(camera.camera.distortion):
                raise InputError(
                    "blender-lens",
                    f"the lens of {camera.name} has distortion, and Blender's cameras have none",
                    "give lenses without distortion, or photograph in the studio",
                )
        write_export(folder, "blender", tuple(cameras))
        _write_head(folder, surface)
        told = self._told() | {"cameras": self._pictures(cameras)}
        (folder / "scene.json").write_text(json.dumps(told), encoding="utf-8")

    def _pictures(self, cameras: Sequence[RigCamera]) -> list[dict[str, object]]:
        return [
            {
                "name": camera.name,
                "file": picture_file(number),
                "image_size_px": list(camera.camera.image_size_px),
                "depth_of_field": self.depth_of_field,
            }
            for number, camera in enumerate(cameras)
        ]

    def _told(self) -> dict[str, object]:
        scene, kinds = self.scene, len(SPACINGS_MM)
        return {
            "skin": {
                "grain_spacings_mm": list(SPACINGS_MM),
                "grain_contrast": _GRAIN_GAIN * scene.head.grain_contrast / math.sqrt(kinds),
                "subsurface": SUBSURFACE,
                "subsurface_radius_mm": list(SUBSURFACE_RADIUS_MM),
                "roughness": ROUGHNESS,
            },
            "lights": [asdict(light) for light in scene.lights],
            "ambient": scene.ambient,
            "backdrop": list(scene.backdrop.centre),
            "samples": self.samples,
            "threads": self.threads,
        }


def picture_file(number: int) -> str:
    """What the rendered picture of the camera with this number is called, without its ending."""
    return f"{number:03d}"


def _write_head(folder: Path, surface: TexturedMesh) -> None:
    height, width = surface.picture.shape[:2]
    px = surface.texture_px.reshape(-1, 2)
    # Pixel centres are at integers here, and Blender counts rows from the bottom.
    uv = np.stack([(px[:, 0] + 0.5) / width, 1.0 - (px[:, 1] + 0.5) / height], axis=-1)
    np.savez(
        folder / "head.npz",
        vertices=surface.vertices_mm,
        faces=surface.faces,
        uv=uv,
        tint=surface.tint,
    )
    # Not imwrite, which says nothing of a full disk.
    (folder / "skin.png").write_bytes(cv2.imencode(".png", surface.picture[..., ::-1])[1].tobytes())
