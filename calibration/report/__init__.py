"""Self-contained pages: a calibration, a check, and how checks drift over time."""

from calibration.report.history import History, history_of, history_svg
from calibration.report.pages import calibration_page, check_page, history_page
from calibration.report.views import DetectionView, detection_views

__all__ = [
    "calibration_page",
    "check_page",
    "detection_views",
    "DetectionView",
    "History",
    "history_of",
    "history_page",
    "history_svg",
]
