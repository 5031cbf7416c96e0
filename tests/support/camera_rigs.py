"""Cameras to test the backends with: each really runs, none is hardware.

A :class:`CameraRig` is one camera world: its backend, a way to make it take pictures and a way to
pull its plug.
"""

from __future__ import annotations

import contextlib
import dataclasses
import fcntl
import http.server
import importlib.util
import os
import shutil
import signal
import struct
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
import pytest

from rig.acquisition.cameras.base import (
    ArmSpec,
    CameraBackend,
    CameraDevice,
    CameraSettings,
    Frame,
    TriggerKind,
)
from rig.acquisition.cameras.remotecamera import RemoteCamera
from rig.devices.registry import make_backend

FAKE_GV = "arv-fake-gv-camera-0.8"
LIFE_S = 240


@dataclass
class CameraRig:
    """One camera world. ``shoot`` makes the open camera take one picture now."""

    name: str
    backend: CameraBackend
    camera_id: str
    shoot: Callable[[CameraDevice], None]
    unplug: Callable[[CameraDevice], None]
    plug: Callable[[], None] | None = None
    settings: CameraSettings = field(default_factory=CameraSettings)
    tolerance: float = 0.0
    """Relative: how far from what was asked the camera may set itself."""
    refused: CameraSettings = field(default_factory=lambda: CameraSettings(iso=123456))
    frame_s: float = 0.5
    """A frame is there after this time at the latest."""
    close: Callable[[], None] = lambda: None

    def __enter__(self) -> CameraRig:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def free_running(device: CameraDevice) -> bool:
    return device.capabilities.trigger is TriggerKind.NONE and device.info.backend != "folder"


def fire(device: CameraDevice) -> None:
    if device.capabilities.trigger is TriggerKind.SOFTWARE:
        device.software_trigger()


SHOT = ArmSpec("capture", 1, 5.0)


def shoot(rig: CameraRig, device: CameraDevice, count: int) -> list[Frame]:
    """Arm and take pictures one after another."""
    device.arm(dataclasses.replace(SHOT, shots=count))
    frames: list[Frame] = []
    for k in range(1, count + 1):
        rig.shoot(device)
        frames = list(device.wait_frames(k, rig.frame_s + 1.0))
    return frames


def assert_set(real: CameraSettings, wanted: CameraSettings, tolerance: float) -> None:
    for name, value in dataclasses.asdict(wanted).items():
        if isinstance(value, str):
            assert getattr(real, name) == value
        elif value is not None:
            assert getattr(real, name) == pytest.approx(value, rel=tolerance)


def crash(device: CameraDevice) -> None:
    """What a library does that kills its process."""
    assert isinstance(device, RemoteCamera)
    assert device.worker_pid
    os.kill(device.worker_pid, signal.SIGKILL)


