"""Files of the calibration floor: strict at the edge, lossless, written whole or not at all."""

from calibration.files.calibrationfile import SCHEMA, read_calibration, write_calibration
from calibration.files.checkfile import read_check, write_check

__all__ = ["SCHEMA", "read_calibration", "read_check", "write_calibration", "write_check"]
