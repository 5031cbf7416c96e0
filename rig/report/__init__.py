"""The report: one self-contained page a person wants to look at."""

from rig.report.page import render_report

__all__ = ["render_report"]
