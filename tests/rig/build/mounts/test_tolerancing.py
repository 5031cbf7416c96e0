"""Tolerances of settings: where a limit breaks, found without knowing how the limits bend."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mounted import BoxNetwork, slider

from common.errors import CancelledError
from geometry.camera import RigCamera
from rig.build.mounts import tolerancing
from rig.build.mounts.plan import Tolerance
from rig.build.mounts.settings import CameraMount, Setting
from rig.build.mounts.tolerancing import (
    LEAST_TRIALS,
    MADE_DEG,
    MADE_MM,
    MOST_TRIALS,
    NEAR,
    WIDEST_DEG,
    WIDEST_MM,
    WORK,
    Tolerancer,
    half_step,
    trials_for,
    yield_share,
)
from solver.result import ConstraintRow

SUBJECT, LIMITS = object(), object()
"""Handed on to the network as they are."""


def tolerancer(
    network: BoxNetwork,
    mounts: tuple[CameraMount, ...],
    monkeypatch: pytest.MonkeyPatch,
    tell: Callable[[float], None] = lambda _: None,
    cancel: threading.Event | None = None,
) -> Tolerancer:
    cameras = tuple(mount.camera for mount in mounts)

    def made(*given: object) -> BoxNetwork:
        assert given == (SUBJECT, LIMITS, cameras)
        return network

    monkeypatch.setattr(tolerancing, "MountNetwork", made)
    return Tolerancer(
        SUBJECT,
        LIMITS,
        cameras,
        mounts,
        tell=tell,
        cancel=cancel or threading.Event(),
    )


def found(
    network: BoxNetwork, monkeypatch: pytest.MonkeyPatch, mount: CameraMount | None = None
) -> dict[str, Tolerance]:
    mounts = (mount or slider(),)
    return {t.setting: t for t in tolerancer(network, mounts, monkeypatch).each()}


def box(low: float, high: float) -> BoxNetwork:
    """Free by so much on x; the other walls are far."""
    return BoxNetwork(np.array([-low, -900.0, -900.0]), np.array([high, 900.0, 900.0]))


@settings(deadline=None, max_examples=40)
@given(st.floats(0.5, 18.0), st.floats(0.5, 18.0))
def test_a_wall_is_found_to_its_share_and_from_inside(low: float, high: float) -> None:
    with pytest.MonkeyPatch.context() as patch:
        x = found(box(low, high), patch)["x"]
    # Known to NEAR of itself or a tenth of half a step (0.05 mm), never beyond the wall.
    for told, true in ((x.plus, high), (x.minus, low)):
        assert told <= true
        assert told >= true - max(1.01 * NEAR * true * 1.06, 0.05 + 1e-9)
    nearer, farther = ("high_x", "low_x") if x.plus <= x.minus else ("low_x", "high_x")
    assert x.limit == f"{nearer}/cam01", farther
    assert (x.camera, x.setting, x.unit) == ("cam01", "x", "mm")


@settings(deadline=None, max_examples=25)
@given(st.floats(1.0, 15.0), st.floats(0.2, 3.0))
def test_a_wall_that_bends_is_found_as_well(reach: float, power: float) -> None:
    def bend(value: float) -> float:
        """Slack that falls with a power: the first guess is far off."""
        return float(np.sign(value) * 10.0 * (abs(value) / 10.0) ** power)

    network = box(bend(reach), bend(reach))
    network.bend = bend
    with pytest.MonkeyPatch.context() as patch:
        x = found(network, patch)["x"]
    for told in (x.plus, x.minus):
        assert told <= reach + 1e-9
        assert told >= reach - max(1.07 * NEAR * reach, 0.05 + 1e-9)


def test_what_no_limit_stops_has_no_end(monkeypatch: pytest.MonkeyPatch) -> None:
    names = found(box(900.0, 900.0), monkeypatch)
    assert all(t.plus == t.minus == float("inf") and t.limit == "" for t in names.values())
    # The angles turn about the centre, which stays in its box.
    assert [t.unit for t in names.values()] == ["mm"] * 3 + ["deg"] * 3


@pytest.mark.parametrize(
    ("wall", "end"), [(WIDEST_MM - 0.5, True), (WIDEST_MM + 0.5, False), (WIDEST_DEG, True)]
)
def test_nothing_is_tried_beyond_the_widest(
    wall: float, end: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert np.isfinite(found(box(wall, wall), monkeypatch)["x"].plus) == end


@pytest.mark.parametrize(
    ("wall", "expected"), [(30.0, np.degrees(np.arcsin(30.0 / 800.0))), (100.0, np.inf)]
)
def test_an_angle_is_tried_in_degrees(
    wall: float, expected: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A camera 800 mm before its pivot: 30 mm aside are 2.1 degrees, 100 mm over the widest."""
    pan = found(box(wall, wall), monkeypatch, slider(arm_mm=800.0))["pan"]
    assert pan.unit == "deg"
    for told in (pan.plus, pan.minus):
        assert told <= expected
        assert told == expected or told >= expected * (1.0 - 1.07 * NEAR)


