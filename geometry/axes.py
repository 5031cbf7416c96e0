"""Which way a file stands: the directions that point up and out of the face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats

DIRECTIONS = {
    sign + name: (1.0 if sign == "+" else -1.0) * np.eye(3)[index]
    for index, name in enumerate("xyz")
    for sign in "+-"
}
"""Unit vector (3,) of each axis direction by name."""

_REMEDY = 'give up and front, for example up = "+y", front = "+z"'


@dataclass(frozen=True)
class Axes:
    """The directions of the file, such as ``+y``, that point up and out of the face."""

    up: str
    front: str

    def __post_init__(self) -> None:
        known = self.up in DIRECTIONS and self.front in DIRECTIONS
        if not known or DIRECTIONS[self.up] @ DIRECTIONS[self.front] != 0.0:
            problem = f"up {self.up!r} and front {self.front!r} do not make a frame"
            raise InputError("axes", problem, _REMEDY)

    @property
    def rotation_file_to_rig(self) -> Floats:
        """Maps directions of the file to the rig frame, (3, 3)."""
        up, front = DIRECTIONS[self.up], DIRECTIONS[self.front]
        return np.stack([np.cross(up, front), -front, up])


RIG_AXES = Axes("+z", "-y")
"""Axes of a file that stands in the rig frame already."""

GLTF_AXES = Axes("+y", "+z")
"""Axes that glTF prescribes."""
