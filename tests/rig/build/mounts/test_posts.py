"""Posts with wedges: made to figures that put the camera where it was designed, or none at all."""

from __future__ import annotations

from functools import cache
from itertools import islice

import numpy as np
import pytest
from mounted import placed

from common.errors import InputError
from geometry.camera import RigCamera
from geometry.frames import Pose
from rig.build.mounts.kinematics import rotated, turned_over
from rig.build.mounts.solids import camera_solids
from rig.build.mounts.systems.fits import (
    LEAST_SEAT_MM,
    STEEPEST,
    UNDER_MM,
    Fitter,
    WedgeFit,
    seat_height,
    seat_size,
)
from rig.build.mounts.systems.posts import FREE_MM, LONGEST_POST_MM, Posted, post_for
from rig.catalogue import load_catalogue

CATALOGUE = load_catalogue()
PROFILE = CATALOGUE.profiles["2040"]
# The plate stands upright and looks along the rig's y axis: its z is y, its x is x, its y is z.
AXES = np.stack([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]], axis=1)
FACE = rotated(AXES, np.array([0.0, -1000.0, 1500.0]))
SPOTS_MM = ((0.0, -700.0, 1500.0), (220.5, -655.3, 1391.7), (-300.0, -500.25, 1700.0))
TARGET_MM = np.array([0.0, 300.0, 1500.0])


def camera(spot_mm: tuple[float, float, float], roll_deg: float = 0.0) -> RigCamera:
    return placed("cam", Pose.looking_at(np.array(spot_mm), TARGET_MM, roll_deg))


@cache
def fit(spot_mm: tuple[float, float, float], roll_deg: float = 0.0) -> WedgeFit:
    return next(iter(Fitter(AXES, PROFILE, CATALOGUE).fits(camera(spot_mm, roll_deg))))


@cache
def posted(spot_mm: tuple[float, float, float]) -> Posted:
    found = post_for(camera(spot_mm), fit(spot_mm), FACE, PROFILE)
    assert found is not None
    return found


@pytest.mark.parametrize("spot_mm", SPOTS_MM)
def test_the_camera_stands_where_it_was_designed(spot_mm: tuple[float, float, float]) -> None:
    pose, wanted = posted(spot_mm).mount.pose(), fit(spot_mm).pose
    assert np.allclose(pose.position_rig_mm, spot_mm, atol=1e-6)
    assert np.allclose(pose.rotation_rig_to_camera, wanted.rotation_rig_to_camera, atol=1e-8)
    ways = [p.rotation_rig_to_camera for p in _both(camera(spot_mm).pose)]
    assert min(float(np.abs(wanted.rotation_rig_to_camera - w).max()) for w in ways) < 1e-12


def _both(pose: Pose) -> tuple[Pose, Pose]:
    return pose, turned_over(pose)


@pytest.mark.parametrize("spot_mm", SPOTS_MM)
def test_a_post_is_cut_to_whole_millimetres_and_long_enough(
    spot_mm: tuple[float, float, float],
) -> None:
    post = posted(spot_mm)
    length = post.mount.values()["post"]
    assert length == round(length)
    assert post.member().length_mm == pytest.approx(length)
    # Cut longer than needed by less than the millimetre it was rounded up by.
    assert 0.0 <= post.back_mm - post.fit.footing.front_mm < 1.0
    assert post.back_mm + post.fit.footing.rear_mm + FREE_MM <= length <= LONGEST_POST_MM


@pytest.mark.parametrize("spot_mm", SPOTS_MM)
def test_the_post_is_square_to_the_plate_and_begins_on_it(
    spot_mm: tuple[float, float, float],
) -> None:
    start, end = posted(spot_mm).member().axis_mm
    assert start @ AXES[:, 2] == pytest.approx(FACE[:3, 3] @ AXES[:, 2], abs=1e-9)
    along = (end - start) / np.linalg.norm(end - start)
    assert np.allclose(along, AXES[:, 2], atol=1e-12)


@pytest.mark.parametrize("spot_mm", SPOTS_MM)
def test_the_base_of_the_wedge_lies_on_the_side_of_the_post(
    spot_mm: tuple[float, float, float],
) -> None:
    post = posted(spot_mm)
    base, start = post.base(), post.member().axis_mm[0]
    from_axis = base[:3, 3] - start
    along = float(from_axis @ AXES[:, 2])
    assert along == pytest.approx(post.wedge_along_mm, abs=1e-6)
    aside = from_axis - along * AXES[:, 2]
    assert float(np.linalg.norm(aside)) == pytest.approx(PROFILE.width_mm / 2.0, abs=1e-6)
    assert np.allclose(aside / np.linalg.norm(aside), base[:3, 2], atol=1e-6)
    seat = post.wedge().rig_from_base @ post.wedge().base_from_seat
    thread = camera(spot_mm).camera.body.mount_thread_camera_mm
    mouth = post.mount.pose().to_rig(thread[None])[0]
    assert np.allclose(seat[:3, 3], mouth, atol=1e-6)


def test_nobody_s_post_is_longer_than_the_longest_or_shorter_than_its_wedge() -> None:
    far = (0.0, -1000.0 + LONGEST_POST_MM + 300.0, 1500.0)
    near = (0.0, -1000.0 + 10.0, 1500.0)
    for spot_mm in (far, near):
        seen = placed("cam", Pose.looking_at(np.array(spot_mm), np.array([0.0, 5000.0, 1500.0])))
        made = next(iter(Fitter(AXES, PROFILE, CATALOGUE).fits(seen)))
        assert post_for(seen, made, FACE, PROFILE) is None


@pytest.mark.parametrize("roll_deg", [0.0, 35.0, -80.0, 180.0])
def test_every_fit_can_be_printed_and_clears_the_post(roll_deg: float) -> None:
    seen = camera(SPOTS_MM[1], roll_deg)
    for tried in islice(Fitter(AXES, PROFILE, CATALOGUE).fits(seen), 2):
        base = tried.wedge.rig_from_base[:3, :3]
        # The wedge's base is a side of the post: its z is square to the plate's.
        assert base[:, 2] @ AXES[:, 2] == pytest.approx(0.0, abs=1e-12)
        assert -tried.pose.rotation_rig_to_camera[1] @ base[:, 2] >= STEEPEST
        assert tried.seat_mm == seat_height(seen, tried.pose, base) >= LEAST_SEAT_MM
        assert tried.wedge.seat_size_mm == seat_size(seen)


def test_a_seat_lifts_all_of_the_camera_off_the_post() -> None:
    made = fit(SPOTS_MM[1])
    base = made.wedge.rig_from_base[:3, :3]
    seen = camera(SPOTS_MM[1]).moved_to(made.pose)
    mouth = made.pose.to_rig(seen.camera.body.mount_thread_camera_mm[None])[0]
    lowest = min(
        float(((solid.corners_mm - mouth) @ base[:, 2]).min()) for solid in camera_solids(seen)
    )
    assert made.seat_mm + lowest >= UNDER_MM - 1e-9


def test_a_camera_that_looks_away_from_the_plate_is_told_where_to_look() -> None:
    aside = placed("cam", Pose.looking_at(np.array(SPOTS_MM[0]), [0.0, -700.0, 9000.0]))
    with pytest.raises(InputError, match=r"90 degrees off the plate's normal.*choose a frame"):
        list(Fitter(AXES, PROFILE, CATALOGUE).fits(aside))
