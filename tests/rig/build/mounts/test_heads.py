"""Heads: the room that angles have, which way up a camera goes, and what is said when none fits."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mounted import placed
from rigs import compact_camera

from common.errors import InputError, NotFoundError
from geometry.frames import Pose
from rig.build.mounts.kinematics import ANGLES, head_angles, rotated, turned_over
from rig.build.mounts.settings import CameraMount, chain_pose
from rig.build.mounts.systems.heads import HeadKind, head_id, stances
from rig.catalogue import load_catalogue

LEVEL = np.eye(3)


@cache
def ball() -> HeadKind:
    return HeadKind.named("generic-ball-36", load_catalogue())


def head(*ranges_deg: tuple[float, float], step_deg: float = 1.0) -> HeadKind:
    return replace(ball(), ranges_deg=ranges_deg, step_deg=step_deg, others=())


def looking(pan_deg: float, tilt_deg: float, roll_deg: float = 0.0) -> Pose:
    """A camera at the origin: straight ahead is the rig's y axis."""
    pan, tilt = np.radians([pan_deg, tilt_deg])
    axis = np.array([np.sin(pan) * np.cos(tilt), np.cos(pan) * np.cos(tilt), np.sin(tilt)])
    return Pose.looking_at(np.zeros(3), 1000.0 * axis, roll_deg)


@given(st.tuples(*[st.floats(-60.0, 60.0)] * 3))
def test_the_margin_is_the_way_to_the_nearest_end(angles: tuple[float, float, float]) -> None:
    kind = head((-50.0, 40.0), (-30.0, 20.0), (-10.0, 45.0))
    ends = [(-50.0, 40.0), (-30.0, 20.0), (-10.0, 45.0)]
    ways = [s * (end - a) for a, pair in zip(angles, ends, strict=True)
            for end, s in zip(pair, (-1.0, 1.0), strict=True)]  # fmt: skip
    assert kind.margin_deg(np.array(angles)) == pytest.approx(min(ways))


def test_what_turns_all_the_way_round_has_no_end() -> None:
    free = head((-180.0, 180.0), (-30.0, 30.0), (-30.0, 30.0))
    assert free.margin_deg(np.array([179.9, 0.0, 0.0])) == 30.0
    assert head((-180.0, 179.0), (-30.0, 30.0), (-30.0, 30.0)).margin_deg(
        np.array([178.0, 0.0, 0.0])
    ) == pytest.approx(1.0)


@given(st.floats(-170.0, 170.0), st.floats(-80.0, 80.0), st.floats(-170.0, 170.0))
@settings(max_examples=40, deadline=None)
def test_the_settings_of_a_stance_give_its_pose(pan: float, tilt: float, roll: float) -> None:
    everything = head((-180.0, 180.0), (-90.0, 90.0), (-180.0, 180.0), step_deg=0.5)
    camera = placed("cam", looking(pan, tilt, roll))
    for stance in stances(everything, camera, [("floor", LEVEL)]):
        values = {s.name: s.value for s in everything.settings(stance.angles_deg)}
        pose = chain_pose(everything.links(rotated(LEVEL), camera), values)
        # The settings are the exact angles: what is left is rounding of three turns.
        assert np.allclose(
            pose.rotation_rig_to_camera, stance.pose.rotation_rig_to_camera, atol=1e-9
        )


def test_settings_carry_step_range_and_where_they_are_measured_from() -> None:
    kind = head((-50.0, 40.0), (-30.0, 20.0), (-10.0, 45.0), step_deg=0.5)
    found = kind.settings(np.array([1.0, 2.0, 3.0]))
    assert [s.name for s in found] == list(ANGLES)
    assert [(s.low, s.high) for s in found] == list(kind.ranges_deg)
    assert [s.value for s in found] == [1.0, 2.0, 3.0]
    assert {s.step for s in found} == {0.5}
    assert len({s.measured_from for s in found}) == 3


def test_the_way_up_with_more_room_comes_first_and_bases_keep_their_order() -> None:
    camera = placed("cam", looking(0.0, 0.0, 170.0))
    wide = head((-180.0, 180.0), (-80.0, 80.0), (-175.0, 175.0))
    found = stances(wide, camera, [("left", LEVEL), ("right", LEVEL)])
    assert [stance.foot for stance in found] == ["left", "left", "right", "right"]
    first, second = (wide.margin_deg(stance.angles_deg) for stance in found[:2])
    assert first > second
    # Turned over it is rolled by 10 degrees only.
    assert np.allclose(
        found[0].pose.rotation_rig_to_camera,
        turned_over(camera.pose).rotation_rig_to_camera,
    )


