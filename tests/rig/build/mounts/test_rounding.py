"""Rounding: every setting exists, and what was lost is won back where it can be."""

from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np
import pytest
from mounted import BoxNetwork, slider

from common.errors import CancelledError
from geometry.camera import RigCamera
from geometry.frames import Pose
from rig.build.mounts import rounding
from rig.build.mounts.network import Score
from rig.build.mounts.rounding import SHARES, Rounder, _is_better, nearest, needs_rounding
from rig.build.mounts.settings import CameraMount

TARGET = np.array([0.0, 1000.0, 0.0])


class Bowl(BoxNetwork):
    """A network whose cost is the distance of each camera from its best place."""

    def __init__(self, best_mm: np.ndarray, wall_mm: float = 900.0) -> None:
        super().__init__(np.full(3, -wall_mm), np.full(3, wall_mm))
        self.best_mm, self.cameras, self.margins = best_mm, [], {}

    def focused(self, _index: int, camera: RigCamera) -> RigCamera:
        return camera

    def move(self, index: int, camera: RigCamera) -> None:
        self.cameras[index] = camera

    def score(self, index: int, camera: RigCamera) -> Score:
        rows = self.rows(index, camera).values()
        breach = sum(max(0.0, -r.slack) for r in rows)
        lack = sum(max(0.0, self.margins.get(r.name, 0.0) - r.slack) for r in rows)
        away = camera.pose.position_rig_mm - self.best_mm
        return Score(breach, round(lack, 4), float(away @ away))


def rounder(
    network: Bowl,
    mounts: tuple[CameraMount, ...],
    monkeypatch: pytest.MonkeyPatch,
    spare: float = 0.0,
    cancel: threading.Event | None = None,
    told: list[float] | None = None,
) -> Rounder:
    network.cameras = [mount.camera for mount in mounts]
    monkeypatch.setattr(rounding, "MountNetwork", lambda *_: network)

    class Points:
        centroid_mm = TARGET

    class Subject:
        design_points = Points()

    return Rounder(
        Subject(),
        None,
        tuple(network.cameras),
        mounts,
        spare=spare,
        tell=(told if told is not None else []).append,
        cancel=cancel or threading.Event(),
    )


def test_every_setting_exists_after_rounding(monkeypatch: pytest.MonkeyPatch) -> None:
    mounts = tuple(
        slider(f"cam{k}", {"x": 3.3 * k, "y": -7.7, "pan": 1.3 * k, "tilt": -0.4, "roll": 0.6})
        for k in range(3)
    )
    told: list[float] = []
    network = Bowl(np.array([2.0, -8.0, 0.0]))
    done = rounder(network, mounts, monkeypatch, told=told).run()
    assert [m.name for m in done] == ["cam0", "cam1", "cam2"]
    assert all(s.exists for m in done for s in m.settings)
    assert [c.name for c in network.cameras] == ["cam0", "cam1", "cam2"]
    for mount, camera in zip(done, network.cameras, strict=True):
        assert np.allclose(mount.pose().position_rig_mm, camera.pose.position_rig_mm)
    assert told == sorted(told) or max(told) <= 1.0
    assert told[-1] <= 1.0


def test_sweeps_go_downhill_to_the_best_step(monkeypatch: pytest.MonkeyPatch) -> None:
    network = Bowl(np.array([12.4, -5.2, 0.0]))
    (done,) = rounder(network, (slider(values={"x": 10.2, "y": -4.1}),), monkeypatch).run()
    # Two sweeps of one step each lead from 10 to 12 and from -4 to -5; a third gains nothing.
    assert (done.values()["x"], done.values()["y"], done.values()["z"]) == (12.0, -5.0, 0.0)


def test_a_broken_limit_is_left_before_anything_is_saved(monkeypatch: pytest.MonkeyPatch) -> None:
    network = Bowl(np.array([40.0, 0.0, 0.0]), wall_mm=30.2)
    (done,) = rounder(network, (slider(values={"x": 30.1}),), monkeypatch).run()
    assert done.values()["x"] == 30.0, "31 and more would cost less, and break"


def test_spare_keeps_settings_off_the_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    tight = rounder(Bowl(np.array([99.0, 0, 0]), 30.0), (slider(values={"x": 29.9}),), monkeypatch)
    roomy = rounder(
        Bowl(np.array([99.0, 0, 0]), 30.0),
        (slider(values={"x": 29.9}, steps=(4.0, 1.0)),),
        monkeypatch,
        spare=1.0,
    )
    assert tight.run()[0].values()["x"] == 30.0
    # Half a step of 4 mm is kept clear: 28 is the last step that leaves it.
    assert roomy.run()[0].values()["x"] == 28.0


