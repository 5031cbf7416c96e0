"""Room to build: what it may cost, and that only cameras which are mounted are moved for it."""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace
from itertools import chain, repeat
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mounted import placed

from geometry.camera import RigCamera
from geometry.frames import Pose
from rig.build.mounts import relaxing
from rig.build.mounts.kinematics import ANGLES
from rig.build.mounts.relaxing import MOST_COVERAGE, MOST_LOSS, VIEWS, relaxed

ANGLE = st.floats(-180.0, 180.0)
SHIFT_MM = np.array([3.0, -2.0, 1.0])


@dataclass(frozen=True)
class Share:
    views: int
    share: float


@dataclass(frozen=True)
class Figures:
    """The part of a quality that relaxing reads."""

    sigma_median_mm: float
    coverage: tuple[Share, ...]
    feasible: bool = True


def figures(sigma_mm: float, second_views: float) -> Figures:
    return Figures(sigma_mm, (Share(1, 1.0), Share(2, second_views), Share(3, 0.3)))


class Asked:
    """Stands for the rounder: keeps what it is given, moves every mount, asks what that costs."""

    def __init__(self, _subject, _limits, cameras, mounts, *, spare, tell, cancel) -> None:  # noqa: ANN001
        Asked.last = self
        Asked.begun.append(cameras)
        self.cameras, self.mounts, self.spare = cameras, mounts, spare
        self.tell, self.cancel = tell, cancel
        self.losses: list[float] = []
        self.most = float("nan")

    last: Asked
    begun: ClassVar[list[tuple[RigCamera, ...]]] = []

    def relax(self, loss, most: float) -> float:  # noqa: ANN001
        self.most = most
        self.losses.append(loss(self.cameras))
        self.mounts = tuple(
            m.moved({k: m.values()[k] + d for k, d in zip("xyz", SHIFT_MM, strict=True)})
            for m in self.mounts
        )
        return 0.25 * self.spare


def rig() -> tuple[RigCamera, ...]:
    target = np.array([0.0, 0.0, 1500.0])
    places = np.array([[-500.0, -800.0, 1500.0], [0.0, -900.0, 1700.0], [500.0, -800.0, 1400.0]])
    cameras = [placed(f"cam{k}", Pose.looking_at(p, target)) for k, p in enumerate(places)]
    return (cameras[0], replace(cameras[1], fixed=True), cameras[2])


def run(
    monkeypatch: pytest.MonkeyPatch, designed: Figures, tried: Figures
) -> tuple[tuple[RigCamera, ...], float]:
    answers = chain((designed,), repeat(tried))
    monkeypatch.setattr(relaxing, "evaluate", lambda *_: next(answers))
    monkeypatch.setattr(relaxing, "Rounder", Asked)
    return relaxed(
        rig(),
        None,
        None,
        steps=(5.0, 0.5),
        spare=0.8,
        tell=lambda _: None,
        cancel=threading.Event(),
    )


def test_only_what_is_mounted_moves_and_the_order_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    given_cameras = rig()
    found, spare = run(monkeypatch, figures(0.1, 0.9), figures(0.1, 0.9))
    assert [c.name for c in found] == ["cam0", "cam1", "cam2"]
    assert [m.name for m in Asked.last.mounts] == ["cam0", "cam2"]
    assert Asked.last.cameras == given_cameras or len(Asked.last.cameras) == 3
    for before, after in zip(given_cameras, found, strict=True):
        moved = after.pose.position_rig_mm - before.pose.position_rig_mm
        # A pose goes through its matrix and back: 1e-9 mm is a thousand times that rounding.
        assert np.allclose(moved, 0.0 if before.fixed else SHIFT_MM, atol=1e-9)
        assert np.allclose(
            after.pose.rotation_rig_to_camera, before.pose.rotation_rig_to_camera, atol=1e-12
        )
    assert spare == 0.25 * 0.8
    assert Asked.last.spare == 0.8


