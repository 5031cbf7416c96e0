"""From observations to calibrated cameras: one bundle adjustment with its full covariance."""

from calibration.adjustment.bundle import calibrate
from calibration.adjustment.camera import CalibratedCamera, Interior
from calibration.adjustment.options import CalibrationOptions, InteriorModel, ReferencePoses
from calibration.adjustment.result import Calibration, CalibrationQuality

__all__ = [
    "calibrate",
    "CalibratedCamera",
    "Calibration",
    "CalibrationOptions",
    "CalibrationQuality",
    "Interior",
    "InteriorModel",
    "ReferencePoses",
]
