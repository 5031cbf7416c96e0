"""Files of the calibration floor: strict at the edge, lossless, written whole or not at all.

``CHECKS`` and ``ACCEPTANCES`` write, read and parse one record each.
"""

from calibration.files.calibrationfile import (
    CalibrationRecord,
    calibration_document,
    calibration_from,
    read_calibration,
    write_calibration,
)
from calibration.files.records import ACCEPTANCES, CHECKS, AcceptanceRecord, CheckRecord

__all__ = [
    "ACCEPTANCES",
    "AcceptanceRecord",
    "CHECKS",
    "CalibrationRecord",
    "CheckRecord",
    "calibration_document",
    "calibration_from",
    "read_calibration",
    "write_calibration",
]
