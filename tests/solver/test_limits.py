"""Limits refuse what nobody can mean, in a line that names the number and the way out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import FrozenInstanceError, fields

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.errors import InputError
from solver.limits import (
    BaseHeight,
    Box,
    Centring,
    Coverage,
    CoverageTier,
    Frame,
    HalfSpace,
    Incidence,
    Limits,
    MotionBox,
    PoseBounds,
    Spacing,
    Sphere,
    StandOff,
    Symmetry,
)

NUMBERS: list[tuple[type, str]] = [
    *((PoseBounds, f.name) for f in fields(PoseBounds)),
    *((BaseHeight, f.name) for f in fields(BaseHeight)),
    *((StandOff, f.name) for f in fields(StandOff)),
    *((MotionBox, f.name) for f in fields(MotionBox)),
    (Incidence, "ray_max_deg"),
    (Incidence, "mean_max_deg"),
    (Frame, "margin_px"),
    (Centring, "tolerance_px"),
    (Symmetry, "median_tolerance_mm"),
    (Symmetry, "balance_tolerance_mm"),
    (Limits, "gsd_max_mm"),
    (Limits, "body_clearance_mm"),
    (Limits, "sight_line_clearance_mm"),
]


@pytest.mark.parametrize(("kind", "name"), NUMBERS)
@pytest.mark.parametrize("value", [-1e-9, float("nan"), float("inf")])
def test_a_number_that_is_no_size_is_refused_by_its_name(
    kind: Callable[..., object], name: str, value: float
) -> None:
    with pytest.raises(InputError, match=name) as caught:
        kind(**{name: value})
    assert caught.value.detail == "limit-value"
    kind(**{name: 0.0})


@pytest.mark.parametrize("value", [-1.0, float("nan")])
def test_spacing_is_a_length(value: float) -> None:
    with pytest.raises(InputError, match="edge_mm"):
        Spacing(value)
    with pytest.raises(InputError, match="tolerance_mm"):
        Spacing(100.0, value)


@pytest.mark.parametrize("value", [0.0, -0.5, float("nan"), float("inf")])
def test_noise_and_ignorance_are_positive(value: float) -> None:
    with pytest.raises(InputError, match="image_sigma_px"):
        Limits(image_sigma_px=value)
    with pytest.raises(InputError, match="unseen_sigma_mm"):
        Coverage(unseen_sigma_mm=value)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.floats(0.0, 1e4), st.floats(0.0, 1e4))
def test_a_minimum_above_its_maximum_contradicts_it(one: float, other: float) -> None:
    low, high = sorted((one, other))
    for make, names in (
        (StandOff, ("min_mm", "max_mm")),
        (BaseHeight, ("min", "max")),
        (BaseHeight, ("mean_min", "mean_max")),
        (BaseHeight, ("min", "neighbour_max")),
    ):
        make(**dict(zip(names, (low, high), strict=True)))
        if low < high:
            with pytest.raises(InputError, match="above the maximum") as caught:
                make(**dict(zip(names, (high, low), strict=True)))
            assert caught.value.detail == "limits-contradict"


def test_a_ray_along_the_surface_is_no_view() -> None:
    Incidence(89.0)
    with pytest.raises(InputError, match="at most 89"):
        Incidence(89.1)


@pytest.mark.parametrize("name", ["pitch_deg", "roll_deg", "yaw_deg"])
def test_a_head_that_turns_away_is_no_motion_box(name: str) -> None:
    MotionBox(**{name: 45.0})
    with pytest.raises(InputError, match="45 degrees"):
        MotionBox(**{name: 45.1})


@pytest.mark.parametrize(
    ("views", "share"), [(0, 0.5), (-1, 0.5), (2, 0.0), (2, 1.01), (2, float("nan"))]
)
def test_a_tier_asks_for_a_share_of_the_points_in_some_views(views: int, share: float) -> None:
    with pytest.raises(InputError, match="coverage asks"):
        CoverageTier(views, share)
    CoverageTier(1, 1.0)


@pytest.mark.parametrize("axes", ["", "w", "xx", "xyzx", "X"])
def test_symmetry_is_about_axes_named_once(axes: str) -> None:
    with pytest.raises(InputError, match="axes"):
        Symmetry(axes)


def test_axes_of_symmetry_are_numbered_as_named() -> None:
    assert Symmetry("zx").axis_indices == (2, 0)


def test_bounds_bind_angles_where_any_angle_is_bounded() -> None:
    assert not PoseBounds(x_mm=1.0, y_mm=2.0, z_mm=3.0).binds_angles
    for name in ("omega_deg", "phi_deg", "kappa_deg"):
        assert PoseBounds(**{name: 0.0}).binds_angles


@pytest.mark.parametrize(
    ("low", "high"),
    [([0, 0, 0], [1, 1, 0]), ([0, 0], [1, 1]), ([0, 0, 2], [1, 1, 1]), ([0, 0, 0], [1, 1, np.nan])],
)
def test_a_box_has_a_low_and_a_high_corner(low: list[float], high: list[float]) -> None:
    with pytest.raises(InputError, match="low < high"):
        Box(np.array(low, float), np.array(high, float))


@pytest.mark.parametrize(
    ("centre", "radius"), [([0, 0], 1), ([0, 0, np.inf], 1), ([0, 0, 0], 0), ([0, 0, 0], np.nan)]
)
def test_a_ball_has_a_centre_and_a_radius(centre: list[float], radius: float) -> None:
    with pytest.raises(InputError, match="sphere"):
        Sphere(np.array(centre, float), radius)


@pytest.mark.parametrize(
    ("normal", "offset"), [([0, 0, 0], 1), ([1, 0], 1), ([np.nan, 0, 1], 1), ([0, 0, 1], np.inf)]
)
def test_a_plane_has_a_direction_and_a_place(normal: list[float], offset: float) -> None:
    with pytest.raises(InputError, match="plane"):
        HalfSpace(np.array(normal, float), offset)


def test_normals_become_unit_vectors_and_nothing_can_be_changed_afterwards() -> None:
    given_normal = np.array([0.0, 3.0, 4.0])
    plane = HalfSpace(given_normal, 2.0)
    np.testing.assert_allclose(plane.normal, [0.0, 0.6, 0.8])
    given_normal[0] = 9.0
    np.testing.assert_allclose(plane.normal, [0.0, 0.6, 0.8])
    with pytest.raises(ValueError, match="read-only"):
        plane.normal[0] = 1.0
    with pytest.raises(FrozenInstanceError):
        plane.offset_mm = 3.0
