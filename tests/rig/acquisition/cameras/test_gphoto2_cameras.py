"""Against the virtual body that comes with the gphoto2 package. It has no button: where the box
would press one, the tests send the body a command past our own check."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest
from camera_rigs import CameraRig, gphoto2_rig

from common.errors import DeviceError, InputError
from rig.acquisition.cameras.base import ArmSpec, CameraSettings, TriggerKind
from rig.acquisition.cameras.remotecamera import RemoteCamera

pytestmark = pytest.mark.needs_gphoto2

PICTURES_ON_THE_CARD = 26
"""The virtual body declares its card full after so many."""


@pytest.fixture
def edge(tmp_path: Path) -> Iterator[CameraRig]:
    rig = gphoto2_rig(tmp_path, trigger="edge")
    yield rig
    rig.close()


def opened(rig: CameraRig) -> RemoteCamera:
    camera = rig.backend.open(rig.camera_id)
    assert isinstance(camera, RemoteCamera)
    return camera


def press(camera: RemoteCamera) -> None:
    """What the cable of the trigger box does."""
    camera._ask("trigger")


def test_a_body_fired_from_outside_gives_its_files(edge: CameraRig, tmp_path: Path) -> None:
    camera = opened(edge)
    assert camera.capabilities.trigger is TriggerKind.EDGE
    camera.arm(ArmSpec("a", 3, 5.0))
    for _ in range(3):
        press(camera)
    frames = camera.wait_frames(3, 5.0)
    assert len(frames) == 3
    assert len({frame.metadata["file"] for frame in frames}) == 3
    original = (tmp_path / "card" / "GP1.JPG").read_bytes()
    assert {frame.encoded for frame in frames} == {original}
    assert {frame.media_type for frame in frames} == {"image/jpeg"}


def test_nothing_is_asked_of_a_body_between_arming_and_waiting(edge: CameraRig) -> None:
    camera = opened(edge)
    camera.arm(ArmSpec("a", 1, 5.0))
    press(camera)
    time.sleep(0.3)
    health = camera.health()
    assert health.connected
    assert "free_images" not in health.counters
    assert "frames" not in health.counters
    assert len(camera.wait_frames(1, 2.0)) == 1
    camera.disarm()
    assert camera.health().counters["free_images"] > 0


def test_a_full_card_is_named(edge: CameraRig) -> None:
    camera = opened(edge)
    camera.arm(ArmSpec("a", PICTURES_ON_THE_CARD + 1, 5.0))
    for _ in range(PICTURES_ON_THE_CARD + 1):
        press(camera)
    began = time.monotonic()
    assert len(camera.wait_frames(PICTURES_ON_THE_CARD + 1, 8.0)) == PICTURES_ON_THE_CARD
    assert time.monotonic() - began < 6.0  # the card's word ends the waiting, not the time
    health = camera.health()
    assert health.connected
    assert health.problem == "the memory card is full"
    with pytest.raises(DeviceError) as caught:
        camera.arm(ArmSpec("b", 1, 5.0))
    assert caught.value.code == "device/camera-card-full"


def test_files_nobody_wants_stay_out(tmp_path: Path) -> None:
    with gphoto2_rig(tmp_path, suffixes=[".NEF"]) as rig:
        camera = opened(rig)
        camera.arm(ArmSpec("a", 1, 5.0))
        camera.software_trigger()
        assert camera.wait_frames(1, 0.4) == ()


def test_settings_are_the_nearest_of_the_bodys_menu(edge: CameraRig) -> None:
    camera = opened(edge)
    assert camera.capabilities.settable == {"exposure_us", "f_number"}
    real = camera.configure(CameraSettings(exposure_us=9_900.0, f_number=7.7))
    assert real.exposure_us == 10_000.0
    assert real.f_number == 8.0
    with pytest.raises(InputError, match=r"try 0.0001s, 0.0012s"):
        camera.configure(CameraSettings(exposure_us=3.0))
    assert camera.configure(CameraSettings()) == real


def test_a_body_that_hangs_gets_a_new_process(tmp_path: Path) -> None:
    with gphoto2_rig(tmp_path, command_deadline_s=1.0) as rig:
        hang_and_go_on(opened(rig))


def hang_and_go_on(camera: RemoteCamera) -> None:
    camera.configure(CameraSettings(f_number=8.0))
    hung = camera.worker_pid
    assert hung
    os.kill(hung, signal.SIGSTOP)
    began = time.monotonic()
    with pytest.raises(DeviceError) as caught:
        camera.arm(ArmSpec("a", 1, 5.0))
    assert time.monotonic() - began < 1.0 + 0.5
    assert caught.value.code == "device/camera-gone"
    assert not psutil.pid_exists(hung)
    camera.arm(ArmSpec("a", 1, 5.0))
    camera.software_trigger()
    assert len(camera.wait_frames(1, 2.0)) == 1
    assert camera.configure(CameraSettings()).f_number == 8.0


def test_a_look_leaves_the_mirror_down() -> None:
    from rig.acquisition.cameras.workers.gphoto2_driver import GphotoDriver

    class File:
        def get_mime_type(self) -> str:
            return "image/jpeg"

        def get_data_and_size(self) -> bytes:
            return b"seen"

    class Mirror:
        up = 0

        def get_value(self) -> int:
            return self.up

        def set_value(self, value: int) -> None:
            self.up = value

    class Body:
        mirror = Mirror()

        def capture_preview(self) -> File:
            self.mirror.up = 1
            return File()

        def get_single_config(self, name: str) -> Mirror:
            assert name == "viewfinder"
            return self.mirror

        def set_single_config(self, name: str, widget: Mirror) -> None:
            assert (name, widget) == ("viewfinder", self.mirror)

    driver = GphotoDriver({"virtual_folder": None})
    driver._camera = body = Body()
    assert driver.preview(lambda: True) is None and body.mirror.up == 0
    seen = driver.preview(lambda: False)
    assert seen is not None and seen[1] == b"seen" and body.mirror.up == 1
    driver.rest()
    assert body.mirror.up == 0