def test_rounding_an_angle_keeps_the_aim(monkeypatch: pytest.MonkeyPatch) -> None:
    mount = slider(values={"x": 100.0, "pan": 10.4, "tilt": 3.3})
    before = mount.camera.pose.to_camera(TARGET[None])[0]
    turned = rounder(Bowl(np.zeros(3)), (mount,), monkeypatch)._turned(mount, {})
    values = turned.values()
    assert (values["pan"], values["tilt"]) == (10.0, 3.0)
    # The target stays at its pixel and depth: the slides take up what the angles lost.
    assert turned.camera.pose.to_camera(TARGET[None])[0] == pytest.approx(before, abs=1e-6)
    assert values["x"] != 100.0


def test_relaxing_takes_the_most_room_that_is_worth_it(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[float] = []

    def loss(cameras: tuple[RigCamera, ...]) -> float:
        asked.append(float(cameras[0].pose.position_rig_mm[0]))
        return 0.0 if cameras[0].pose.position_rig_mm[0] > 28.9 else 1.0

    mount = slider(values={"x": 30.0}, steps=(4.0, 1.0))
    job = rounder(Bowl(np.zeros(3), 30.0), (mount,), monkeypatch, spare=1.0)
    given = job.relax(loss, 0.5)
    # Half a step is 2 mm of x: a share s of it moves the camera to 30 - 2 s.
    assert given == max(s for s in SHARES if 30.0 - 2.0 * s > 28.9) == 0.5
    assert asked[0] == pytest.approx(28.0, abs=0.01)
    assert job.mounts[0].camera.pose.position_rig_mm[0] == pytest.approx(29.0, abs=0.01)


def test_relaxing_gives_nothing_where_nothing_is_worth_it(monkeypatch: pytest.MonkeyPatch) -> None:
    mount = slider(values={"x": 30.0}, steps=(4.0, 1.0))
    job = rounder(Bowl(np.zeros(3), 30.0), (mount,), monkeypatch, spare=1.0)
    assert job.relax(lambda _: 1.0, 0.5) == 0.0
    assert job.mounts[0].camera.pose.position_rig_mm[0] == pytest.approx(30.0, abs=1e-6)


def test_rounding_stops_when_it_is_told_to(monkeypatch: pytest.MonkeyPatch) -> None:
    stop = threading.Event()
    stop.set()
    with pytest.raises(CancelledError):
        rounder(Bowl(np.zeros(3)), (slider(),), monkeypatch, cancel=stop).run()


def test_nearest_rounds_each_alone_and_made_ones_not_at_all() -> None:
    mount = slider(values={"x": 1.6, "pan": -2.7})
    assert nearest(mount).values() == mount.values() | {"x": 2.0, "pan": -3.0}
    made = slider(values={"x": 1.6}, steps=(0.0, 0.0))
    assert nearest(made).values() == made.values()
    assert needs_rounding((made, mount)) and not needs_rounding((made,))


@pytest.mark.parametrize(
    ("one", "other", "better"),
    [
        (Score(0.0, 5.0, 5.0), Score(0.1, 0.0, 0.0), True),
        (Score(0.1, 0.0, 0.0), Score(0.0, 5.0, 5.0), False),
        (Score(0.1, 1.0, 5.0), Score(0.1, 2.0, 0.0), True),
        (Score(0.1, 1.0, 1.0), Score(0.1, 1.0005, 0.9), False),
        (Score(0.1, 1.0, 1.0), Score(0.1, 1.0, 1.1), True),
        (Score(0.1, 1.0, 1.0), Score(0.1, 1.0, 1.0), False),
    ],
)
def test_better_is_less_breach_then_more_room_then_less_cost(
    one: Score, other: Score, better: bool
) -> None:
    assert _is_better(one, other) == better


def test_a_turn_that_slides_cannot_follow_is_no_neighbour(monkeypatch: pytest.MonkeyPatch) -> None:
    mount = slider(values={"pan": 5.0})
    lost = replace(mount, chain=mount.chain)
    job = rounder(Bowl(np.zeros(3)), (lost,), monkeypatch)
    monkeypatch.setattr(rounding, "reach", _out_of_reach)
    found = list(job._neighbours(lost, broken=True))
    # Both ways of three slides are left; none of the turns.
    assert len(found) == 6
    assert all(m.values()["pan"] == 5.0 for m in found)
    assert len(list(job._neighbours(lost, broken=False))) == 6


def _out_of_reach(*_: object, **__: object) -> Pose:
    from common.errors import InputError

    raise InputError("mount-reach", "too far", "no")
