"""How a calibration is to be made: which parameters are free, where it starts, what it uses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from calibration.adjustment.camera import CalibratedCamera, Interior
from calibration.adjustment.levenberg import LossOptions
from common.errors import InputError
from geometry.arrays import Floats
from geometry.camera import INTERIOR_NAMES, TERM_NAMES, LensModel

FREE = float("inf")
FIXED = 0.0

CENTRE_PX = 50.0
CENTRE_SHARE = 0.02
"""Principal points are taken to lie this near the middle: a share of the width, but not less
than so many pixels. A long lens all but leaves them open, and would let them run."""

RADIAL_SHARE = (0.3, 0.3, 0.1)
"""What k1, k2, k3 may each do at the corner of the image, as a share of its radius."""

TANGENTIAL_SHARE = 0.01

RATIONAL_SHARE = (1.0, 0.3, 0.1, 1.0, 0.3, 0.1)
"""The same for k1 to k6 of a rational lens. What one does others all but undo: the last are kept
small, so that of all ways to say the same the adjustment finds one."""

SHAPE_NAMES = ("f", "cx", "cy", "b1")
"""Interior parameters that lenses of all models have."""

NARROW = 0.35
"""Lenses whose corners are nearer to the axis than this (tangent; 19 degrees) need no k3: it could
not be told from k2 (correlation 0.99)."""


@dataclass(frozen=True)
class InteriorModel:
    """Sigma of each interior parameter about its start: 0 fixed, infinity free, else a prior.

    None takes a wide prior that only binds where images say nothing: the middle of the image for
    ``cx`` and ``cy``, no distortion for the others; k3 of narrow lenses is then fixed. f is in px,
    b1 without unit.
    """

    f: float = FREE
    cx: float | None = None
    cy: float | None = None
    k1: float | None = None
    k2: float | None = None
    p1: float | None = None
    p2: float | None = None
    k3: float | None = None
    b1: float = FIXED
    k4: float | None = None
    k5: float | None = None
    k6: float | None = None

    def __post_init__(self) -> None:
        given = [v for v in (getattr(self, n) for n in INTERIOR_NAMES[:-1]) if v is not None]
        if any(np.isnan(v) or v < 0.0 for v in given):
            raise InputError(
                "calibration-model",
                "a sigma of the camera model is negative or not a number",
                "give 0 for fixed, inf for free, or a positive sigma",
            )

    def sigmas(self, interior: Interior, size_px: tuple[int, int]) -> Floats:
        """Sigmas (13,) for a camera that starts with ``interior``; terms it lacks are held."""
        radius = float(np.hypot(*size_px) / 2.0 / interior.focal_length_px)
        middle = max(CENTRE_PX, CENTRE_SHARE * size_px[0])
        usual = {"cx": middle, "cy": middle} | _usual_terms(interior.lens_model, radius)
        known = {*SHAPE_NAMES, *TERM_NAMES[interior.lens_model]}
        given = {n: getattr(self, n) if n in known else FIXED for n in INTERIOR_NAMES}
        return np.array([usual[n] if given[n] is None else given[n] for n in INTERIOR_NAMES])


def _usual_terms(lens: LensModel, radius: float) -> dict[str, float]:
    """Sigmas of distortion terms where the corner is ``radius`` focal lengths from the axis."""
    tangential = {"p1": TANGENTIAL_SHARE / radius, "p2": TANGENTIAL_SHARE / radius}
    first, second, third = RADIAL_SHARE
    if lens is LensModel.RATIONAL:
        names = TERM_NAMES[lens][:2] + TERM_NAMES[lens][4:]
        powers = (2, 4, 6, 2, 4, 6)
        return tangential | {
            n: share / radius**p for n, share, p in zip(names, RATIONAL_SHARE, powers, strict=True)
        }
    terms = {"k1": first / radius**2, "k2": second / radius**4, "k3": third / radius**6}
    if lens is LensModel.FISHEYE:
        return terms | {"k4": third / radius**8}
    return tangential | terms | ({} if radius > NARROW else {"k3": FIXED})


@dataclass(frozen=True)
class ReferencePoses:
    """How well the start's camera poses are known, when they shall define the frame."""

    position_sigma_mm: float
    rotation_sigma_deg: float

    def __post_init__(self) -> None:
        if not (self.position_sigma_mm > 0.0 and self.rotation_sigma_deg > 0.0):
            raise InputError(
                "calibration-reference-poses",
                "the sigmas of reference poses must be positive",
                "give position_sigma_mm and rotation_sigma_deg above zero",
            )


@dataclass(frozen=True, eq=False)
class CalibrationOptions:
    """``start`` holds cameras near the truth, such as a design's, by the observations' names.

    ``interiors`` gives interior orientations alone, where poses are not known at all. ``model``
    serves all cameras but those named in ``models``. ``reference_poses`` makes the start's poses
    observations and so the datum; without it the network is free. ``lens``: the model of all
    lenses; None takes the start's, and Brown-Conrady from nothing. ``rescale``: whether the stated
    sigmas of image points may be corrected by what the residuals show. ``reject``: whether image
    points that fail Baarda's test are left out.
    """

    start: tuple[CalibratedCamera, ...] = ()
    interiors: Mapping[str, Interior] = field(default_factory=dict)
    model: InteriorModel = field(default_factory=InteriorModel)
    models: Mapping[str, InteriorModel] = field(default_factory=dict)
    reference_poses: ReferencePoses | None = None
    loss: LossOptions = field(default_factory=LossOptions)
    rescale: bool = True
    reject: bool = True
    cross_validate: bool = True
    lens: LensModel | None = None

    def __post_init__(self) -> None:
        if self.reference_poses is not None and not self.start:
            raise InputError(
                "calibration-reference-poses",
                "nothing gives the poses that are said to be known",
                "give the design, or leave out how well its poses are known",
            )

    def model_of(self, camera: str) -> InteriorModel:
        """The model of one camera."""
        return self.models.get(camera, self.model)
