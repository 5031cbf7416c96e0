"""Thin-lens optics: depth of field, ground sample distance, diffraction.

Distances are measured along the optical axis from the entrance pupil, which is taken as the
projection centre. The blur disk of a point at depth z with the lens focused at s is
``b = (f / N) (f / (s - f)) |z - s| / z`` (thin lens), so "b is at most c" is
``|z - s| <= k(s) z`` with ``k(s) = c N (s - f) / f**2``: no case distinction at the
hyperfocal distance is needed.
"""

from __future__ import annotations

import numpy as np

from geometry.arrays import Floats


def blur_ratio(
    focus_distance_mm: float, focal_length_mm: float, f_number: float, circle_of_confusion_mm: float
) -> float:
    """``k(s)``: how far a sharp point may lie from the focus, as a share of its own depth."""
    reach = focus_distance_mm - focal_length_mm
    return circle_of_confusion_mm * f_number * reach / focal_length_mm**2


def depth_of_field_mm(
    focus_distance_mm: float, focal_length_mm: float, f_number: float, circle_of_confusion_mm: float
) -> tuple[float, float]:
    """Near and far limit of sharpness; far is infinite beyond the hyperfocal distance."""
    k = blur_ratio(focus_distance_mm, focal_length_mm, f_number, circle_of_confusion_mm)
    near = focus_distance_mm / (1.0 + k)
    far = focus_distance_mm / (1.0 - k) if k < 1.0 else np.inf
    return near, far


def blur_disk_mm(
    depth_mm: Floats, focus_distance_mm: float, focal_length_mm: float, f_number: float
) -> Floats:
    """Diameter of the blur disk on the sensor for points at ``depth_mm`` (N,), (N,)."""
    scale = focal_length_mm**2 / (f_number * (focus_distance_mm - focal_length_mm))
    return np.asarray(scale * np.abs(depth_mm - focus_distance_mm) / depth_mm)


def ground_sample_distance_mm(depth_mm: Floats, focal_length_px: float) -> Floats:
    """Size of one pixel at the depth of each point (N,), seen square on, (N,)."""
    return np.asarray(depth_mm) / focal_length_px
