"""Limits that cannot hold together, as far as that can be seen without solving.

Only certain contradictions are reported: what merely looks tight is for the solver, which
says by how much each limit would have to give way.
"""

from __future__ import annotations

import numpy as np

from common.errors import InputError
from geometry.camera import Camera
from geometry.optics import blur_ratio
from solver.limits import Limits

LARGEST_BASE_HEIGHT_RATIO = 2.0
"""Two cameras are never farther apart than the sum of their distances to the object."""


def _clash(one: str, other: str, remedy: str) -> InputError:
    return InputError("limits-contradict", f"{one}, but {other}", remedy)


def check_limits(camera: Camera, limits: Limits, cameras_in_all: int) -> None:
    """Raise :class:`InputError` ``limits-contradict`` that names the two that clash."""
    _check_frame(camera, limits)
    _check_views(limits, cameras_in_all)
    _check_pairs(limits, cameras_in_all)
    _check_base_height(limits)
    _check_spacing(limits)
    _check_distance(camera, limits)


def _check_frame(camera: Camera, limits: Limits) -> None:
    width, height = camera.image_size_px
    if limits.frame is not None and 2.0 * limits.frame.margin_px >= min(width, height):
        raise _clash(
            f"limits.frame.margin_px is {limits.frame.margin_px:g}",
            f"camera.image_size_px is only {width} x {height}",
            "give a smaller margin",
        )


def _check_views(limits: Limits, cameras_in_all: int) -> None:
    for tier in limits.coverage.tiers:
        if tier.views > cameras_in_all:
            raise _clash(
                f"limits.coverage asks for {tier.views} views",
                f"the rig has {cameras_in_all} cameras",
                "ask for fewer views or give more cameras",
            )


def _check_pairs(limits: Limits, cameras_in_all: int) -> None:
    most = cameras_in_all * (cameras_in_all - 1) // 2
    for tier in limits.matching.demanded:
        if tier.pairs > most:
            raise _clash(
                f"matching asks for {tier.pairs} pairs",
                f"{cameras_in_all} cameras are {most}",
                "ask for fewer pairs or give more cameras",
            )


def _check_base_height(limits: Limits) -> None:
    ratio = limits.base_height
    for label, low in (("min", ratio.min), ("mean_min", ratio.mean_min)):
        if low is not None and low > LARGEST_BASE_HEIGHT_RATIO:
            raise _clash(
                f"limits.base_height.{label} is {low:g}",
                f"no base/height exceeds {LARGEST_BASE_HEIGHT_RATIO:g}",
                "give a smaller ratio",
            )
    pairs = (
        ("min", ratio.min, "mean_max", ratio.mean_max),
        ("mean_min", ratio.mean_min, "max", ratio.max),
    )
    for low_label, low, high_label, high in pairs:
        if low is not None and high is not None and low > high:
            raise _clash(
                f"limits.base_height.{low_label} is {low:g}",
                f"limits.base_height.{high_label} is {high:g}",
                "lower the one or raise the other",
            )


def _check_spacing(limits: Limits) -> None:
    """Every base is at least min B/H times the least stand-off, so their mean is too."""
    spacing, ratio, stand_off = limits.spacing, limits.base_height, limits.stand_off
    if spacing is None:
        return
    longest = spacing.edge_mm + spacing.tolerance_mm
    if (
        ratio.min is not None
        and stand_off.min_mm is not None
        and ratio.min * stand_off.min_mm > longest
    ):
        raise _clash(
            f"limits.spacing allows edges of {longest:g} mm on average",
            f"limits.base_height.min and stand_off.min_mm ask for bases of "
            f"{ratio.min * stand_off.min_mm:g} mm or more",
            "give a longer edge_mm or a smaller B/H",
        )
    shortest = spacing.edge_mm - spacing.tolerance_mm
    if (
        ratio.max is not None
        and stand_off.max_mm is not None
        and ratio.max * stand_off.max_mm < shortest
    ):
        raise _clash(
            f"limits.spacing asks for edges of {shortest:g} mm on average",
            f"limits.base_height.max and stand_off.max_mm allow bases of "
            f"{ratio.max * stand_off.max_mm:g} mm at most",
            "give a shorter edge_mm or a greater B/H",
        )


def _nearest_mm(camera: Camera, depth_of_field: bool) -> float:
    """Nearer than this nothing can be photographed: not sharp, or beyond the lens's reach."""
    if not depth_of_field:
        return camera.min_focus_distance_mm
    focus = camera.focus_distance_mm or camera.min_focus_distance_mm
    optics = (camera.focal_length_mm, camera.f_number, camera.circle_of_confusion_mm)
    return focus / (1.0 + blur_ratio(focus, *optics))


def _check_distance(camera: Camera, limits: Limits) -> None:
    near = _nearest_mm(camera, limits.depth_of_field)
    stand_off, gsd = limits.stand_off, limits.gsd_max_mm
    own = limits.depth_of_field and camera.focus_distance_mm is not None
    focus = "camera.focus_mm" if own else "camera.min_focus_mm"
    if stand_off.max_mm is not None and stand_off.max_mm < near:
        raise _clash(
            f"limits.stand_off.max_mm is {stand_off.max_mm:g}",
            f"{focus} keeps everything nearer than {near:.0f} mm unsharp",
            "allow a greater stand-off or choose a lens that focuses nearer",
        )
    if gsd is None:
        return
    farthest = gsd * camera.focal_length_px
    if farthest < near:
        raise _clash(
            f"limits.gsd.max_mm is {gsd:g}, which needs {farthest:.0f} mm or nearer",
            f"{focus} keeps everything nearer than {near:.0f} mm unsharp",
            "allow larger pixels or choose a longer lens",
        )
    # A camera may look past the centroid, down to the corner of its image: depth falls short
    # of distance by that angle's cosine.
    corner = np.hypot(*camera.sensor_size_mm) / (2.0 * camera.focal_length_mm)
    if stand_off.min_mm is not None and farthest < stand_off.min_mm / np.hypot(1.0, corner):
        raise _clash(
            f"limits.gsd.max_mm is {gsd:g}, which needs {farthest:.0f} mm or nearer",
            f"limits.stand_off.min_mm is {stand_off.min_mm:g}",
            "allow larger pixels or a smaller stand-off",
        )
