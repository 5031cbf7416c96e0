"""A capture from arming to commit: the barrier, the ways out, and being asked twice."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from memorybench import BenchMaker
from memoryrig import (
    BoxScript,
    CameraScript,
    MemoryBox,
    MemoryDevices,
    line_fit,
    memory_station,
    with_camera,
    with_policy,
)

from common.errors import CancelledError, ConflictError, DeviceError, InputError, InterlockError
from common.progress import Progress
from rig.acquisition.cameras.base import TimestampKind, TriggerKind
from rig.acquisition.capture.rig import Rig
from rig.acquisition.session.naming import BOX_ID_LENGTH
from rig.acquisition.session.verify import verify_session
from rig.acquisition.station.spec import Interlock, TriggerPlan


def disarmed(bench: object) -> bool:
    devices = bench.devices
    return devices.box.armed is None and not any(
        camera.armed for camera in devices.backend.cameras.values()
    )


def test_a_capture_is_complete_synchronised_and_filed(bench: BenchMaker) -> None:
    made = bench()
    seen: list[Progress] = []
    result = made.rig.capture(made.session, "smile-1", progress=seen.append)
    record = result.record
    assert (record.state, record.missing, record.faults) == ("complete", {}, [])
    assert result.error is None and not result.repeated
    assert record.verdict.state == "synchronised" and record.verdict.level == "B"
    assert [frame.camera for frame in record.frames] == ["cam01", "cam02", "cam03"]
    assert {frame.metadata["truth"] for frame in record.frames} == {f"{made.box.fired[0]}/1"}
    assert disarmed(made)
    assert verify_session(made.session.folder).whole
    fractions = [step.fraction for step in seen]
    assert fractions == sorted(fractions) and fractions[-1] == 1.0
    assert {"arming cameras", "firing", "writing"} <= {step.stage for step in seen}


def test_while_one_is_waited_for_the_cameras_that_are_done_are_told(bench: BenchMaker) -> None:
    station = with_policy(memory_station(), frame_deadline_s=0.5)
    made = bench(station, {"cam01": CameraScript(miss=frozenset({1}))})
    seen: list[Progress] = []
    made.rig.capture(made.session, "smile", progress=seen.append)
    waiting = {s.fraction for s in seen if s.stage == "waiting for pictures"}
    # Two cameras of three, of the way from 0.4 to 0.7.
    assert any(fraction == pytest.approx(0.6) for fraction in waiting)


def test_a_burst_pairs_every_shot(bench: BenchMaker) -> None:
    made = bench()
    record = made.rig.capture(made.session, "burst", shots=4, interval_us=25_000.0).record
    assert record.state == "complete"
    for frame in record.frames:
        assert frame.metadata["truth"] == f"{made.box.fired[0]}/{frame.shot}"
        assert frame.instant == frame.shot
        assert frame.file.path == f"images/rig1/{frame.camera}/{frame.shot:06d}.jpg"
    second = made.rig.capture(made.session, "after").record
    assert {frame.instant for frame in second.frames} == {5}


def test_the_same_id_again_returns_what_is_there_and_fires_nothing(bench: BenchMaker) -> None:
    made = bench()
    first = made.rig.capture(made.session, "smile")
    again = made.rig.capture(made.session, "smile")
    assert again.repeated and again.record == first.record
    assert len(made.box.fired) == 1


def test_the_box_never_sees_a_name_twice(bench: BenchMaker) -> None:
    made = bench(box=BoxScript(fires=False))
    for _ in range(2):
        # Refused and tried again under the client's same id.
        with pytest.raises(DeviceError, match="did not fire"):
            made.rig.capture(made.session, "a-long-capture-id-that-no-box-would-take")
    made.box.script = BoxScript()
    made.rig.capture(made.session, "a-long-capture-id-that-no-box-would-take")
    names = list(made.box._requests)
    assert len(names) == len(set(names)) == 3
    assert all(len(name) == BOX_ID_LENGTH for name in names)


def test_one_camera_that_is_not_ready_stops_the_capture_before_it_fires(bench: BenchMaker) -> None:
    made = bench(scripts={"cam02": CameraScript(not_ready="the card is full")})
    with pytest.raises(DeviceError, match=r"1 of 3 cameras .*cam02: the card is full") as error:
        made.rig.capture(made.session, "smile")
    assert error.value.code == "device/camera-not-ready"
    assert not made.box.fired and disarmed(made)
    assert verify_session(made.session.folder).whole
    assert made.session.committed("smile") is None, "the id is free"


def test_a_partial_capture_says_who_is_missing_and_gives_it_no_edge(bench: BenchMaker) -> None:
    made = bench(scripts={"cam02": CameraScript(not_ready="the card is full")})
    result = made.rig.capture(made.session, "smile", allow_partial=True)
    assert result.record.state == "partial" and result.error is None
    assert result.record.missing == {"cam02": [1]}
    assert [fault.kind for fault in result.record.faults] == ["not-ready"]
    request = made.box._requests[made.box.fired[0]]
    assert set(request.pulses) == {1, 3}
    assert verify_session(made.session.folder).whole


def test_a_camera_that_hangs_while_arming_is_not_waited_for(bench: BenchMaker) -> None:
    station = with_policy(memory_station(), ready_deadline_s=0.15)
    made = bench(station, {"cam03": CameraScript(arm_hangs_s=0.6)})
    began = time.monotonic()
    with pytest.raises(DeviceError, match=r"cam03: it did not answer within 0\.15 s"):
        made.rig.capture(made.session, "smile")
    assert time.monotonic() - began < 0.5
    assert not made.box.fired
    # The hanging job ends some time; the disarm that waits behind it is then done.
    camera = made.devices.camera("cam03")
    until = time.monotonic() + 2.0
    while (camera.arms == 0 or camera.armed) and time.monotonic() < until:
        time.sleep(0.01)
    assert camera.arms == 1 and not camera.armed


def test_an_absent_camera_is_tried_again_at_each_capture(bench: BenchMaker) -> None:
    made = bench(scripts={"cam02": CameraScript(not_ready="absent")})
    assert made.rig.health().cameras["cam02"].problem == "it is not plugged in"
    with pytest.raises(DeviceError, match="cam02: it is not plugged in"):
        made.rig.capture(made.session, "smile")
    made.devices.backend._scripts = {}
    assert made.rig.capture(made.session, "smile").record.state == "complete"


def test_an_unplugged_camera_is_opened_again(bench: BenchMaker) -> None:
    made = bench(scripts={"cam02": CameraScript(unplugged=True)})
    result = made.rig.capture(made.session, "one")
    assert result.record.missing == {"cam02": [1]}
    assert "the camera is unplugged" in result.record.faults[0].text
    assert result.error is not None and result.error.code == "device/capture-partial"
    made.devices.backend._scripts = {}
    assert made.rig.capture(made.session, "two").record.state == "complete"


@pytest.mark.parametrize(
    ("script", "policy", "refused"),
    [
        (BoxScript(open_interlock=True), Interlock.IF_PRESENT, InterlockError),
        (BoxScript(open_interlock=True), Interlock.REQUIRED, InterlockError),
        (BoxScript(no_interlock=True), Interlock.REQUIRED, InputError),
        (BoxScript(no_interlock=True), Interlock.IF_PRESENT, None),
    ],
)
def test_the_interlock(
    bench: BenchMaker, script: BoxScript, policy: Interlock, refused: type[Exception] | None
) -> None:
    station = memory_station(trigger=TriggerPlan("rigwright", "memory:", interlock=policy))
    made = bench(station, box=script)
    if refused is None:
        assert made.rig.capture(made.session, "smile").record.state == "complete"
        return
    with pytest.raises(refused) as caught:
        made.rig.capture(made.session, "smile")
    # Nobody can close an interlock that is not there: then the station file is to be changed.
    assert ("close it" in str(caught.value)) == script.open_interlock
    assert not made.box.fired and disarmed(made)
    assert made.session.committed("smile") is None


def test_an_interlock_that_opens_after_arming(bench: BenchMaker) -> None:
    made = bench()
    arm = made.box.arm

    def arm_and_open(request: object) -> None:
        arm(request)
        made.box.script = BoxScript(open_interlock=True)

    made.box.arm = arm_and_open
    with pytest.raises(InterlockError):
        made.rig.capture(made.session, "smile")
    assert disarmed(made)
    assert made.session.committed("smile") is None, "refused by the box: the id is free"


def test_a_dry_run_does_all_but_fire(bench: BenchMaker) -> None:
    made = bench()
    done = made.rig.dry_run()
    assert done.ready == ("cam01", "cam02", "cam03") and not done.faults
    assert not made.box.fired and disarmed(made)
    assert len(made.box._requests) == 1, "the box was armed"
    assert all(camera.arms == 1 for camera in made.devices.backend.cameras.values())


def test_a_self_test_names_each_part(bench: BenchMaker, tmp_path: Path) -> None:
    made = bench(scripts={"cam02": CameraScript(not_ready="the card is full")})
    found = made.rig.self_test(tmp_path)
    assert not found.ok
    assert {check.name: check.ok for check in found.checks} == {
        "trigger box": True,
        "interlock": True,
        "clock": True,
        "camera cam01": True,
        "camera cam02": False,
        "camera cam03": True,
        "free space": True,
    }
    assert not made.box.fired and disarmed(made) and not made.box._requests


class AfterStage:
    """A cancel token that is set once a stage is reached."""

    def __init__(self, stage: str) -> None:
        self.stage, self.reached = stage, False

    def __call__(self, progress: Progress) -> None:
        self.reached |= progress.stage == self.stage

    def is_set(self) -> bool:
        return self.reached


@pytest.mark.parametrize("stage", ["checking", "arming cameras", "arming the box"])
def test_cancelled_before_firing_nothing_has_happened(bench: BenchMaker, stage: str) -> None:
    made = bench()
    token = AfterStage(stage)
    with pytest.raises(CancelledError):
        made.rig.capture(made.session, "smile", progress=token, cancel=token)
    assert not made.box.fired and disarmed(made)
    assert verify_session(made.session.folder).whole
    assert made.rig.capture(made.session, "smile").record.state == "complete"


def test_cancelled_after_firing_the_id_is_spent(bench: BenchMaker) -> None:
    station = with_policy(memory_station(), frame_deadline_s=5.0)
    made = bench(station, {"cam01": CameraScript(miss=frozenset({1}))})
    token = AfterStage("waiting for pictures")
    began = time.monotonic()
    with pytest.raises(CancelledError):
        made.rig.capture(made.session, "smile", progress=token, cancel=token)
    assert time.monotonic() - began < 1.0
    assert made.box.aborts == 1 and disarmed(made)
    with pytest.raises(ConflictError, match="interrupted after it fired"):
        made.rig.capture(made.session, "smile")
    assert len(made.box.fired) == 1
    assert verify_session(made.session.folder).whole


def in_background(job: Callable[[], object]) -> tuple[threading.Thread, list[BaseException]]:
    errors: list[BaseException] = []

    def run() -> None:
        try:
            job()
        except BaseException as error:  # noqa: BLE001  handed to the test
            errors.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    return thread, errors


def test_abort_is_allowed_always_and_others_are_told_who_is_busy(bench: BenchMaker) -> None:
    station = with_policy(memory_station(), frame_deadline_s=5.0)
    made = bench(station, {"cam01": CameraScript(miss=frozenset({1}))})
    thread, errors = in_background(lambda: made.rig.capture(made.session, "smile"))
    until = time.monotonic() + 2.0
    while not made.box.fired and time.monotonic() < until:
        time.sleep(0.005)
    assert made.rig.health().busy == "capture smile"
    with pytest.raises(ConflictError, match="busy with capture smile"):
        made.rig.dry_run()
    made.rig.abort()
    thread.join(2.0)
    assert [type(error) for error in errors] == [CancelledError]
    assert made.box.aborts >= 1 and disarmed(made)
    assert made.rig.health().busy is None


def test_a_lost_box_whose_shot_the_pictures_show(bench: BenchMaker) -> None:
    made = bench(box=BoxScript(lost_while_firing=True))
    record = made.rig.capture(made.session, "smile").record
    assert record.state == "complete"
    assert record.trigger is not None and record.trigger.outcome == "unknown"
    assert {frame.told_by for frame in record.frames} == {"programmed"}
    (fault,) = record.faults
    assert fault.kind == "box-lost" and "only the pictures show what was fired" in fault.text


def test_a_lost_box_and_no_picture_leave_the_fate_unknown(bench: BenchMaker) -> None:
    made = bench(
        scripts={f"cam{k:02d}": CameraScript(miss=frozenset({1})) for k in (1, 2, 3)},
        box=BoxScript(lost_while_firing=True),
    )
    with pytest.raises(DeviceError, match="cannot be told") as error:
        made.rig.capture(made.session, "smile")
    assert error.value.code == "device/trigger-unknown"
    assert disarmed(made)
    with pytest.raises(ConflictError, match="may have fired") as refused:
        made.rig.capture(made.session, "smile")
    assert refused.value.code == "conflict/capture-unknown"
    assert len(made.box.fired) == 1
    assert verify_session(made.session.folder).whole


def test_a_burst_stopped_on_the_way_keeps_its_whole_shots(bench: BenchMaker) -> None:
    made = bench(box=BoxScript(stop_after=2))
    result = made.rig.capture(made.session, "burst", shots=4, interval_us=25_000.0)
    record = result.record
    assert record.state == "partial"
    assert record.missing == {f"cam{k:02d}": [3, 4] for k in (1, 2, 3)}
    assert [fault.kind for fault in record.faults] == ["not-fired"]
    assert "2 of 4 shots (the interlock was opened)" in record.faults[0].text
    assert result.error is not None


def test_software_triggers_need_no_box(bench: BenchMaker) -> None:
    cameras = tuple(replace(camera, output=None) for camera in memory_station().cameras)
    scripts = {
        camera.name: CameraScript(trigger=TriggerKind.SOFTWARE, lag_us=500.0) for camera in cameras
    }
    made = bench(memory_station(trigger=None, cameras=cameras), scripts)
    record = made.rig.capture(made.session, "burst", shots=2, interval_us=30_000.0).record
    assert record.state == "complete" and record.trigger is None
    assert {camera.sync_class for camera in record.cameras} == {"software"}
    assert {frame.told_by for frame in record.frames} == {"command"}
    assert record.verdict.level == "B"


def test_cameras_that_tell_nothing_are_paired_by_arrival_and_not_believed(
    bench: BenchMaker,
) -> None:
    scripts = {
        name: CameraScript(timestamps=TimestampKind.NONE) for name in ("cam01", "cam02", "cam03")
    }
    made = bench(scripts=scripts)
    record = made.rig.capture(made.session, "smile").record
    assert record.state == "complete"
    assert {frame.method for frame in record.frames} == {"arrival-order"}
    assert record.verdict.state == "unproven" and record.verdict.level == "A"
    assert any("no usable time stamps of cam01" in text for text in record.verdict.lacking)


@pytest.mark.parametrize(
    ("output", "trigger"), [(None, TriggerKind.SOFTWARE), (2, TriggerKind.EDGE)]
)
def test_a_clock_that_is_learned_from_pictures_says_fire_twice(
    bench: BenchMaker, output: int | None, trigger: TriggerKind
) -> None:
    station = with_camera(memory_station(), "cam02", output=output)
    made = bench(station, {"cam02": CameraScript(latch=False, trigger=trigger)})
    record = made.rig.capture(made.session, "smile").record
    told = [fault.text for fault in record.faults if fault.kind == "by-arrival"]
    assert len(told) == 1
    assert told[0].endswith("fire twice") == (output is None)


def test_raw_files_are_filed_beside_the_pictures(bench: BenchMaker) -> None:
    station = with_policy(memory_station(), settle_s=0.05)
    made = bench(station, {"cam01": CameraScript(raw_too=True)})
    record = made.rig.capture(made.session, "smile").record
    assert record.state == "complete"
    paths = {frame.file.path for frame in record.frames if frame.camera == "cam01"}
    assert paths == {"images/rig1/cam01/000001.jpg", "raw/rig1/cam01/000001.nef"}
    assert verify_session(made.session.folder).whole


def test_bursts_that_no_stamp_could_tell_apart_are_refused_before_anything(
    bench: BenchMaker,
) -> None:
    made = bench()
    with pytest.raises(InputError, match="cannot be told from each other by camera cam01"):
        made.rig.capture(made.session, "burst", shots=3, interval_us=4000.0)
    with pytest.raises(InputError, match="needs an interval"):
        made.rig.capture(made.session, "burst", shots=3)
    with pytest.raises(InputError, match="0 shots"):
        made.rig.capture(made.session, "burst", shots=0)
    with pytest.raises(InputError, match="is no capture id"):
        made.rig.capture(made.session, "../evil")
    assert not made.devices.box._requests


def test_too_little_space_stops_a_capture_before_it_fires(bench: BenchMaker) -> None:
    made = bench(with_policy(memory_station(), min_free_mb=1e9))
    with pytest.raises(ConflictError, match="MB are free") as error:
        made.rig.capture(made.session, "smile")
    assert error.value.code == "conflict/disk-full"
    assert not made.box._requests


def test_a_session_is_continued_with_its_own_rig_only(bench: BenchMaker) -> None:
    made = bench()
    made.rig.close()
    other = bench(with_camera(memory_station(), "cam02", id="SN99"))
    with pytest.raises(ConflictError, match="begun with another rig"):
        other.rig.capture(made.session, "smile")
    assert not other.box.fired


def test_a_second_process_is_refused_in_one_sentence(bench: BenchMaker) -> None:
    bench()
    with pytest.raises(ConflictError, match=r"trigger box memory: is in use by process \d+ on "):
        Rig(memory_station(), MemoryDevices(), locks=bench.folder / "locks", fit=line_fit)


def test_a_box_that_is_gone_leaves_nothing_open(tmp_path: Path) -> None:
    devices = MemoryDevices(box=MemoryBox(BoxScript(gone=True)))
    for _ in range(2):
        # Twice: the first failure let go of its locks.
        with pytest.raises(DeviceError, match="does not answer"):
            Rig(memory_station(), devices, locks=tmp_path, fit=line_fit)
    assert devices.closed


def test_a_station_without_one_camera_is_refused(tmp_path: Path) -> None:
    scripts = {f"cam{k:02d}": CameraScript(not_ready="absent") for k in (1, 2, 3)}
    devices = MemoryDevices(scripts)
    with pytest.raises(DeviceError, match="no camera could be opened") as caught:
        Rig(memory_station(), devices, locks=tmp_path, fit=line_fit)
    assert caught.value.remedy == "plug it in", "what the backends say, and once"
    assert devices.closed and devices.box.closed


def test_closing_lets_everything_go(bench: BenchMaker) -> None:
    made = bench()
    made.rig.close()
    made.rig.close()
    assert made.box.closed and made.devices.closed
    assert all(camera.closed for camera in made.devices.backend.cameras.values())
    bench()


def test_focus_lines_lead_their_shutters(bench: BenchMaker) -> None:
    station = with_camera(
        memory_station(), "cam02", focus_output=9, focus_lead_us=3000.0, delay_us=500.0
    )
    made = bench(station)
    assert made.rig.capture(made.session, "smile").record.state == "complete"
    pulses = made.box._requests[made.box.fired[0]].pulses
    assert pulses[9].delay_us == 0.0 and pulses[9].width_us == 4000.0
    assert (pulses[1].delay_us, pulses[2].delay_us) == (2500.0, 3000.0)


def test_what_is_filed_about_a_capture(bench: BenchMaker) -> None:
    made = bench()
    made.rig.capture(made.session, "smile")
    folder = made.session.folder
    lines = [json.loads(line) for line in (folder / "trigger.jsonl").read_text().splitlines()]
    assert [line["kind"] for line in lines].count("edge") == 6
    assert lines[0]["outcome"] == "fired"
    rows = (folder / "frames.csv").read_text().splitlines()
    assert len(rows) == 4 and rows[0].startswith("capture_id,shot,instant,camera,file,sha256")
    sync = json.loads((folder / "checks/sync.json").read_text())
    assert sync["captures"][0]["verdict"]["state"] == "synchronised"
