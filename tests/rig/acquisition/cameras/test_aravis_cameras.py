"""Against Aravis's fake GigE Vision camera: a process of its own that speaks the real protocol."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest
from camera_rigs import CameraRig, FakeGigE, aravis_rig

from common.errors import DeviceError, InputError
from rig.acquisition.cameras.aravis import INSTALL, AravisBackend, find_python
from rig.acquisition.cameras.base import (
    ArmSpec,
    CameraDevice,
    CameraSettings,
    FrameStatus,
    TriggerKind,
)
from rig.acquisition.cameras.remotecamera import RemoteCamera
from rig.devices.registry import make_backend

pytestmark = pytest.mark.needs_aravis

FIRST_ID, LAST_ID = 65401, 65535
FAKE_PERIOD_S = 0.04
"""The fake looks for triggers 25 times a second."""


@contextlib.contextmanager
def fake_camera(serial: str, lost_per_1000: int = 0, **options: object) -> Iterator[CameraDevice]:
    fake = FakeGigE(serial, lost_per_1000=lost_per_1000)
    try:
        backend = AravisBackend(addresses={serial: "127.0.0.1"}, **options)
        try:
            yield backend.open(serial)
        finally:
            backend.close()
    finally:
        fake.stop()


def test_frame_ids_wrap_past_zero_without_a_gap() -> None:
    with fake_camera("RW11", trigger="none", frame_rate_hz=100.0) as camera:
        can = camera.capabilities
        assert can.trigger is TriggerKind.NONE
        count = LAST_ID - FIRST_ID + 5
        camera.arm(ArmSpec("wrap", count, 10.0))
        frames = camera.wait_frames(count, 10.0)
    ids = [frame.counter for frame in frames]
    assert ids[0] == FIRST_ID
    assert LAST_ID in ids
    assert ids[ids.index(LAST_ID) + 1] == 1
    modulus = can.frame_counter_modulus
    assert modulus == 65535
    assert can.frame_counter_skips_zero
    steps = [(b - a) % modulus for a, b in pairwise(ids) if a and b]
    assert set(steps) == {1}


def test_an_armed_line_makes_no_frame_without_an_edge() -> None:
    with fake_camera("RW12") as camera:
        assert camera.capabilities.trigger is TriggerKind.EDGE
        camera.arm(ArmSpec("edge", 1, 1.0))
        assert camera.wait_frames(1, 5 * FAKE_PERIOD_S) == ()
        # The source really is the line: a command, sent past our own check, changes nothing.
        assert isinstance(camera, RemoteCamera)
        camera._ask("trigger")
        assert camera.wait_frames(1, 5 * FAKE_PERIOD_S) == ()


def test_a_frame_with_packets_missing_is_incomplete() -> None:
    with fake_camera("RW13", lost_per_1000=20, trigger="none") as camera:
        camera.arm(ArmSpec("loss", 8, 1.0))
        frames = camera.wait_frames(8, 3.0)
        camera.disarm()
        health = camera.health()
    # 20 of 1000 packets, about 190 packets a frame: a whole one in 47 frames.
    damaged = [frame for frame in frames if frame.status is FrameStatus.INCOMPLETE]
    assert len(damaged) >= 3
    assert "missing-packets" in {frame.metadata["transport"] for frame in damaged}
    assert all("packets of it did not arrive" in frame.metadata["problem"] for frame in damaged)
    assert health.connected
    assert health.counters["incomplete_frames"] >= len(damaged)


def test_an_unplugged_camera_is_named_by_our_deadline_not_the_librarys(tmp_path: Path) -> None:
    with aravis_rig(tmp_path, "RW15", command_deadline_s=0.8) as world:
        name_the_loss(world)


def name_the_loss(world: CameraRig) -> None:
    camera = world.backend.open("RW15")
    camera.arm(ArmSpec("gone", 1, 1.0))
    world.unplug(camera)
    began = time.monotonic()
    with pytest.raises(DeviceError, match=r"RW15") as caught:
        camera.software_trigger()
    # Aravis itself takes 2.5 s to give a command up, and 6 s to notice by its own heartbeat.
    assert time.monotonic() - began < 0.8 + 0.4
    assert caught.value.code == "device/camera-gone"
    began = time.monotonic()
    assert camera.wait_frames(1, 1.0) == ()
    assert time.monotonic() - began < 0.2


def test_a_camera_that_was_without_power_is_set_up_again(tmp_path: Path) -> None:
    with aravis_rig(tmp_path, "RW16") as world:
        camera = world.backend.open("RW16")
        camera.configure(CameraSettings(exposure_us=4321.0))
        world.unplug(camera)
        assert world.plug
        world.plug()
        # It answers, so only its having forgotten who controls it tells.
        assert camera.health().problem == "the camera does not answer (it was started anew)"
        camera.arm(ArmSpec("again", 1, 1.0))
        assert camera.wait_frames(1, 3 * FAKE_PERIOD_S) == ()
        camera.software_trigger()
        (frame,) = camera.wait_frames(1, 1.0)
        assert frame.exposure_us == 4321.0


def test_a_line_the_camera_has_not_is_refused(tmp_path: Path) -> None:
    with (
        aravis_rig(tmp_path, "RW18", trigger="edge", trigger_line="Line7") as world,
        pytest.raises(InputError, match=r"'Line7'.*Line0, Software"),
    ):
        world.backend.open("RW18")


def test_a_python_without_aravis_is_told_how_to_get_it() -> None:
    with pytest.raises(DeviceError) as caught:
        make_backend("aravis", {"python": "/nonexistent/python3"})
    assert caught.value.code == "device/backend-missing"
    assert INSTALL in caught.value.remedy


def test_the_python_found_has_aravis() -> None:
    code = "import gi; gi.require_version('Aravis', '0.8')"
    assert subprocess.run([find_python(), "-c", code], check=False).returncode == 0
    assert sys.version_info >= (3, 11)
