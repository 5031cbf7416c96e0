"""A start from images alone, or from cameras that are near the truth."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calibration.adjustment.build import Start, build, camera_poses
from calibration.adjustment.camera import CalibratedCamera, Interior
from calibration.adjustment.finite import finite_rows
from calibration.adjustment.initialisation.carrierposes import Placing, place_carriers, row_rays
from calibration.adjustment.initialisation.chain import LocatedView, chain, located_views
from calibration.adjustment.initialisation.frame import as_cameras, to_start, upright
from calibration.adjustment.initialisation.interiors import start_interiors
from calibration.adjustment.initialisation.lenses import as_lens
from calibration.adjustment.initialisation.relative import Scene, relative_chain
from calibration.adjustment.initialisation.resection import RigidTransform
from calibration.adjustment.initialisation.scale import knows_size, size_of
from calibration.adjustment.initialisation.views import Placements, View, nominal_points, views_of
from calibration.adjustment.model import project
from calibration.adjustment.options import CalibrationOptions
from calibration.observations import Observations
from common.errors import InputError
from geometry.arrays import Floats
from geometry.camera import LensModel
from geometry.frames import Pose

NEAR_SHARE = 0.02
"""Start cameras are good enough when half the points fall this near, as a share of f."""


@dataclass(frozen=True, eq=False)
class _Scenery:
    """What every way to a start needs."""

    observations: Observations
    placements: Placements
    views: tuple[View, ...]
    nominal_mm: Floats
    interiors: tuple[Interior, ...]
    normalised: Floats
    located_views: tuple[LocatedView, ...]

    @property
    def focal_px(self) -> Floats:
        return np.array([i.focal_length_px for i in self.interiors])

    def placing(self, poses: dict[int, RigidTransform]) -> Placing:
        """Carriers and targets with the cameras in these poses."""
        seen = self.observations
        rays = row_rays(poses, seen.camera, self.normalised, self.placements, seen.target)
        return place_carriers(
            poses,
            self.located_views,
            rays,
            self.placements,
            self.nominal_mm,
            seen.targets.carrier_of,
            self.focal_px,
        )

    def cameras(self) -> tuple[CalibratedCamera, ...]:
        """Cameras with their interiors, all at the origin."""
        nowhere = Pose(np.zeros(3), np.eye(3))
        seen = self.observations
        return tuple(
            CalibratedCamera(name, (int(size[0]), int(size[1])), interior, nowhere)
            for name, size, interior in zip(
                seen.cameras, seen.image_size_px, self.interiors, strict=True
            )
        )


def find_start(observations: Observations, options: CalibrationOptions) -> Start:
    """Where the adjustment starts.

    Start cameras are used as they stand when most points fall near their images; otherwise, or
    without any, the poses are found from the images. Raises :class:`InputError` when cameras
    cannot be joined or their focal lengths not be found.
    """
    scenery = _scenery(observations, options)
    near = _ordered(observations, options)
    if near:
        if options.lens is not None:
            near = tuple(
                replace(c, interior=i) for c, i in zip(near, scenery.interiors, strict=True)
            )
        poses = camera_poses(near)
        start = build(observations, near, scenery.placements, scenery.placing(poses), options)
        if median_misfit_px(start) < NEAR_SHARE * float(scenery.focal_px.min()):
            return start
    poses = _from_images(scenery)
    if near:
        poses = to_start(poses, near, scaled=not knows_size(observations))
    else:
        poses = upright(poses, _middle(scenery, poses))
    cameras = as_cameras(poses, scenery.cameras())
    return build(observations, cameras, scenery.placements, scenery.placing(poses), options)


def median_misfit_px(start: Start) -> float:
    """Median misfit of a start's image points, pixels; infinite without any."""
    if len(start.rows) == 0:
        return float("inf")
    pixel, depth = project(start.state, start.network.observed)
    residual = np.linalg.norm(start.network.pixel - pixel, axis=1)
    return float(np.median(np.where(depth > 0.0, residual, np.inf)))


def _ordered(
    observations: Observations, options: CalibrationOptions
) -> tuple[CalibratedCamera, ...]:
    """The start's cameras in the order of the observations; all of them, or none given."""
    given = {c.name: c for c in options.start}
    missing = [name for name in observations.cameras if name not in given]
    if given and missing:
        raise InputError(
            "calibration-start",
            f"the start has no camera {missing[0]!r}; it has {', '.join(sorted(given))}",
            "name the cameras alike in the start and in the images",
        )
    return tuple(given[name] for name in observations.cameras) if given else ()


def _scenery(observations: Observations, options: CalibrationOptions) -> _Scenery:
    placements = Placements.of(observations)
    views, nominal = views_of(observations, placements), nominal_points(observations)
    sizes = dict(zip(observations.cameras, observations.image_size_px, strict=True))
    given = {c.name: c.interior for c in options.start} | dict(options.interiors)
    known = {
        name: interior if options.lens is None else as_lens(interior, options.lens, sizes[name])
        for name, interior in given.items()
        if name in sizes
    }
    if all(name in known for name in observations.cameras):
        interiors = tuple(known[name] for name in observations.cameras)
    else:
        lens = options.lens or LensModel.BROWN
        interiors = start_interiors(observations, views, nominal, lens)
    normalised = np.empty_like(observations.pixel)
    for k, interior in enumerate(interiors):
        own = observations.camera == k
        normalised[own] = interior.normalised(observations.pixel[own])
    found = located_views(views, observations.target, normalised, nominal)
    return _Scenery(observations, placements, views, nominal, interiors, normalised, found)


def _from_images(scenery: _Scenery) -> dict[int, RigidTransform]:
    """Poses of all cameras from images, in the size that the targets give."""
    poses = chain(scenery.located_views, scenery.focal_px)
    count = len(scenery.interiors)
    if len(poses) == count:
        return poses
    seen = scenery.observations
    keys = np.stack([scenery.placements.of_row, seen.target], axis=1)
    pairs, point = np.unique(keys, axis=0, return_inverse=True)
    scene = Scene(seen.camera, point.reshape(-1), scenery.normalised, scenery.focal_px)
    other = relative_chain(scene)
    if len(other) == count:
        scale = size_of(scene.points(other), pairs[:, 0], pairs[:, 1], seen.targets)
        return {k: RigidTransform(p.rotation, scale * p.translation_mm) for k, p in other.items()}
    joined = poses if len(poses) >= len(other) else other
    alone = [name for k, name in enumerate(seen.cameras) if k not in joined]
    raise InputError(
        "calibration-not-joined",
        f"camera {alone[0]!r} sees too little of what the other cameras see to be joined to them",
        "show a plate or targets to several cameras at once, so that all hang together",
    )


def _middle(scenery: _Scenery, poses: dict[int, RigidTransform]) -> Floats:
    """The middle of what the cameras see, in the world of the poses."""
    placing = scenery.placing(poses)
    translations = [p.rotation @ m + p.translation_mm for p, m in _placed_middles(placing, scenery)]
    return np.median(np.stack(translations), axis=0) if translations else np.zeros(3)


def _placed_middles(placing: Placing, scenery: _Scenery) -> list[tuple[RigidTransform, Floats]]:
    out = []
    carrier_of = scenery.observations.targets.carrier_of
    for k, placed in enumerate(placing.placed):
        own = placing.target_mm[carrier_of == scenery.placements.carrier[k]]
        own = own[finite_rows(own)]
        if placed is not None and len(own):
            out.append((placed, own.mean(axis=0)))
    return out
