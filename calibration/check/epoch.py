"""New observations put beside the reference: who saw what, by the reference's indices."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from calibration.adjustment.finite import finite_rows
from calibration.adjustment.initialisation.views import Placements
from calibration.adjustment.result import Calibration
from calibration.check.messages import why_of_size
from calibration.check.reference import Reference
from calibration.observations import Observations
from common.errors import InputError
from geometry.arrays import Bools, Floats, Ints

LEAST_CAMERAS = 2


@dataclass(frozen=True, eq=False)
class Epoch:
    """A new epoch in the reference's terms.

    Rows: ``camera``, ``target`` (indices of the used targets), ``place``, ``view`` (n,),
    ``pixel``, ``sigma_px`` (n, 2). A view is one camera's sight of one placed carrier:
    ``view_camera``, ``view_place`` (v,). Places: ``place_carrier``, ``place_frame`` (k,) with -1
    for carriers that stand still, ``moving`` (k,). Targets: ``target_index`` (m,) in the
    reference, ``target_carrier`` (m,).
    """

    reference: Reference
    camera_names: tuple[str, ...]
    image_size_px: tuple[tuple[int, int], ...]
    carrier_names: tuple[str, ...]
    target_names: tuple[str, ...]
    frame_names: tuple[str, ...]
    camera: Ints
    target: Ints
    place: Ints
    view: Ints
    pixel: Floats
    sigma_px: Floats
    view_camera: Ints
    view_place: Ints
    place_carrier: Ints
    place_frame: Ints
    target_carrier: Ints
    target_index: Ints
    unknown_rows: int

    @property
    def moving(self) -> Bools:
        """Which places belong to carriers that move between frames, (k,)."""
        return self.place_frame >= 0

    @property
    def points(self) -> Ints:
        """The point in space of each row: one number for each target at each place, (n,)."""
        return self.place * len(self.target_names) + self.target

    def with_rows(self, keep: Bools) -> Epoch:
        """With some of the rows only; views, places and targets are kept."""
        return replace(
            self,
            camera=self.camera[keep],
            target=self.target[keep],
            place=self.place[keep],
            view=self.view[keep],
            pixel=self.pixel[keep],
            sigma_px=self.sigma_px[keep],
        )

    def with_pixels(self, pixel: Floats, reference: Reference) -> Epoch:
        """The same sights with other measurements, against another draw of the reference."""
        return replace(self, pixel=pixel, reference=reference)


def epoch_of(calibration: Calibration, observations: Observations) -> Epoch:
    """Observations in the reference's terms.

    Raises :class:`InputError` when cameras or targets are not the reference's.
    """
    cameras = _cameras(calibration, observations)
    targets, known = _targets(calibration, observations)
    keep = known[observations.target]
    if not keep.any():
        raise InputError(
            "check-no-targets",
            "none of the targets in the images is in the reference calibration",
            "show the targets that the reference was made with, or calibrate anew",
        )
    seen = observations.subset(np.flatnonzero(keep))
    _inside(seen)
    placements = Placements.of(seen)
    camera, original = cameras[seen.camera], targets[seen.target]
    index, target = np.unique(original, return_inverse=True)
    pairs = np.stack([camera, placements.of_row], axis=1)
    views, view = np.unique(pairs, axis=0, return_inverse=True)
    names = calibration.targets.ids
    return Epoch(
        Reference.of(calibration, index),
        tuple(c.name for c in calibration.cameras),
        tuple(c.image_size_px for c in calibration.cameras),
        tuple(c.name for c in seen.targets.carriers),
        tuple(names[int(k)] for k in index),
        observations.frames,
        camera,
        target.reshape(-1).astype(np.int64),
        placements.of_row,
        view.reshape(-1).astype(np.int64),
        seen.pixel,
        calibration.noise.sigmas_px(seen.sigma_px, camera),
        views[:, 0],
        views[:, 1],
        placements.carrier,
        placements.frame,
        _carriers(calibration, seen, index),
        index,
        int((~keep).sum()),
    )


def require_known(calibration: Calibration, cameras: Iterable[str]) -> None:
    """Raises :class:`InputError` when a camera is not the reference's."""
    known = [c.name for c in calibration.cameras]
    strange = [name for name in cameras if name not in known]
    if strange:
        raise InputError(
            "check-camera-unknown",
            f"camera {strange[0]!r} is not in the reference; it has {', '.join(known)}",
            "name the cameras as in the reference, or calibrate anew",
        )


def _cameras(calibration: Calibration, observations: Observations) -> Ints:
    """The reference's index of each camera."""
    require_known(calibration, observations.cameras)
    known = {c.name: k for k, c in enumerate(calibration.cameras)}
    used = np.unique(observations.camera)
    if len(used) < LEAST_CAMERAS:
        raise InputError(
            "check-one-camera",
            f"{len(used)} camera saw targets; a check compares cameras with one another",
            "take pictures with all cameras of the rig",
        )
    for k in used:
        camera = calibration.cameras[known[observations.cameras[int(k)]]]
        size = tuple(int(v) for v in observations.image_size_px[int(k)])
        if size == camera.image_size_px[::-1]:
            raise InputError(
                "check-image-turned",
                f"the images of camera {camera.name!r} are turned by 90 degrees against the "
                f"reference: {size[0]} x {size[1]} px, not {size[1]} x {size[0]}",
                "turn the camera or its pictures back",
            )
        if size != camera.image_size_px:
            raise InputError(
                "check-image-size",
                f"camera {camera.name!r} has images of {size[0]} x {size[1]} px, in the reference "
                f"{camera.image_size_px[0]} x {camera.image_size_px[1]}, "
                f"{why_of_size((size[0], size[1]), camera.image_size_px)}",
                "use the same image size and crop as for the reference",
            )
    return np.array([known[name] for name in observations.cameras])


def _targets(calibration: Calibration, observations: Observations) -> tuple[Ints, Bools]:
    """The reference's index of each target, and whether it has one with coordinates."""
    known = {name: k for k, name in enumerate(calibration.targets.ids)}
    index = np.array([known.get(name, -1) for name in observations.targets.ids])
    there = finite_rows(calibration.target_mm)
    return index, (index >= 0) & there[index]


def _carriers(calibration: Calibration, seen: Observations, index: Ints) -> Ints:
    """The carrier of each used target, after the new observations' list."""
    carrier_of = dict(zip(seen.targets.ids, seen.targets.carrier_of.tolist(), strict=True))
    names = calibration.targets.ids
    return np.array([carrier_of[names[int(k)]] for k in index], dtype=np.int64)


def _inside(observations: Observations) -> None:
    size = observations.image_size_px[observations.camera]
    outside = (observations.pixel < -0.5) | (observations.pixel > size - 0.5)
    if outside.any():
        row = int(np.flatnonzero(outside.any(axis=1))[0])
        name = observations.cameras[int(observations.camera[row])]
        raise InputError(
            "check-pixel-outside",
            f"camera {name!r} has a target outside its image",
            "give pixels of the full image, not of a crop or a smaller copy",
        )