@contextlib.contextmanager
def one_gige_network() -> Iterator[None]:
    """Fake GigE cameras all answer on one network: tests side by side would find each other's."""
    with (Path(tempfile.gettempdir()) / "rigwright-tests-gige.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


class FakeGigE:
    """Aravis's fake GigE Vision camera as a process of its own.

    One at a time for each address: all listen at the same port.
    """

    def __init__(self, serial: str, address: str = "127.0.0.1", lost_per_1000: int = 0) -> None:
        program = shutil.which(FAKE_GV)
        assert program
        options = ["-i", address, "-s", serial]
        if lost_per_1000:
            options += ["-r", str(lost_per_1000)]
        # Should the tests be killed, it ends by itself.
        self._command = ["timeout", "-s", "KILL", str(LIFE_S), program, *options]
        self.start()

    def start(self) -> None:
        self._process = subprocess.Popen(
            self._command, stdout=subprocess.DEVNULL, start_new_session=True
        )
        # It says nothing when it is ready; discovery waits a second for answers anyway.
        time.sleep(0.1)

    def stop(self) -> None:
        if self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()


def aravis_rig(place: Path, serial: str = "RW01", **options: object) -> CameraRig:
    del place
    fake = FakeGigE(serial)
    try:
        # Known addresses save the second that discovery takes; it has tests of its own.
        given = {"trigger": "software", "addresses": {serial: "127.0.0.1"}, **options}
        backend = make_backend("aravis", given)
    except BaseException:
        fake.stop()
        raise

    def close() -> None:
        backend.close()
        fake.stop()

    return CameraRig(
        "aravis",
        backend,
        serial,
        shoot=fire,
        unplug=lambda _: fake.stop(),
        plug=fake.start,
        settings=CameraSettings(exposure_us=12345.0, pixel_format="Mono8"),
        tolerance=1e-3,  # whole microseconds of 12345
        refused=CameraSettings(exposure_us=1e12),
        close=close,
    )


def viky() -> str:
    """The GenTL producer that comes with the genicam package."""
    spec = importlib.util.find_spec("genicam")
    assert spec
    assert spec.origin
    return str(Path(spec.origin).with_name("viky.cti"))


def genicam_rig(place: Path) -> CameraRig:
    del place
    backend = make_backend("genicam", {"producers": [viky()]})
    return CameraRig(
        "genicam",
        backend,
        "0",  # the serial number of the red one
        shoot=lambda _: None,
        unplug=crash,
        settings=CameraSettings(pixel_format="Mono8"),
        refused=CameraSettings(pixel_format="Mono7"),
        close=backend.close,
    )


def gphoto2_rig(place: Path, **options: object) -> CameraRig:
    (place / "card").mkdir()
    assert cv2.imwrite(str(place / "card" / "GP1.JPG"), np.full((40, 60, 3), 90, np.uint8))
    given = {"virtual_folder": str(place / "card"), "trigger": "software", **options}
    backend = make_backend("gphoto2", given)
    return CameraRig(
        "gphoto2",
        backend,
        "0.1",  # what the virtual body says
        shoot=fire,
        unplug=crash,
        settings=CameraSettings(exposure_us=10_000.0, f_number=8.0),
        tolerance=0.12,  # a sixth of a stop
        frame_s=0.3,
        close=backend.close,
    )


def files_rig(place: Path) -> CameraRig:
    """Pictures of a file pattern as a webcam."""
    for k in range(100):
        assert cv2.imwrite(str(place / f"f_{k:04d}.png"), np.full((30, 40, 3), k, np.uint8))
    sources = {"left": str(place / "f_%04d.png")}
    backend = make_backend("opencv", {"sources": sources, "command_deadline_s": 1.0})
    return CameraRig("files", backend, "left", fire, unplug=crash, frame_s=0.2, close=backend.close)


class Webcam:
    """A camera on the network that sends JPEGs without end; the grey of each is its number."""

    def __init__(self, rate_hz: float = 50.0) -> None:
        self._period_s = 1.0 / rate_hz
        self._port = 0
        self.start()

    def start(self) -> None:
        self._stop = threading.Event()
        camera = self

        class Stream(http.server.BaseHTTPRequestHandler):
            def log_message(self, *args: object) -> None:
                """Requests are of no interest."""

            def do_GET(self) -> None:
                self.send_response(200)
                self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
                self.end_headers()
                with contextlib.suppress(OSError):
                    camera.send(self.wfile.write)

        self._server = http.server.ThreadingHTTPServer(("127.0.0.1", self._port), Stream)
        self._server.daemon_threads = True
        self._port = self._server.server_port
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.05,))
        self._thread.start()

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self._port}/video"

    def send(self, write: Callable[[bytes], object]) -> None:
        began = time.monotonic()
        while not self._stop.wait(self._period_s):
            number = int((time.monotonic() - began) / self._period_s)
            picture = np.full((48, 64, 3), number % 250, np.uint8)
            data = cv2.imencode(".jpg", picture)[1].tobytes()
            head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(data)}\r\n\r\n"
            write(head.encode() + data + b"\r\n")

    def stop(self) -> None:
        if self._stop.is_set():
            return
        self._stop.set()
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()


def stream_rig(place: Path) -> CameraRig:
    del place
    webcam = Webcam()
    backend = make_backend("opencv", {"sources": {"door": webcam.address}})

    def close() -> None:
        backend.close()
        webcam.stop()

    return CameraRig(
        "stream",
        backend,
        "door",
        fire,
        unplug=lambda _: webcam.stop(),
        plug=webcam.start,
        close=close,
    )


def jpeg(serial: str = "", grey: int = 128, exposure: tuple[int, int] = (1, 125)) -> bytes:
    """A JPEG with EXIF: body serial number and exposure time."""
    data = cv2.imencode(".jpg", np.full((24, 32, 3), grey, np.uint8))[1].tobytes()
    text = serial.encode() + b"\0"
    first, sub = 8, 8 + 2 + 12 + 4
    values = sub + 2 + 2 * 12 + 4
    tiff = b"II*\0" + struct.pack("<I", first)
    tiff += struct.pack("<HHHIII", 1, 0x8769, 4, 1, sub, 0)
    tiff += struct.pack("<HHHII", 2, 0x829A, 5, 1, values)
    inline = text.ljust(4, b"\0") if len(text) <= 4 else struct.pack("<I", values + 8)
    tiff += struct.pack("<HHI", 0xA431, 2, len(text)) + inline + struct.pack("<I", 0)
    tiff += struct.pack("<II", *exposure) + text
    block = b"Exif\0\0" + tiff
    return data[:2] + b"\xff\xe1" + struct.pack(">H", len(block) + 2) + block + data[2:]


def folder_rig(place: Path) -> CameraRig:
    root = place / "tether"
    (root / "cam01").mkdir(parents=True)
    backend = make_backend("folder", {"root": str(root), "settle_s": 0.05})
    numbers = iter(range(1, 10_000))

    def shoot(_: CameraDevice) -> None:
        (root / "cam01" / f"IMG_{next(numbers):04d}.JPG").write_bytes(jpeg("4711"))

    return CameraRig(
        "folder",
        backend,
        "cam01",
        shoot,
        unplug=lambda _: (root / "cam01").rename(place / "away") and None,
        plug=lambda: (place / "away").rename(root / "cam01") and None,
        frame_s=0.1,
        close=backend.close,
    )


RIGS: dict[str, Callable[[Path], CameraRig]] = {
    "folder": folder_rig,
    "files": files_rig,
    "stream": stream_rig,
    "genicam": genicam_rig,
    "aravis": aravis_rig,
    "gphoto2": gphoto2_rig,
}
