"""Whether a calibrated rig measures lengths as well as it should."""

from calibration.acceptance.accepting import accept
from calibration.acceptance.certificate import Heading, certificate_pdf
from calibration.acceptance.lines import Acceptance, LengthLimit, MeasuredLength, Outcome, Volume

__all__ = [
    "accept",
    "Acceptance",
    "certificate_pdf",
    "Heading",
    "LengthLimit",
    "MeasuredLength",
    "Outcome",
    "Volume",
]
