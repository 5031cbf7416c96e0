"""A webcam, a stream or a sequence of files through OpenCV."""

from __future__ import annotations

import hashlib
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2

from common.errors import DeviceError, InputError
from rig.acquisition.cameras.workers.serve import Picture

FLUSH_FRAMES = 100
WAITED_S = 0.004
"""A grab that takes longer most likely had to wait for the camera, so the buffers are empty."""
SURE_WAITS = 3
"""So many one after another did; a single one may only tell of a busy machine."""
V4L2_EXPOSURE_US = 100.0
"""V4L2 counts exposure in steps of 100 microseconds."""
OPEN_MS, READ_MS = 5000, 2000
DARK = 16
"""A picture of 8 bits no brighter than this may be without noise."""


class OpencvDriver:
    """One source; :class:`.serve.Driver` says what each method does."""

    shares_library = True

    def __init__(self, options: Mapping[str, Any]) -> None:
        self._options = options
        self._source: str | int = options["source"]
        self._capture: Any = None
        self._live = True
        self._armed = False
        self._triggers: list[int] = []
        self._books = threading.Lock()
        self._skip = 0
        self._last = b""
        self._size = (0, 0)

    def open(self, camera_id: str) -> Mapping[str, Any]:
        """Open the source."""
        source = self._source
        if isinstance(source, str) and ("%" in Path(source).name and "://" not in source):
            self._live = False
            self._capture = cv2.VideoCapture(source, cv2.CAP_IMAGES)
        elif isinstance(source, str) and Path(source).is_file():
            self._live = False
            self._capture = cv2.VideoCapture(source)
        elif isinstance(source, str) and "://" in source:
            limits = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, OPEN_MS, cv2.CAP_PROP_READ_TIMEOUT_MSEC]
            self._capture = cv2.VideoCapture(source, cv2.CAP_FFMPEG, [*limits, READ_MS])
        else:
            self._capture = cv2.VideoCapture(source)
        if not self._capture.isOpened():
            raise _gone(f"{source} cannot be opened")
        self._ask_size()
        info = {"id": camera_id, "model": self._capture.getBackendName(), "address": str(source)}
        return {"info": info, "capabilities": self._capabilities()}

    def _ask_size(self) -> None:
        if self._options["image_size_px"]:
            width, height = self._options["image_size_px"]
            self._capture.set(cv2.CAP_PROP_FRAME_WIDTH, width)
            self._capture.set(cv2.CAP_PROP_FRAME_HEIGHT, height)

    def _is_v4l2(self) -> bool:
        return bool(self._capture.getBackendName() == "V4L2")

    def _capabilities(self) -> Mapping[str, Any]:
        # Only V4L2 tells exposure in a unit; elsewhere the number means something else per driver.
        exposes = self._is_v4l2() and self._capture.get(cv2.CAP_PROP_EXPOSURE) > 0
        return {
            "trigger": "software",
            "timestamps": "host",
            "frame_counter": False,
            "settable": ["exposure_us"] if exposes else [],
            # A sequence of files would be used up by looking.
            "previews": self._live,
        }

    def configure(self, settings: Mapping[str, Any]) -> Mapping[str, Any]:
        """Set the exposure where its unit is known; all settings as they are now."""
        settable = self._capabilities()["settable"]
        for field, value in settings.items():
            if value is not None and field not in settable:
                raise InputError(
                    "camera-setting", f"{field}: this camera has no such setting", "leave it out"
                )
        if settings.get("exposure_us") is not None:
            self._capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, 1)  # V4L2: 1 is manual, 3 is automatic
            steps = round(float(settings["exposure_us"]) / V4L2_EXPOSURE_US)
            self._capture.set(cv2.CAP_PROP_EXPOSURE, max(steps, 1))
        if "exposure_us" not in settable:
            return {}
        return {"exposure_us": self._capture.get(cv2.CAP_PROP_EXPOSURE) * V4L2_EXPOSURE_US}

    def arm(self, shots: int) -> int:  # noqa: ARG002
        """Empty the driver's buffers, so that the next frame is a fresh one."""
        with self._books:
            self._triggers.clear()
        dropped = self._flush(SURE_WAITS)
        self._armed = True
        return dropped

    def _flush(self, waits: int) -> int:
        """Let go of frames until so many on end had to be waited for; how many were old."""
        waited = 0
        for grabbed in range(FLUSH_FRAMES if self._live else 0):
            began = time.monotonic()
            self._grab()
            waited = waited + 1 if time.monotonic() - began > WAITED_S else 0
            if waited == waits:
                return grabbed + 1 - waits
        return FLUSH_FRAMES if self._live else 0

    def _grab(self) -> None:
        if not self._capture.grab():
            raise _gone("it gives no more frames")

    def trigger(self) -> None:
        """The next frame that begins from now on is wanted."""
        with self._books:
            self._triggers.append(time.monotonic_ns())
            if len(self._triggers) == 1:
                self._skip = int(self._options["skip_frames"]) if self._live else 0

    def collect(self) -> None:
        """Frames are fetched all the time."""

    def poll(self, timeout_s: float) -> Sequence[Picture]:
        """Keep the buffers empty; decode only the frame that is wanted."""
        return self._poll_live() if self._live else self._poll_file(timeout_s)

    def _poll_live(self) -> Sequence[Picture]:
        began_ns = time.monotonic_ns()
        self._grab()
        arrived_ns = time.monotonic_ns()
        with self._books:
            if not self._triggers or self._triggers[0] > began_ns:
                return ()
            if self._skip:
                self._skip -= 1
                return ()
            self._triggers.pop(0)
        return (self._retrieve(arrived_ns),)

    def _poll_file(self, timeout_s: float) -> Sequence[Picture]:
        with self._books:
            wanted = bool(self._triggers and self._triggers.pop(0))
        if not wanted:
            time.sleep(min(timeout_s, 0.005))
            return ()
        if not self._capture.grab():
            return ()
        return (self._retrieve(time.monotonic_ns()),)

    def _retrieve(self, arrived_ns: int) -> Picture:
        done, image = self._capture.retrieve()
        if not done:
            return {"arrived_host_ns": arrived_ns, "status": "incomplete"}, b""
        height, width = image.shape[:2]
        if self._live:
            self._require_size(width, height)
            self._require_alive(image)
        header = {
            "arrived_host_ns": arrived_ns,
            "status": "ok",
            "width": width,
            "height": height,
            "pixel_format": "BGR8" if image.ndim == 3 else "Mono8",
        }
        return header, image.tobytes()

    def _require_size(self, width: int, height: int) -> None:
        """Notice a stream that gives pictures of another size than it did."""
        was, self._size = self._size, (width, height)
        if was not in ((0, 0), self._size):
            raise _gone(
                f"its pictures are {width} x {height} pixels now, and were {was[0]} x {was[1]}"
            )

    def _require_alive(self, image: Any) -> None:  # noqa: ANN401  (H, W) or (H, W, 3), 8 bits
        """Notice a stream that gives the same picture for ever."""
        last, self._last = self._last, hashlib.blake2b(image.tobytes()).digest()
        # The noise of a sensor makes no two pictures alike; only a covered lens has none.
        if self._last == last and image.max() > DARK:
            raise _gone("it gives the same picture again and again")

    def preview(self, over: Callable[[], bool]) -> Picture | None:
        """The newest frame."""
        if over():
            return None
        self._flush(1)
        return self._retrieve(time.monotonic_ns())

    def rest(self) -> None:
        """It runs all the time."""

    def disarm(self) -> None:
        """Want no more frames."""
        self._armed = False
        with self._books:
            self._triggers.clear()

    def clock(self, count: int) -> Sequence[Sequence[int]]:  # noqa: ARG002
        """These cameras tell no clock."""
        return ()

    def ping(self) -> Mapping[str, int]:
        """Whether the source is there; one that is not armed must give a new frame."""
        source = self._source
        gone = isinstance(source, str) and source.startswith("/dev/") and not Path(source).exists()
        if gone or not self._capture.isOpened():
            raise _gone("its device is not there any more")
        if not self._armed:
            self._flush(1)
        return {}

    def close(self) -> None:
        """Let go of it."""
        if self._capture is not None:
            self._capture.release()


def _gone(why: str) -> DeviceError:
    return DeviceError("camera-gone", why, "check its cable and address, then open it again")
