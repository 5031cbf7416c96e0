"""A few heads photographed and reconstructed in full: they set the error model, and check it."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from benchmarks.measured_faces import Head, Light, sight_of, smaller
from common.errors import InputError
from evaluation.recognition.faces import registered
from evaluation.recognition.recogniser import Recogniser, Template
from evaluation.reconstruction.reconstructing import ReconstructionOptions
from evaluation.trial.trying import try_rig
from geometry.arrays import Floats
from geometry.camera import RigCamera
from rig.simulation.settings import HeadSettings, SceneSettings

WIDTH_PX = 1000
ASSUMED = (("right", 0.2, 0.0), ("dark", 0.5, 0.3), ("over", 0.3, 0.1))
"""Light, sigma in pixels, share lost. One capture in the right light had 0.16 px."""

_FACE_MM = 80.0
_NEAR_MM = 1.0
_MOST_MM = 1.0


@dataclass(frozen=True, eq=False)
class FullCapture:
    """A capture reconstructed: ``sigma_px`` as the distances to the truth say, shares in percent.

    ``lost_share`` of what two cameras see within 80 mm of the nose has no point within 1 mm.
    """

    person: int
    light: str
    points_mm: Floats
    tip_mm: Floats
    sigma_mm: float
    sigma_px: float
    lost_share: float

    @property
    def line(self) -> str:
        """For whoever waits."""
        return (
            f"capture of person {self.person}, {self.light}: {len(self.points_mm):,} points, "
            f"{self.sigma_mm:.3f} mm, {self.sigma_px:.3f} px, lost {100 * self.lost_share:.1f} %"
        )

    def template(self, model: Recogniser) -> Template | None:
        """What recognition makes of it; None where it refuses."""
        try:
            face = registered(self.points_mm, self.tip_mm, np.eye(3))
            return model.template(face.depth_mm)
        except InputError:
            return None


def full_capture(head: Head, cameras: Sequence[RigCamera], light: str, person: int) -> FullCapture:
    """Photograph a head with small pictures, reconstruct it, compare it with the truth."""
    small = [smaller(camera, WIDTH_PX) for camera in cameras]
    placed = head.placed(np.random.default_rng([7, person]))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "head.ply"
        trimesh.Trimesh(placed.vertices_mm, placed.faces, process=False).export(path)
        settings = HeadSettings(scan=path, units="mm", up="+z", front="-y", subdivisions=1)
        try:
            done = try_rig(
                small,
                SceneSettings(head=settings),
                exposure=light,
                radius_mm=_FACE_MM,
                options=ReconstructionOptions(),
            )
        except InputError as error:
            print(f"person {person}, {light}: {error}", flush=True)
            return FullCapture(person, light, np.zeros((0, 3)), placed.tip_mm, np.nan, np.nan, 1.0)
    distances = done.comparison.distances_mm
    sigma = 1.4826 * float(np.median(np.abs(distances)))
    sight = sight_of(placed, small)
    seen = sight.views >= 2
    predicted = np.sqrt(
        np.einsum("ni,nij,nj->n", sight.normals, sight.covariance_mm2, sight.normals)[seen]
    )
    reached = dict(done.comparison.figures.reached_percent)
    nearest = min(reached, key=lambda r: abs(r - _NEAR_MM))
    return FullCapture(
        person,
        light,
        done.reconstruction.cloud.points_mm,
        done.nose_tip_mm,
        sigma,
        sigma / float(np.median(predicted)),
        1.0 - reached[nearest] / 100.0,
    )


def lights_of(captures: Sequence[FullCapture]) -> list[Light]:
    """The error model of each light: what the captures say on average, else what is assumed."""
    if not captures:
        return [Light(name, px, part, brightest=name == "over") for name, px, part in ASSUMED]
    out = []
    usual = [c for c in captures if c.light == "right"]
    base = float(np.mean([c.lost_share for c in usual])) if usual else 0.0
    for name, fallback, _ in ASSUMED:
        own = [c for c in captures if c.light == name and np.isfinite(c.sigma_px)]
        sigma = float(np.mean([c.sigma_px for c in own])) if own else fallback
        share = float(np.mean([c.lost_share for c in captures if c.light == name] or [base]))
        # What is lost in any light is lost at random places; the rest by brightness.
        extra = 0.0 if name == "right" else float(np.clip(share - base, 0.02, 0.95))
        out.append(Light(name, sigma, extra, brightest=name == "over"))
    return out