@pytest.mark.parametrize(("sigma_mm", "loss"), [(0.1, 0.0), (0.11, 0.1), (0.095, -0.05)])
def test_the_loss_is_the_share_of_the_median_sigma(
    monkeypatch: pytest.MonkeyPatch, sigma_mm: float, loss: float
) -> None:
    run(monkeypatch, figures(0.1, 0.9), figures(sigma_mm, 0.9))
    assert Asked.last.losses == [pytest.approx(loss, abs=1e-12)]
    assert Asked.last.most == MOST_LOSS


@pytest.mark.parametrize("lost", [0.5, 0.99, 1.01, 3.0])
def test_second_views_may_be_lost_up_to_a_share_only(
    monkeypatch: pytest.MonkeyPatch, lost: float
) -> None:
    run(monkeypatch, figures(0.1, 0.9), figures(0.1, 0.9 - lost * MOST_COVERAGE))
    assert (Asked.last.losses == [float("inf")]) == (lost > 1.0)


@pytest.mark.parametrize("kept", [True, False])
def test_what_breaks_limits_by_what_it_sees_anew_is_moved_again_from_there(
    monkeypatch: pytest.MonkeyPatch, *, kept: bool
) -> None:
    """Six of thirteen plans broke the depth of field for points that came into view."""
    monkeypatch.setattr(Asked, "begun", [])
    tried = replace(figures(0.1, 0.9), feasible=kept)
    found, _ = run(monkeypatch, figures(0.1, 0.9), tried)
    assert len(Asked.begun) == (1 if kept else VIEWS)
    for k, cameras in enumerate((*Asked.begun, found)):
        moved = cameras[0].pose.position_rig_mm - rig()[0].pose.position_rig_mm
        # A pose goes through its matrix and back: 1e-9 mm is a thousand times that rounding.
        assert np.allclose(moved, k * SHIFT_MM, atol=1e-9)


def test_gained_second_views_cost_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    run(monkeypatch, figures(0.1, 0.9), figures(0.1, 0.95))
    assert Asked.last.losses == [pytest.approx(0.0, abs=1e-12)]


def test_a_region_without_second_views_has_none_to_lose(monkeypatch: pytest.MonkeyPatch) -> None:
    nothing = Figures(0.1, (Share(1, 1.0),))
    run(monkeypatch, nothing, nothing)
    assert Asked.last.losses == [pytest.approx(0.0, abs=1e-12)]


@given(st.tuples(ANGLE, st.floats(-80.0, 80.0), ANGLE), st.tuples(*[st.floats(-2e3, 2e3)] * 3))
@settings(max_examples=30, deadline=None)
def test_any_pose_is_held_by_slides_and_a_head_without_size(
    angles_deg: tuple[float, float, float], place_mm: tuple[float, float, float]
) -> None:
    pan, tilt, roll = np.radians(angles_deg)
    towards = np.array([np.sin(pan) * np.cos(tilt), np.cos(pan) * np.cos(tilt), np.sin(tilt)])
    place = np.array(place_mm)
    pose = Pose.looking_at(place, place + 1000.0 * towards, float(np.degrees(roll)))
    mount = relaxing._loose(placed("cam", pose), (2.5, 0.1))
    values = mount.values()
    assert np.allclose([values[k] for k in "xyz"], place)
    assert {s.step for s in mount.settings if s.unit == "mm"} == {2.5}
    assert {s.step for s in mount.settings if s.unit == "deg"} == {0.1}
    assert [s.name for s in mount.settings if s.unit == "deg"] == list(ANGLES)
    # A constructed mount checks its pose; what a slide moves is the camera's place, as it is named.
    moved = mount.moved({"z": values["z"] + 7.0})
    assert np.allclose(moved.camera.pose.position_rig_mm - place, [0.0, 0.0, 7.0], atol=1e-9)