def test_a_rig_that_is_broken_has_no_tolerance_and_says_why(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    network = box(-1.0, 5.0)
    names = found(network, monkeypatch)
    assert all(t.plus == t.minus == 0.0 for t in names.values())
    assert {t.limit for t in names.values()} == {"low_x/cam01"}
    # Asked once for the camera where it stands, never for its settings.
    assert network.asked == 1


@pytest.mark.parametrize(("low", "high"), [(8.0, 8.0), (3.0, 8.0), (8.0, 3.0)])
@pytest.mark.parametrize("steepness", [0.25, 1.0, 3.0])
def test_a_good_guess_saves_the_search(
    low: float, high: float, steepness: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    network = box(steepness * low, steepness * high)
    network.bend = lambda off: steepness * off
    x = found(network, monkeypatch)["x"]
    # As good as the guess: half of NEAR below the wall.
    assert (x.plus, x.minus) == pytest.approx((high * (1 - NEAR / 2), low * (1 - NEAR / 2)))
    # Where it stands, two trials on each side of a straight wall, one at the widest of the others:
    # 1 + 2 * 2 + 5 settings * 2 sides.
    assert network.asked == 1 + 4 + 10


def test_ends_closer_than_a_tenth_of_half_a_step_are_equal(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    coarse = found(box(0.02, 0.02), monkeypatch, slider(steps=(10.0, 1.0)))["x"]
    assert 0.0 <= coarse.plus <= 0.02
    fine = found(box(0.02, 0.02), monkeypatch, slider(steps=(0.01, 1.0)))["x"]
    # A tenth of half a hundredth of a millimetre.
    assert fine.plus == pytest.approx(0.02, abs=0.0005 + 0.02 * 1.07 * NEAR)


def test_the_smaller_end_names_the_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    assert found(box(9.0, 2.0), monkeypatch)["x"].limit == "high_x/cam01"
    assert found(box(2.0, 9.0), monkeypatch)["x"].limit == "low_x/cam01"
    assert found(box(900.0, 2.0), monkeypatch)["x"].limit == "high_x/cam01"


def test_every_mount_is_asked_by_its_own_number(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[float] = []
    numbers: set[int] = set()

    class Numbered(BoxNetwork):
        def broken(self, _index: int, camera: RigCamera) -> str:
            numbers.add(_index)
            assert camera.name == ("cam01", "cam02")[_index]
            return super().broken(_index, camera)

        def rows(self, _index: int, camera: RigCamera) -> dict[str, ConstraintRow]:
            assert camera.name == ("cam01", "cam02")[_index]
            return super().rows(_index, camera)

    network = Numbered(np.full(3, -900.0), np.full(3, 900.0))
    mounts = (slider("cam01"), slider("cam02"))
    out = tolerancer(network, mounts, monkeypatch, told.append).each()
    assert [t.camera for t in out] == ["cam01"] * 6 + ["cam02"] * 6
    assert numbers == {0, 1} and told == [0.5, 1.0]


def test_tolerancing_stops_when_it_is_told_to(monkeypatch: pytest.MonkeyPatch) -> None:
    stop = threading.Event()
    stop.set()
    with pytest.raises(CancelledError):
        tolerancer(box(1.0, 1.0), (slider(),), monkeypatch, cancel=stop).each()
    with pytest.raises(CancelledError):
        yield_share(lambda _: True, (), (slider(),), seed=0, trials=1, cancel=stop)


def test_half_a_step_or_what_making_may_be_off() -> None:
    def setting(unit: str, step: float) -> Setting:
        return Setting("s", unit, 0.0, step, -1.0, 1.0, "here")

    assert half_step(setting("mm", 1.0)) == 0.5 and half_step(setting("deg", 0.5)) == 0.25
    assert half_step(setting("mm", 0.0)) == MADE_MM and half_step(setting("deg", 0.0)) == MADE_DEG


@pytest.mark.parametrize("cameras", [1, 9, 10, 11, 50, 99, 100, 101, 1000])
def test_trials_follow_from_the_work_within_bounds(cameras: int) -> None:
    count = trials_for(cameras)
    assert LEAST_TRIALS <= count <= MOST_TRIALS
    if LEAST_TRIALS < count < MOST_TRIALS:
        assert count * cameras <= WORK < (count + 1) * cameras
    assert isinstance(count, int)


def test_trials_are_off_by_at_most_half_a_step_evenly() -> None:
    mount = slider(values={"x": 7.0, "pan": 3.0}, steps=(2.0, 1.0))
    fixed = replace(slider("other", {"y": 40.0}).camera, name="other")
    seen: list[np.ndarray] = []

    def judge(tried: tuple[RigCamera, ...]) -> bool:
        assert tried[1] is fixed
        assert tried[0].focus_distance_mm == mount.camera.focus_distance_mm
        seen.append(tried[0].pose.position_rig_mm)
        return bool(tried[0].pose.position_rig_mm[0] > 7.0)

    share = yield_share(
        judge, (mount.camera, fixed), (mount,), seed=3, trials=400, cancel=threading.Event()
    )
    off = np.array(seen) - [7.0, 0.0, 0.0]
    assert np.abs(off).max() <= 1.0
    # A uniform error of 1 mm has a deviation of 0.577; of 400 draws it is known to 0.577 * 5 / 28
    # with five sigma of the spread of a sample deviation (0.45 / sqrt(400) relative, times five).
    assert off.std(axis=0) == pytest.approx([0.577] * 3, rel=0.12)
    assert np.abs(off.mean(axis=0)).max() < 5.0 * 0.577 / 20.0
    assert share == np.mean(off[:, 0] > 0.0) and 0.375 < share < 0.625


def test_trials_repeat_with_their_seed_and_differ_between_seeds() -> None:
    def drawn(seed: int) -> list[float]:
        out: list[float] = []

        def judge(tried: tuple[RigCamera, ...]) -> bool:
            out.append(float(tried[0].pose.position_rig_mm[0]))
            return False

        mount = slider()
        share = yield_share(
            judge, (mount.camera,), (mount,), seed=seed, trials=3, cancel=threading.Event()
        )
        assert share == 0.0
        return out

    assert drawn(1) == drawn(1) != drawn(2)
    assert len(set(drawn(1))) == 3


def test_no_trials_tell_nothing() -> None:
    assert np.isnan(yield_share(bool, (), (), seed=0, trials=0, cancel=threading.Event()))
    assert yield_share(lambda _: True, (), (), seed=0, trials=5, cancel=threading.Event()) == 1.0
