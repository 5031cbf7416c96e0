"""The ``[[start]]`` and ``[[fixed]]`` sections: poses that are given."""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from annotated_types import Len
from pydantic import AfterValidator, Field, model_validator

from common.errors import InputError
from common.files.strict import CameraName, Matrix, StrictModel
from geometry.camera import Camera, RigCamera
from geometry.frames import Pose
from geometry.rotations import nearest_rotation
from rig.specification.sections.camera import CameraSection
from rig.specification.sections.plausible import FocusMm, Plausible, Position, place_of_size

Angles = Annotated[
    list[Annotated[float, Plausible(0.0, 720.0, 90.0, "degrees", signed=True)]], Len(3, 3)
]
StandingPlace = Annotated[Position, AfterValidator(place_of_size)]
ORIENTATIONS = ("omega_phi_kappa_deg", "rotation_rig_to_camera", "look_at_mm")


class PoseSection(StrictModel):
    """Where a camera stands and where it looks, said in exactly one of three ways."""

    position_mm: StandingPlace = Field(description="Projection centre in the rig frame.")
    omega_phi_kappa_deg: Angles | None = Field(default=None, description="Photogrammetric angles.")
    rotation_rig_to_camera: Matrix | None = Field(
        default=None, description="Rotation matrix, rows are the camera's x, y and z axes."
    )
    look_at_mm: Position | None = Field(
        default=None, description="Point the camera looks at, with a level image."
    )

    @model_validator(mode="after")
    def _one_orientation(self) -> Self:
        if sum(getattr(self, key) is not None for key in ORIENTATIONS) != 1:
            raise ValueError(f"give exactly one of {', '.join(ORIENTATIONS)}")
        return self

    def to_pose(self) -> Pose:
        """The pose; raises :class:`InputError` when the matrix is not a rotation."""
        position = np.array(self.position_mm)
        if self.omega_phi_kappa_deg is not None:
            return Pose.from_omega_phi_kappa(position, np.array(self.omega_phi_kappa_deg))
        if self.rotation_rig_to_camera is not None:
            return Pose(position, nearest_rotation(np.array(self.rotation_rig_to_camera)))
        return Pose.looking_at(position, np.array(self.look_at_mm))


class StartSection(PoseSection):
    """A pose to start from."""

    @classmethod
    def from_pose(cls, pose: Pose) -> Self:
        """The section that describes ``pose``."""
        return cls(
            position_mm=pose.position_rig_mm.tolist(),
            rotation_rig_to_camera=pose.rotation_rig_to_camera.tolist(),
        )


class FixedSection(PoseSection):
    """A camera of an existing rig, which a design leaves where it is."""

    name: CameraName = Field(description="What to call this camera.")
    focus_mm: FocusMm | None = Field(
        default=None,
        description="Focus setting. Without it: the camera's own, or the distance to `look_at_mm`.",
    )
    camera: CameraSection | None = Field(
        default=None, description="Its own kind of camera; without it the rig's."
    )

    def to_rig_camera(self, rig_camera: Camera) -> RigCamera:
        """The camera in its place."""
        camera = self.camera.to_camera() if self.camera is not None else rig_camera
        focus = self.focus_mm or camera.focus_distance_mm
        if focus is None and self.look_at_mm is not None:
            focus = float(np.linalg.norm(np.subtract(self.look_at_mm, self.position_mm)))
        if focus is None:
            raise InputError(
                "key-missing", f"fixed camera {self.name!r} has no focus setting", "give focus_mm"
            )
        if focus < camera.min_focus_distance_mm:
            raise InputError(
                "value",
                f"fixed camera {self.name!r} is focused at {focus:g} mm, nearer than the "
                f"{camera.min_focus_distance_mm:g} mm it can",
                "give a greater focus_mm",
            )
        return RigCamera(self.name, camera, self.to_pose(), focus, fixed=True)

    @classmethod
    def from_rig_camera(cls, fixed: RigCamera) -> Self:
        """The section that describes ``fixed``."""
        return cls(
            name=fixed.name,
            position_mm=fixed.pose.position_rig_mm.tolist(),
            rotation_rig_to_camera=fixed.pose.rotation_rig_to_camera.tolist(),
            focus_mm=fixed.focus_distance_mm,
            camera=CameraSection.from_camera(fixed.camera),
        )
