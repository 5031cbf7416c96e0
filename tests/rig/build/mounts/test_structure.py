"""Members: the length that is cut, straight, angled and bent; nothing in a structure changes."""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.build.mounts.structure import Joint, Member, Plate, Solid


def member(axis_mm: np.ndarray, radius_mm: float | None = None) -> Member:
    return Member("m", "2020", "rail", axis_mm, np.array([0.0, 0.0, 1.0]), (20.0, 20.0), radius_mm)


@given(st.tuples(*[st.floats(-1e3, 1e3)] * 3), st.tuples(*[st.floats(-1e3, 1e3)] * 3))
def test_a_straight_member_is_as_long_as_its_ends_are_apart(
    start: tuple[float, float, float], end: tuple[float, float, float]
) -> None:
    axis = np.array([start, end])
    assert member(axis).length_mm == pytest.approx(float(np.linalg.norm(axis[1] - axis[0])))


def test_a_member_with_corners_is_the_sum_of_its_pieces() -> None:
    axis = np.array([[0.0, 0.0, 0.0], [30.0, 0.0, 0.0], [30.0, 40.0, 0.0], [30.0, 40.0, 5.0]])
    assert member(axis).length_mm == pytest.approx(75.0)


@given(st.integers(2, 60), st.floats(100.0, 2000.0), st.floats(10.0, 170.0))
def test_a_bent_member_is_as_long_as_its_arc_however_finely_it_is_drawn(
    points: int, radius_mm: float, arc_deg: float
) -> None:
    angles = np.radians(np.linspace(0.0, arc_deg, points))
    axis = radius_mm * np.stack([np.cos(angles), np.sin(angles), np.zeros(points)], axis=1)
    # Chords of an arc give it exactly; the sum of the chords would fall short of it.
    assert member(axis, radius_mm).length_mm == pytest.approx(radius_mm * np.radians(arc_deg))
    assert member(axis).length_mm < radius_mm * np.radians(arc_deg)


def test_what_a_structure_is_made_of_cannot_be_changed() -> None:
    own = np.zeros((4, 3))
    solid = Solid("m", "member", own)
    own[0] = 1.0
    assert not solid.corners_mm.any(), "a copy is kept, not the caller's array"
    with pytest.raises(ValueError, match="read-only"):
        solid.corners_mm[0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        member(np.zeros((2, 3))).axis_mm[0, 0] = 1.0
    with pytest.raises(FrozenInstanceError):
        solid.owner = "other"
    cutout = np.zeros((4, 2))
    plate = Plate("p", "wood", 8.0, np.eye(4), np.zeros((4, 2)), (), (cutout,))
    with pytest.raises(ValueError, match="read-only"):
        plate.cutouts_mm[0][0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        Joint("j", "a", "b", np.zeros(3)).point_mm[0] = 1.0
