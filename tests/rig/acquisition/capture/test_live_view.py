"""Live pictures of a rig: shared, slow, and never in the way of a capture."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import pytest
from memorybench import Bench, BenchMaker
from memoryrig import CameraScript

from common.errors import ConflictError, DeviceError, NotFoundError, RigwrightError
from rig.acquisition.capture import liveview

SHOWS = {name: CameraScript(previews=True) for name in ("cam01", "cam02", "cam03")}


def code(act: Callable[[], object]) -> str:
    with pytest.raises(RigwrightError) as caught:
        act()
    return caught.value.code


def test_whoever_asks_too_soon_is_shown_the_same_picture(
    bench: BenchMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    live = bench(scripts=SHOWS).rig.live
    first = live.look("cam01")
    assert live.look("cam01") is first
    assert live.known("cam01", 1) is first and live.known("cam01", 2) is None
    assert live.look("cam02").frame.camera_id == "SN02"
    monkeypatch.setattr(liveview, "LEAST_INTERVAL_S", 0.0)
    second = live.look("cam01")
    assert (first.number, second.number) == (1, 2)
    assert live.known("cam01", 1) is None and live.known("cam02", 2) is None


def test_a_camera_has_the_settings_of_its_plan_before_it_shows_anything(bench: BenchMaker) -> None:
    made = bench(scripts=SHOWS)
    camera = made.devices.camera("cam01")
    made.rig.live.look("cam01")
    assert camera.configured == 1
    liveview_again = made.rig.live
    liveview_again._sights.clear()
    made.rig.live.look("cam01")
    assert camera.configured == 1


def test_who_cannot_show_says_so(bench: BenchMaker) -> None:
    scripts = {"cam01": CameraScript(), "cam02": CameraScript(not_ready="absent")}
    made = bench(scripts={**SHOWS, **scripts})
    assert made.rig.health().previews == {"cam03"}
    assert code(lambda: made.rig.live.look("cam01")) == NotFoundError("preview", "", "").code
    assert code(lambda: made.rig.live.look("cam02")) == DeviceError("camera-gone", "", "").code


def looking(made: Bench, told: list[str]) -> threading.Thread:
    def look() -> None:
        told.append(code(lambda: made.rig.live.look("cam01")))

    thread = threading.Thread(target=look)
    thread.start()
    while made.devices.camera("cam01").showing == 0:
        time.sleep(0.001)
    return thread


def test_a_capture_ends_a_look_at_once_and_loses_nothing(bench: BenchMaker) -> None:
    """The look would take a minute; each camera has two seconds to be ready."""
    made = bench(scripts={**SHOWS, "cam01": CameraScript(previews=True, preview_s=60.0)})
    told: list[str] = []
    thread = looking(made, told)
    result = made.rig.capture(made.session, "one")
    thread.join(5.0)
    assert told == [ConflictError("rig-busy", "", "").code]
    assert (result.record.state, result.record.missing, result.record.faults) == (
        "complete",
        {},
        [],
    )
    assert result.record.verdict.state == "synchronised"


def test_nobody_looks_while_the_rig_is_busy(bench: BenchMaker) -> None:
    made = bench(scripts={**SHOWS, "cam02": CameraScript(previews=True, arm_hangs_s=0.4)})
    capture = threading.Thread(target=lambda: made.rig.capture(made.session, "one"))
    capture.start()
    while made.rig.health().busy is None:
        time.sleep(0.001)
    assert code(lambda: made.rig.live.look("cam01")) == "conflict/rig-busy"
    capture.join()
    assert made.devices.camera("cam01").showing == 0
    assert made.rig.live.look("cam01").number == 1


def test_a_camera_that_shows_nothing_is_told_as_slow(
    bench: BenchMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(liveview, "PATIENCE_S", 0.1)
    made = bench(scripts={**SHOWS, "cam01": CameraScript(previews=True, preview_s=60.0)})
    assert code(lambda: made.rig.live.look("cam01")) == "device/camera-slow"
    # Whoever gave up has left nothing behind that the next would wait for.
    record = made.rig.capture(made.session, "one").record
    assert record.state == "complete"


def test_only_so_many_may_wait(bench: BenchMaker, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(liveview, "MOST_LOOKERS", 1)
    made = bench(scripts={**SHOWS, "cam01": CameraScript(previews=True, preview_s=60.0)})
    told: list[str] = []
    thread = looking(made, told)
    assert code(lambda: made.rig.live.look("cam02")) == "conflict/too-many-look"
    made.rig.capture(made.session, "one")
    thread.join(5.0)
