"""What a calibration returns. Frozen; it carries its own quality."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from calibration.adjustment.camera import INTERIOR, PER_CAMERA, CalibratedCamera
from calibration.adjustment.components import Component
from calibration.adjustment.covariance import Covariance
from calibration.adjustment.levenberg import Stop
from calibration.adjustment.noise import NoiseModel
from calibration.adjustment.reliability import Reliability
from calibration.adjustment.residualgrid import GridCell
from calibration.observations import TargetSet
from geometry.arrays import Floats, Ints, frozen

DOUBTFUL_FOCAL_SHARE = 0.005
"""A focal length less certain than this share of it is not to be used: depths of a face 100 mm deep
are wrong by the same share, half a millimetre, five times what a rig is for."""


@dataclass(frozen=True, eq=False)
class CarrierPose:
    """Where a carrier stood: in ``frame``, or in all of them when it is None.

    ``X_rig = rotation_carrier_to_rig x + position_rig_mm``.
    """

    carrier: str
    frame: str | None
    position_rig_mm: Floats
    rotation_carrier_to_rig: Floats


@dataclass(frozen=True)
class CameraQuality:
    """One camera in its calibration.

    ``points`` image points used, ``rejected`` left out; ``rms_px`` of their residuals,
    ``bias_px`` their mean (x, y); ``sigma_factor`` of the stated sigma as the residuals show it;
    ``redundancy`` mean of its redundancy numbers; ``coverage`` share of a 5 x 5 grid of the image
    with points in it. ``focal_sigma_px``, ``centre_sigma_px`` (principal point),
    ``position_sigma_mm``, ``rotation_sigma_deg``: root mean squares of their axes, 1 sigma.
    ``grid``: residuals over the image.
    """

    name: str
    points: int
    rejected: int
    rms_px: float
    bias_px: tuple[float, float]
    sigma_factor: float
    redundancy: float
    coverage: float
    focal_sigma_px: float
    centre_sigma_px: float
    position_sigma_mm: float
    rotation_sigma_deg: float
    grid: tuple[GridCell, ...]


def doubtful_lenses(
    cameras: tuple[CalibratedCamera, ...], table: tuple[CameraQuality, ...]
) -> tuple[str, ...]:
    """Names of cameras whose focal length is too uncertain to be used."""
    return tuple(
        camera.name
        for camera, row in zip(cameras, table, strict=True)
        if row.focal_sigma_px > DOUBTFUL_FOCAL_SHARE * camera.interior.focal_length_px
    )


@dataclass(frozen=True)
class WeakParameter:
    """A parameter that rests on its prior: ``prior_share`` of what is known of it comes there."""

    camera: str
    parameter: str
    sigma: float
    prior_share: float


@dataclass(frozen=True)
class Correlation:
    """Two parameters of one camera that the images can hardly tell apart."""

    camera: str
    first: str
    second: str
    value: float


@dataclass(frozen=True)
class CrossValidation:
    """Two calibrations from two halves: their difference against its predicted sigma.

    ``ratio`` is near 1 when the predicted covariance can be believed; ``halves`` says how the
    observations were split.
    """

    ratio: float
    halves: str


@dataclass(frozen=True)
class LateView:
    """A camera's picture in one frame that was taken at another moment than the others'."""

    camera: str
    frame: str


@dataclass(frozen=True)
class CalibrationQuality:
    """How an adjustment went.

    ``rejected`` image points failed their test, those of ``late_views`` among them; ``dropped``
    ones could not be used from the start. ``chi2`` over ``dof`` with the sigmas in use (after any
    correction); ``components`` factors of stated sigmas by group. ``scale`` says where the size
    comes from. ``warnings``: one sentence each, the most important first. ``unfit_lenses``: cameras
    whose lenses another model describes better; do not use the result.
    """

    converged: bool
    stop: Stop
    iterations: int
    chi2: float
    dof: int
    rms_px: float
    rejected: int
    late_views: tuple[LateView, ...]
    dropped: int
    cameras: tuple[CameraQuality, ...]
    components: tuple[Component, ...]
    weak: tuple[WeakParameter, ...]
    correlations: tuple[Correlation, ...]
    cross_validation: CrossValidation | None
    scale: str
    warnings: tuple[str, ...]
    unfit_lenses: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class ResidualTable:
    """What each image point says.

    ``rows`` (n,) in the observations, ``residual_px`` (n, 2) observed less computed, and its
    reliability. ``rejected`` (r,) are rows that failed their test.
    """

    rows: Ints
    residual_px: Floats
    reliability: Reliability
    rejected: Ints


@dataclass(frozen=True, eq=False)
class Calibration:
    """Calibrated cameras, targets, and the covariance of both.

    ``target_mm`` (m, 3) in carrier frames, NaN for targets that were not seen.
    ``covariance`` is in the datum named by ``datum``; it covers cameras and targets in the order
    of ``cameras`` and ``targets.ids``. ``noise`` corrects stated sigmas of image points, camera by
    camera. ``residuals`` is None after reading from a file. ``blur_px`` (cameras,): how sharp the
    targets were, NaN where that is not known.
    """

    cameras: tuple[CalibratedCamera, ...]
    targets: TargetSet
    target_mm: Floats
    places: tuple[CarrierPose, ...]
    covariance: Covariance
    noise: NoiseModel
    datum: str
    quality: CalibrationQuality
    residuals: ResidualTable | None = None
    blur_px: Floats = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        blur = self.blur_px if len(self.blur_px) else np.full(len(self.cameras), np.nan)
        object.__setattr__(self, "blur_px", frozen(blur))
        object.__setattr__(self, "target_mm", frozen(self.target_mm))

    @property
    def doubtful_lenses(self) -> tuple[str, ...]:
        """Names of cameras whose focal length is too uncertain to be used."""
        return doubtful_lenses(self.cameras, self.quality.cameras)

    def camera(self, name: str) -> CalibratedCamera:
        """One camera by its name; KeyError when there is none."""
        return {c.name: c for c in self.cameras}[name]

    def centre_covariance_mm2(self, index: int) -> Floats:
        """Covariance (3, 3) of a projection centre in the datum."""
        return self.covariance.camera(index)[INTERIOR : INTERIOR + 3, INTERIOR : INTERIOR + 3]

    def length_mm(self, first: str, second: str) -> tuple[float, float]:
        """Distance of two targets of one carrier and its sigma, mm."""
        ids = self.targets.ids
        a, b = ids.index(first), ids.index(second)
        direction = self.target_mm[b] - self.target_mm[a]
        rows = np.zeros((1, len(ids), 3))
        length = float(np.linalg.norm(direction))
        rows[0, b], rows[0, a] = direction / length, -direction / length
        nothing = np.zeros((1, PER_CAMERA * len(self.cameras)))
        return length, float(np.sqrt(self.covariance.of_functions(nothing, rows)[0, 0]))
