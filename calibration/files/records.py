"""``check.json`` and ``acceptance.json``: one check, one acceptance test."""

from __future__ import annotations

from dataclasses import dataclass

from calibration.acceptance.lines import Acceptance
from calibration.check.verdicts import CheckResult
from calibration.files.recordfile import RecordFile


@dataclass(frozen=True)
class CheckRecord:
    """A check with the name of its reference and the time it was made, UTC as text (ISO 8601)."""

    reference: str
    made_utc: str
    result: CheckResult


@dataclass(frozen=True)
class AcceptanceRecord:
    """An acceptance test with the name of its calibration and its time, UTC as text (ISO 8601)."""

    calibration: str
    made_utc: str
    result: Acceptance


CHECKS = RecordFile("rigwright.check/1", CheckRecord)
ACCEPTANCES = RecordFile("rigwright.acceptance/1", AcceptanceRecord)
