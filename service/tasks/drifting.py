"""How a rig has drifted: all checks against one calibration, on one page."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from calibration.files import CHECKS
from calibration.report import history_of, history_page


def drift_page(checks: Iterable[Path], reference: str) -> str:
    """A page (HTML) of the checks in the files ``checks`` against the calibration ``reference``.

    Raises :class:`~common.errors.InputError` for a file that is no check.
    """
    return history_page(history_of([CHECKS.read(path) for path in checks], reference))
