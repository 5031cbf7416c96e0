"""A rig tried on a head: photographed in the simulated studio, reconstructed, compared."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from common.errors import InputError
from common.progress import (
    CancelToken,
    NeverCancelled,
    Progress,
    ProgressCallback,
    go_on,
    ignore_progress,
    within,
)
from evaluation.comparison.comparing import Comparison, Within, compare
from evaluation.comparison.distances import Reference
from evaluation.reconstruction.reconstructing import (
    Reconstruction,
    ReconstructionOptions,
    reconstruct,
)
from evaluation.reconstruction.views import view_of
from evaluation.trial.regions import RegionFigures, region_figures
from evaluation.trial.seen import seen_by_two
from geometry.arrays import Floats
from geometry.camera import RigCamera
from geometry.raycast import Occluder
from rig.acquisition.cameras.base import Image
from rig.simulation.settings import SceneSettings
from rig.simulation.studio import Shot, Studio

EXPOSURES = {"dark": 0.25, "right": 1.0, "over": 2.5}
"""Times the exposure that fills the sensor's wells with a white card: two stops less, 1.3 more."""

PHOTOGRAPHED, RECONSTRUCTED = 0.55, 0.9
"""How far the work has come: pictures of a studio take longest."""

SAMPLE_MM = 0.5

Photographer = Callable[
    [Studio, Sequence[Shot], ProgressCallback, CancelToken | None], Sequence[Image]
]
"""Takes a picture for each shot of a studio's head."""


def by_the_studio(
    studio: Studio,
    shots: Sequence[Shot],
    progress: ProgressCallback = ignore_progress,
    cancel: CancelToken | None = None,
) -> list[Image]:
    """Pictures by the studio's own renderer."""
    stop = cancel or NeverCancelled()
    images = []
    for number, shot in enumerate(shots):
        go_on(stop)
        progress(Progress("photographing", number / len(shots)))
        images.append(studio.photograph(shot))
    return images


@dataclass(frozen=True, eq=False)
class Trial:
    """What came of it. ``truth`` is the very surface that was photographed.

    ``comparison`` is about what lies within the radius of the nose's tip; its completeness is
    about what two cameras see there, ``seen_percent`` of that surface.
    """

    reconstruction: Reconstruction
    truth: Reference
    nose_tip_mm: Floats
    comparison: Comparison
    regions: tuple[RegionFigures, ...]
    seen_percent: float


def try_rig(
    cameras: Sequence[RigCamera],
    scene: SceneSettings,
    *,
    exposure: str = "right",
    radius_mm: float = 95.0,
    options: ReconstructionOptions | None = None,
    photographer: Photographer = by_the_studio,
    progress: ProgressCallback = ignore_progress,
    cancel: CancelToken | None = None,
) -> Trial:
    """Photograph the head of a scene with the cameras, reconstruct it, compare it.

    Poses and lenses are taken to be known. Raises :class:`InputError` where nothing of the head
    can be reconstructed, :class:`CancelledError` when told to stop.
    """
    stop = cancel or NeverCancelled()
    studio = Studio(cameras, scene)
    surface = studio.surface
    if surface is None:
        raise InputError("trial-head", "the scene has no head to measure", "give a head")
    exposure_us = EXPOSURES[exposure] * studio.sensor.reference_exposure_us
    shots = [
        Shot(name, exposure_us, seed=(1, number)) for number, name in enumerate(studio.cameras)
    ]
    photographing = within(progress, 0.0, PHOTOGRAPHED)
    images = photographer(studio, shots, photographing, stop)
    seeing = zip(images, studio.cameras.values(), strict=True)
    views = [view_of(image, camera) for image, camera in seeing]
    matching = within(progress, PHOTOGRAPHED, RECONSTRUCTED, "matching")
    chosen = options or ReconstructionOptions()
    done = reconstruct(views, options=chosen, progress=matching, cancel=stop)
    progress(Progress("comparing", RECONSTRUCTED))
    truth = Reference(surface.vertices_mm, surface.faces)
    return judged(done, truth, cameras, radius_mm)


def judged(
    done: Reconstruction, truth: Reference, cameras: Sequence[RigCamera], radius_mm: float
) -> Trial:
    """A reconstruction against the surface that its pictures show, about the nose's tip."""
    # Cameras stand at negative Y before the face: its foremost point is the tip of the nose.
    nose = truth.vertices_mm[np.argmin(truth.vertices_mm[:, 1])]
    ball = Within((float(nose[0]), float(nose[1]), float(nose[2])), radius_mm)
    places, face = truth.sampled(SAMPLE_MM)
    inside = ball.of(places)
    places, face = places[inside], face[inside]
    occluder = Occluder(truth.vertices_mm, truth.faces)
    seen = seen_by_two(places, occluder.face_normals(face), cameras, occluder)
    if not seen.any():
        raise InputError(
            "trial-unseen",
            f"no part of the head within {radius_mm:g} mm of its nose is seen by two cameras",
            "check that the design was made for this head",
        )
    near = ball.of(done.cloud.points_mm)
    found = compare(done.cloud.points_mm[near], truth, places_mm=places[seen])
    kept = done.cloud.sigma_mm[near][found.kept]
    regions = region_figures(found.points_mm, found.distances_mm, kept, nose)
    return Trial(done, truth, nose, found, regions, float(100.0 * seen.mean()))