@pytest.mark.parametrize(("roll", "held"), [(28.9, True), (29.1, False)])
def test_an_end_of_the_range_keeps_a_step_of_room(roll: float, held: bool) -> None:
    kind = head((-180.0, 180.0), (-30.0, 30.0), (-30.0, 30.0), step_deg=1.0)
    camera = placed("cam", looking(0.0, 0.0, roll))
    if held:
        assert stances(kind, camera, [("floor", LEVEL)])
    else:
        with pytest.raises(InputError, match="cannot hold cam"):
            stances(kind, camera, [("floor", LEVEL)])


def test_the_nearest_that_is_told_can_be_held() -> None:
    kind = head((-40.0, 40.0), (-30.0, 30.0), (-20.0, 20.0))
    with pytest.raises(InputError) as refused:
        stances(kind, placed("cam", looking(70.0, 50.0)), [("floor", LEVEL)])
    text = str(refused.value)
    assert "needs pan 70.0, tilt 50.0 and roll 0.0 degrees" in text
    assert "the nearest it can do is pan 39.0, tilt 29.0, roll 0.0" in text
    nearer = placed("cam", looking(39.0, 29.0, 0.0))
    assert stances(kind, nearer, [("floor", LEVEL)])


def test_the_nearest_of_all_bases_is_told() -> None:
    kind = head((-40.0, 40.0), (-30.0, 30.0), (-20.0, 20.0))
    pose = looking(60.0, 0.0)
    aside = Pose.looking_at(np.zeros(3), [1000.0, 0.0, 0.0])
    far = aside.rotation_rig_to_camera.T @ np.diag([1.0, 1.0, 1.0])
    bases = [("near", LEVEL), ("far", -far)]
    best = max(kind.margin_deg(head_angles(p.rotation_rig_to_camera, base))
               for _, base in bases for p in (pose, turned_over(pose)))  # fmt: skip
    assert best < kind.step_deg
    with pytest.raises(InputError) as refused:
        stances(kind, placed("cam", pose), bases)
    told = [float(word) for word in str(refused.value).replace(",", "").split() if _number(word)]
    assert kind.margin_deg(np.array(told[:3])) == pytest.approx(best, abs=0.1)


def _number(word: str) -> bool:
    return word.lstrip("-").replace(".", "", 1).isdigit()


def test_the_solids_of_a_head_stand_between_its_foot_and_the_camera() -> None:
    kind = ball()
    camera = placed("cam", looking(20.0, -10.0))
    stance = stances(kind, camera, [("floor", LEVEL)])[0]
    chain, angles = kind.links(rotated(LEVEL), camera), kind.settings(stance.angles_deg)
    pose = chain_pose(chain, {s.name: s.value for s in angles})
    mount = CameraMount(camera.moved_to(pose), camera.pose, angles, chain)
    foot, stem, disk = kind.solids(mount)
    assert {solid.owner for solid in (foot, stem, disk)} == {head_id("cam")}
    assert foot.corners_mm[:, 2].min() == pytest.approx(0.0, abs=1e-9)
    assert foot.corners_mm[:, 2].max() == pytest.approx(kind.pivot_mm, abs=1e-9)
    thread = pose.to_rig(compact_camera().body.mount_thread_camera_mm[None])[0]
    away = np.linalg.norm(disk.corners_mm - thread, axis=1)
    # The disk's rim: half its width away, drawn round by corners at most 10 % outside.
    assert away.min() == pytest.approx(kind.width_mm / 2.0, rel=0.1)
    assert np.ptp(stem.corners_mm, axis=0).max() > 0.0


def test_a_head_whose_figures_do_not_suffice_names_the_figure_and_another_head() -> None:
    catalogue = load_catalogue()
    part = replace(catalogue.heads["generic-ball-25"], pivot_mm=None)
    lacking = replace(catalogue, heads={**catalogue.heads, "generic-ball-25": part})
    with pytest.raises(InputError, match="does not say pivot_mm of head generic-ball-25"):
        HeadKind.named("generic-ball-25", lacking)
    others = HeadKind.named("generic-ball-36", lacking).others
    assert "generic-ball-25" not in {other.part.id for other in others}
    assert "generic-ball-36" not in {other.part.id for other in others}
    with pytest.raises((InputError, NotFoundError), match="no-such-head"):
        HeadKind.named("no-such-head", catalogue)
