"""What every camera must do, whatever it is reached by. One suite for all backends."""

from __future__ import annotations

import dataclasses
import time

import pytest
from camera_rigs import SHOT, CameraRig, assert_set, free_running, shoot

from common.errors import DeviceError, InputError, RigwrightError
from rig.acquisition.cameras.base import (
    ArmSpec,
    CameraDevice,
    CameraSettings,
    FrameStatus,
    Previewing,
    TimestampKind,
    TriggerKind,
)

SLACK_S = 0.25
"""For the scheduler of a busy machine, on top of a deadline."""


def test_discovery_names_the_same_cameras_each_time(
    camera_rig: CameraRig, device: CameraDevice
) -> None:
    first, second = camera_rig.backend.discover(), camera_rig.backend.discover()
    assert first == second
    ids = [info.id for info in first]
    assert device.info.id in ids
    assert len(set(ids)) == len(ids)
    assert {info.backend for info in first} == {camera_rig.backend.name}


def test_the_camera_opened_is_the_one_asked_for(
    camera_rig: CameraRig, device: CameraDevice
) -> None:
    assert device.info.id == camera_rig.camera_id
    assert device.health().connected
    assert device.health().problem == ""


def test_a_camera_that_is_not_there_is_named(camera_rig: CameraRig) -> None:
    with pytest.raises(RigwrightError, match=r"no-such-camera") as caught:
        camera_rig.backend.open("no-such-camera")
    assert caught.value.code in ("device/camera-gone", "not-found/camera")


def test_settings_come_back_as_the_camera_has_them(
    camera_rig: CameraRig, device: CameraDevice
) -> None:
    wanted = {k for k, v in dataclasses.asdict(camera_rig.settings).items() if v is not None}
    assert wanted <= device.capabilities.settable
    real = device.configure(camera_rig.settings)
    assert_set(real, camera_rig.settings, camera_rig.tolerance)
    assert device.configure(CameraSettings()) == real


def test_settings_a_camera_cannot_have_are_refused(
    camera_rig: CameraRig, device: CameraDevice
) -> None:
    before = device.configure(CameraSettings())
    with pytest.raises(InputError) as caught:
        device.configure(camera_rig.refused)
    assert caught.value.code == "input/camera-setting"
    assert device.configure(CameraSettings()) == before


def test_frames_are_whole_and_say_whose_they_are(
    camera_rig: CameraRig, device: CameraDevice
) -> None:
    began = time.monotonic_ns()
    frames = shoot(camera_rig, device, 3)
    assert len(frames) >= 3 if free_running(device) else len(frames) == 3
    for frame in frames:
        assert frame.camera_id == device.info.id
        assert frame.status is FrameStatus.OK
        assert (frame.pixels is None) != (frame.encoded is None)
        assert bool(frame.media_type) == (frame.encoded is not None)
        assert began < frame.arrived_host_ns < time.monotonic_ns()
    arrivals = [frame.arrived_host_ns for frame in frames]
    assert arrivals == sorted(arrivals)


def test_what_the_capabilities_promise_is_in_the_frames(
    camera_rig: CameraRig, device: CameraDevice
) -> None:
    can = device.capabilities
    frames = shoot(camera_rig, device, 2)
    for frame in frames:
        assert (frame.counter is not None) == can.frame_counter
        stamped = can.timestamps in (TimestampKind.DEVICE, TimestampKind.PTP)
        assert (frame.device_ns is not None) == stamped
    if can.frame_counter:
        assert len({frame.counter for frame in frames}) == len(frames)


def test_a_look_between_captures_changes_nothing(
    camera_rig: CameraRig, device: CameraDevice
) -> None:
    device.disarm()
    of_files = device.info.backend == "folder" or device.info.model == "CV_IMAGES"
    assert device.capabilities.previews == (not of_files)
    if not device.capabilities.previews:
        return
    assert isinstance(device, Previewing)
    before = dict(device.health().counters)
    if device.info.backend == "gphoto2":  # its virtual body promises what it has not
        with pytest.raises(DeviceError, match="Unsupported"):
            device.preview(lambda: False)
    else:
        seen = device.preview(lambda: False)
        assert seen is not None and seen.has_picture
        assert seen.status is FrameStatus.OK
    assert device.preview(lambda: True) is None
    frames = shoot(camera_rig, device, 2)
    assert len(frames) >= 2 if free_running(device) else len(frames) == 2
    after = device.health().counters
    assert after.get("stale_frames", 0) == before.get("stale_frames", 0)


def test_frames_from_before_arming_are_dropped_and_counted(
    camera_rig: CameraRig, device: CameraDevice
) -> None:
    stale = device.health().counters.get("stale_frames", 0)
    device.arm(SHOT)
    camera_rig.shoot(device)
    time.sleep(camera_rig.frame_s)
    device.arm(SHOT)
    armed_ns = time.monotonic_ns()
    camera_rig.shoot(device)
    frames = device.wait_frames(1, camera_rig.frame_s + 1.0)
    assert device.health().counters["stale_frames"] > stale
    if free_running(device):
        # The frame being sent while the camera was armed began before; the next did not.
        assert frames[-1].arrived_host_ns > armed_ns
    else:
        assert len(frames) == 1
        assert frames[0].arrived_host_ns > armed_ns


def test_fewer_frames_come_back_when_time_is_up(
    camera_rig: CameraRig, device: CameraDevice
) -> None:
    device.arm(ArmSpec("capture", 3, 5.0))
    camera_rig.shoot(device)
    device.wait_frames(1, camera_rig.frame_s + 1.0)
    began = time.monotonic()
    frames = device.wait_frames(1000, 0.2)
    assert 0.2 <= time.monotonic() - began < 0.2 + SLACK_S
    assert 1 <= len(frames) < 1000


def test_no_frame_at_all_is_an_empty_answer(camera_rig: CameraRig, device: CameraDevice) -> None:
    device.arm(SHOT)
    device.disarm()
    assert device.wait_frames(1, 0.05) == () or free_running(device)
    assert not device.health().armed
    del camera_rig


def test_disarming_twice_changes_nothing(camera_rig: CameraRig, device: CameraDevice) -> None:
    device.arm(SHOT)
    assert device.health().armed
    device.disarm()
    device.disarm()
    assert not device.health().armed
    assert device.health().connected
    assert len(shoot(camera_rig, device, 1)) >= 1


def test_settings_may_change_while_armed(camera_rig: CameraRig, device: CameraDevice) -> None:
    device.arm(SHOT)
    device.configure(camera_rig.settings)
    assert len(shoot(camera_rig, device, 1)) >= 1
    assert device.health().counters.get("restarts", 0) == 0


def test_a_software_trigger_is_refused_where_there_is_none(device: CameraDevice) -> None:
    device.arm(SHOT)
    if device.capabilities.trigger is TriggerKind.SOFTWARE:
        device.software_trigger()
        device.disarm()
        with pytest.raises(DeviceError) as unready:
            device.software_trigger()
        assert unready.value.code == "device/camera-not-ready"
    else:
        with pytest.raises(InputError) as refused:
            device.software_trigger()
        assert refused.value.code == "input/camera-trigger"


def test_clock_readings_are_brackets_or_none(camera_rig: CameraRig, device: CameraDevice) -> None:
    shoot(camera_rig, device, 2)
    samples = device.clock_samples(2)
    if device.capabilities.timestamps in (TimestampKind.DEVICE, TimestampKind.PTP):
        assert len(samples) == 2
    else:
        assert samples == ()
    assert all(sample.host_before_ns <= sample.host_after_ns for sample in samples)
