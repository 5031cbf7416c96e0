"""What a structure weighs, piece by piece, and where."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from geometry.arrays import Floats, frozen
from geometry.camera import RigCamera
from rig.build.mounts.settings import CameraMount
from rig.build.mounts.structure import Structure
from rig.build.parts.bill import PRINT_DENSITY_G_PER_CM3
from rig.build.parts.masses import small_part_g
from rig.build.parts.screws import sized
from rig.catalogue import Catalogue


@dataclass(frozen=True)
class Masses:
    """What hangs on a structure. ``camera_kg``: of a camera whose mass the catalogue lacks."""

    catalogue: Catalogue
    camera_kg: float = 0.5

    def of_camera(self, camera: RigCamera) -> float:
        """A camera with its lens, kg."""
        known = self.published(camera)
        return self.camera_kg if known is None else known

    def published(self, camera: RigCamera) -> float | None:
        """The same as the catalogue has it; None where it does not say."""
        parts = self.catalogue.parts_of(camera.camera.name)
        known = [getattr(part, "mass_g", None) for part in parts or () if part.kind != "built-in"]
        if not known or any(mass is None for mass in known):
            return None
        return sum(float(mass or 0.0) for mass in known) / 1e3

    def of_part(self, part: str, length_mm: float | None = None) -> float:
        """A part of the catalogue, kg, a screw ``length_mm`` long; 0 where it is not known."""
        return float(small_part_g(part, length_mm, self.catalogue) or 0.0) / 1e3


@dataclass(frozen=True, eq=False)
class Weight:
    """Something that hangs on members: with a ``camera``, or at a ``joint``; the other is empty.

    ``at_mm`` (3,): its centre of mass.
    """

    at_mm: Floats
    mass_kg: float
    camera: str = ""
    joint: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "at_mm", frozen(self.at_mm))


def weights(
    structure: Structure, mounts: tuple[CameraMount, ...], masses: Masses
) -> Iterator[Weight]:
    """Cameras, heads, plates under them, wedges, and what joints are made with; no members."""
    names = {mount.name for mount in mounts}
    for mount in mounts:
        body = mount.camera.camera.body.centre_camera_mm
        at = mount.camera.pose.to_rig(body[None])[0]
        yield Weight(at, masses.of_camera(mount.camera), mount.name)
    for part in structure.parts:
        camera = part.camera if part.camera in names else ""
        yield Weight(
            part.rig_from_part[:3, 3], masses.of_part(part.part), camera,
            "" if camera else part.joint,
        )  # fmt: skip
    cameras = {wedge.id: wedge.camera for wedge in structure.wedges}
    for solid in structure.solids:
        if solid.kind == "wedge" and cameras.get(solid.owner) in names:
            mass = float(ConvexHull(solid.corners_mm).volume) * PRINT_DENSITY_G_PER_CM3 * 1e-6
            yield Weight(np.mean(solid.corners_mm, axis=0), mass, cameras[solid.owner])
    for joint in structure.joints:
        made = sized(joint, structure, masses.catalogue)
        mass = sum(masses.of_part(part, length) * n for part, length, n in made)
        yield Weight(joint.point_mm, mass, "", joint.id)
