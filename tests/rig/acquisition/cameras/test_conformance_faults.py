"""What every camera must do when it goes away, and when it comes back."""

from __future__ import annotations

import time

import pytest
from camera_rigs import SHOT, CameraRig, assert_set, shoot

from common.errors import DeviceError
from rig.acquisition.cameras.base import CameraSettings

SLACK_S = 0.25
"""For the scheduler of a busy machine, on top of a deadline."""
NAMED_S = 3.0
"""Every failure has a name after this time: the longest command deadline of the rigs here, and
the time to end a process."""


def test_closing_twice_changes_nothing(fresh_rig: CameraRig) -> None:
    device = fresh_rig.backend.open(fresh_rig.camera_id)
    device.arm(SHOT)
    device.close()
    device.close()
    health = device.health()
    assert not health.connected
    assert not health.armed
    assert "closed" in health.problem
    with pytest.raises(DeviceError) as caught:
        device.arm(SHOT)
    assert caught.value.code == "device/camera-gone"
    assert device.wait_frames(1, 0.05) == ()
    again = fresh_rig.backend.open(fresh_rig.camera_id)
    assert len(shoot(fresh_rig, again, 1)) >= 1
    fresh_rig.backend.close()
    assert not again.health().connected


def test_an_unplugged_camera_is_named_in_time(fresh_rig: CameraRig) -> None:
    device = fresh_rig.backend.open(fresh_rig.camera_id)
    assert len(shoot(fresh_rig, device, 1)) >= 1
    device.arm(SHOT)
    fresh_rig.unplug(device)
    began = time.monotonic()
    device.wait_frames(1000, 0.3)
    assert time.monotonic() - began < 0.3 + SLACK_S
    health = device.health()
    assert time.monotonic() - began < NAMED_S
    assert not health.connected
    assert not health.armed
    assert health.problem
    if fresh_rig.plug is None:
        return  # only its process went: the next command brings the camera back, see below
    began = time.monotonic()
    with pytest.raises(DeviceError) as caught:
        device.arm(SHOT)
    assert time.monotonic() - began < NAMED_S
    assert caught.value.code == "device/camera-gone"
    assert fresh_rig.camera_id in str(caught.value)
    device.disarm()


def test_a_camera_that_is_plugged_in_again_goes_on(fresh_rig: CameraRig) -> None:
    device = fresh_rig.backend.open(fresh_rig.camera_id)
    device.configure(fresh_rig.settings)
    fresh_rig.unplug(device)
    time.sleep(0.1)
    if fresh_rig.plug is not None:
        if device.health().connected:
            pytest.fail("it was not noticed that the camera is gone")
        fresh_rig.plug()
    assert len(shoot(fresh_rig, device, 1)) >= 1
    assert_set(device.configure(CameraSettings()), fresh_rig.settings, fresh_rig.tolerance)
