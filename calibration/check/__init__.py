"""New images against a stored calibration: which camera moved, and how small a movement shows."""

from calibration.check.checking import CheckOptions, check
from calibration.check.verdicts import CheckResult, Finding, Kind, Light

__all__ = ["check", "CheckOptions", "CheckResult", "Finding", "Kind", "Light"]
