"""Numbers and names as exported files have them."""

from __future__ import annotations

import json
from collections.abc import Iterable

import numpy as np

from calibration.adjustment.camera import CalibratedCamera
from geometry.arrays import Floats

METRE = 1e-3
"""Metres per millimetre, for formats whose programs count in metres."""


def numbers(values: Iterable[float], separator: str = ", ") -> str:
    """Numbers with every digit, so that reading gives them back bit for bit."""
    return separator.join(repr(float(v)) for v in values)


def matrix_rows(matrix: Floats) -> str:
    """A matrix as nested lists, for TOML and YAML."""
    return "[" + ", ".join(f"[{numbers(row)}]" for row in matrix) + "]"


def quoted(name: str) -> str:
    """A name as a string in double quotes, valid in JSON, TOML and YAML alike."""
    return json.dumps(name, ensure_ascii=False)


def translation_mm(camera: CalibratedCamera) -> Floats:
    """The t (3,) of ``x_camera = R X + t``."""
    pose = camera.pose
    return np.asarray(-pose.rotation_rig_to_camera @ pose.position_rig_mm)
