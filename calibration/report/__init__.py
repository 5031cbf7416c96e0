"""Self-contained pages: a calibration, a check, and how checks drift over time."""

from calibration.report.history import History, history_of, history_svg
from calibration.report.pages import calibration_page, check_page, history_page

__all__ = [
    "calibration_page",
    "check_page",
    "History",
    "history_of",
    "history_page",
    "history_svg",
]
