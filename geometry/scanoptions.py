"""What the owner of a scan file says about it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats
from geometry.axes import DIRECTIONS, Axes
from geometry.rotations import nearest_rotation
from geometry.units import MM_PER_UNIT

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class ScanOptions:
    """What is known about a scan file; ``auto`` and None are found from the format and the shape.

    ``units`` is ``auto``, ``mm``, ``cm``, ``m`` or ``inch``; ``scale``, in millimetres per unit of
    the file, overrides it. ``up`` and ``front`` are ``auto`` or a direction of the file such as
    ``+y``; ``rotation_file_to_rig``, three rows, says the same of a scan that stands askew.
    ``nose_tip``, ``left_eye`` and ``right_eye``, in the file's coordinates, show the face: its
    tip and the outer corners of the subject's eyes. ``subject`` is ``head``, or ``object`` for
    anything else, which is then taken to stand in the rig frame, in millimetres, unless its
    format says otherwise.
    """

    units: str = "auto"
    scale: float | None = None
    up: str = "auto"
    front: str = "auto"
    subject: str = "head"
    rotation_file_to_rig: tuple[Triple, Triple, Triple] | None = None
    nose_tip: Triple | None = None
    left_eye: Triple | None = None
    right_eye: Triple | None = None

    def __post_init__(self) -> None:
        directions = ("auto", *DIRECTIONS)
        for name, value, known in (
            ("units", self.units, ("auto", *MM_PER_UNIT)),
            ("up", self.up, directions),
            ("front", self.front, directions),
            ("subject", self.subject, ("head", "object")),
        ):
            if value not in known:
                raise InputError(
                    f"scan-{name}", f"{name} {value!r} is not known", f"give {', '.join(known)}"
                )
        if self.scale is not None and not 0.0 < self.scale < np.inf:
            raise InputError(
                "scan-scale", f"a scale of {self.scale} makes no sense", "give mm per file unit"
            )
        if "auto" not in (self.up, self.front):
            Axes(self.up, self.front)
        self._check_face()

    def _check_face(self) -> None:
        marks = (self.nose_tip, self.left_eye, self.right_eye)
        ways = (
            (self.up, self.front) != ("auto", "auto"),
            self.rotation_file_to_rig is not None,
            self.left_eye is not None or self.right_eye is not None,
        )
        if sum(ways) > 1:
            raise InputError(
                "scan-frame",
                "the scan's frame is given in more than one way",
                "give up and front, or rotation_file_to_rig, or the nose tip and eyes",
            )
        if ways[2] and None in marks:
            raise InputError(
                "scan-landmarks",
                "of nose_tip, left_eye and right_eye one is missing",
                "give all three, in the file's coordinates; or the nose tip alone",
            )
        if self.nose_tip is not None and not ways[2] and not any(ways[:2]):
            raise InputError(
                "scan-landmarks",
                "a nose tip alone does not say how the head stands",
                "give left_eye and right_eye too, or up and front, or rotation_file_to_rig",
            )
        if ways[2]:
            nose, left, right = (np.array(mark, dtype=np.float64) for mark in marks)
            area = np.linalg.norm(np.cross(left - nose, right - nose))
            if not area > 0.05 * float(np.linalg.norm(left - right)) ** 2:
                raise InputError(
                    "scan-landmarks",
                    "nose_tip, left_eye and right_eye lie in line",
                    "give the nose tip and the outer corners of the subject's eyes",
                )
        if self.rotation_file_to_rig is not None:
            nearest_rotation(np.array(self.rotation_file_to_rig, dtype=np.float64))

    @property
    def rotation(self) -> Floats | None:
        """The rotation to the rig frame (3, 3) that is given in full, None without."""
        if self.rotation_file_to_rig is not None:
            return nearest_rotation(np.array(self.rotation_file_to_rig, dtype=np.float64))
        if "auto" in (self.up, self.front):
            return None
        return Axes(self.up, self.front).rotation_file_to_rig
