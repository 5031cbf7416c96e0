from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from camera_rigs import CameraRig, Webcam, files_rig

from common.errors import DeviceError, NotFoundError
from rig.acquisition.cameras.base import ArmSpec, CameraDevice, TimestampKind, TriggerKind
from rig.acquisition.cameras.opencv import OpencvBackend, stable_names
from rig.acquisition.cameras.workers.opencv_driver import OpencvDriver

RATE_HZ = 50.0


@pytest.fixture
def camera() -> Iterator[CameraDevice]:
    """A webcam on the network, open."""
    webcam = Webcam(RATE_HZ)
    backend = OpencvBackend(sources={"door": webcam.address})
    yield backend.open("door")
    backend.close()
    webcam.stop()


def test_the_picture_is_younger_than_the_command(camera: CameraDevice) -> None:
    assert camera.capabilities.trigger is TriggerKind.SOFTWARE
    assert camera.capabilities.timestamps is TimestampKind.HOST
    time.sleep(0.6)  # a careless reader now has 30 old frames before it
    greys, fired = [], []
    for _ in range(3):
        camera.arm(ArmSpec("a", 1, 1.0))
        fired.append(time.monotonic())
        camera.software_trigger()
        (frame,) = camera.wait_frames(1, 1.0)
        assert frame.pixels is not None
        greys.append(float(np.median(frame.pixels)))
        time.sleep(0.1)
    # Each frame's grey is its number: as many have gone by as the time between commands says,
    # within the frames let go, JPEG's rounding and a pause of a busy machine.
    for k in range(2):
        passed = (fired[k + 1] - fired[k]) * RATE_HZ
        assert abs((greys[k + 1] - greys[k]) % 250 - passed) <= 6


def test_a_burst_takes_one_frame_for_each_command(camera: CameraDevice) -> None:
    camera.arm(ArmSpec("a", 3, 1.0))
    for _ in range(3):
        camera.software_trigger()
    time.sleep(10 / RATE_HZ)
    assert len(camera.wait_frames(3, 0.5)) == 3


def test_files_come_in_order_and_end(tmp_path: Path) -> None:
    with files_rig(tmp_path) as world:
        take_to_the_end(world, tmp_path)


def take_to_the_end(world: CameraRig, place: Path) -> None:
    for number in range(5, 100):
        (place / f"f_{number:04d}.png").unlink()
    camera = world.backend.open("left")
    camera.arm(ArmSpec("a", 6, 1.0))
    for _ in range(6):
        camera.software_trigger()
    frames = camera.wait_frames(6, 0.5)
    assert [int(frame.pixels[0, 0, 0]) for frame in frames if frame.pixels is not None] == [
        *range(5)
    ]
    assert camera.health().connected


def test_only_first_interfaces_have_stable_names(tmp_path: Path) -> None:
    for name in ("usb-Maker_Cam_SN1-video-index0", "usb-Maker_Cam_SN1-video-index1"):
        (tmp_path / name).touch()
    assert list(stable_names(str(tmp_path))) == ["usb-Maker_Cam_SN1-video-index0"]
    assert stable_names(str(tmp_path / "nowhere")) == {}
    backend = OpencvBackend(by_id=str(tmp_path), sources={"desk": 0})
    found = {info.id: info.model for info in backend.discover()}
    assert found == {"usb-Maker_Cam_SN1-video-index0": "file", "desk": "camera 0 of the system"}


def test_a_source_that_does_not_open_is_named(tmp_path: Path) -> None:
    backend = OpencvBackend(sources={"a": str(tmp_path / "no_%d.png")})
    with pytest.raises(DeviceError, match=r"camera a .*cannot be opened") as caught:
        backend.open("a")
    assert caught.value.code == "device/camera-gone"
    with pytest.raises(NotFoundError, match=r"known: a"):
        backend.open("b")


def test_a_stream_that_freezes_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    frozen = threading.Event()

    def send(webcam: Webcam, write: Callable[[bytes], object]) -> None:
        number = 0
        while not webcam._stop.wait(1.0 / RATE_HZ):
            number += not frozen.is_set()
            picture = np.full((48, 64, 3), 40 + number % 200, np.uint8)
            data = cv2.imencode(".jpg", picture)[1].tobytes()
            head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(data)}\r\n\r\n"
            write(head.encode() + data + b"\r\n")

    monkeypatch.setattr(Webcam, "send", send)
    webcam = Webcam(RATE_HZ)
    backend = OpencvBackend(sources={"door": webcam.address})
    camera = backend.open("door")

    def shoot() -> int:
        camera.arm(ArmSpec("a", 1, 2.0))
        camera.software_trigger()
        return len(camera.wait_frames(1, 2.0))

    try:
        assert shoot() == 1
        assert shoot() == 1
        frozen.set()
        time.sleep(0.2)
        # The picture it froze at may still be new to the first command.
        came = shoot()
        if came:
            assert shoot() == 0
        assert "the same picture again and again" in camera.health().problem
    finally:
        backend.close()
        webcam.stop()


def test_a_stream_that_changes_its_size_is_named() -> None:
    sizes = iter([(48, 64), (48, 64), (24, 32)])

    class Stream:
        def retrieve(self) -> tuple[bool, np.ndarray]:
            height, width = next(sizes)
            return True, np.random.default_rng(0).integers(0, 200, (height, width, 3), np.uint8)

    driver = OpencvDriver({"source": 0})
    driver._capture = Stream()
    driver._retrieve(1)
    driver._last = b""
    assert driver._retrieve(2)[0]["width"] == 64
    with pytest.raises(DeviceError, match="are 32 x 24 pixels now, and were 64 x 48"):
        driver._retrieve(3)
