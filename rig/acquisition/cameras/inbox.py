"""The frames of one camera as its worker sends them, sorted into those of now and of before."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

from rig.acquisition.cameras import pixels
from rig.acquisition.cameras.base import ArmSpec, Frame, FrameStatus, Image

SPARE_FRAMES = 16
"""Frames kept beyond those asked for; a camera that runs freely must not fill the memory."""


class Inbox:
    """Frames since the last arming. One thread puts in, others wait."""

    def __init__(self, camera_id: str) -> None:
        self._camera_id = camera_id
        self._news = threading.Condition()
        self._frames: list[Frame] = []
        self._number = 0
        self._spec: ArmSpec | None = None
        self._fired_ns = 0
        self._seen = True
        self.counts: Counter[str] = Counter()

    def begin(self, spec: ArmSpec) -> int:
        """Forget what came before; the number that frames from now on carry."""
        with self._news:
            if not self._seen:
                self.counts["stale_frames"] += len(self._frames)
            self._frames, self._seen = [], False
            self._spec, self._fired_ns = spec, 0
            self._number += 1
            return self._number

    def fired(self) -> None:
        """The camera is told to expose now: from here its deadline counts."""
        self._fired_ns = time.monotonic_ns()

    def put(self, told: Mapping[str, Any], payload: bytes) -> None:
        """A frame as the worker tells of it."""
        if told.get("arm") != self._number:
            self.counts["stale_frames"] += 1
            return
        frame = self.read(told, payload)
        with self._news:
            self.counts["frames"] += 1
            if frame.status is not FrameStatus.OK:
                self.counts[f"{frame.status}_frames"] += 1
            self._frames.append(frame)
            shots = self._spec.shots if self._spec else 0
            if len(self._frames) > shots + SPARE_FRAMES:
                del self._frames[0]
                self.counts["overrun_frames"] += 1
            self._news.notify_all()

    def wake(self) -> None:
        """Something happened that may end the waiting."""
        with self._news:
            self._news.notify_all()

    def wait(self, count: int, timeout_s: float, over: Callable[[], bool]) -> tuple[Frame, ...]:
        """All frames since arming: when ``count`` are there, time is up, or it is ``over``."""
        with self._news:
            self._news.wait_for(lambda: len(self._frames) >= count or over(), timeout_s)
            self._seen = True
            return tuple(self._frames)

    def read(self, told: Mapping[str, Any], payload: bytes) -> Frame:
        """A frame as the worker tells of it."""
        status = FrameStatus(told["status"])
        notes = dict(told.get("metadata", {}))
        picture: dict[str, Any] = {"encoded": payload, "media_type": told.get("media_type")}
        if not told.get("media_type"):
            try:
                picture = {"pixels": _decode(told, payload)}
            except ValueError as error:
                # Of a frame that is not whole its transport knows better what is wrong.
                notes.setdefault("problem", str(error))
                picture, status = {}, FrameStatus.INCOMPLETE
        if status is FrameStatus.OK and self._is_late(told["arrived_host_ns"]):
            status = FrameStatus.LATE
        return Frame(
            camera_id=self._camera_id,
            arrived_host_ns=told["arrived_host_ns"],
            status=status,
            counter=told.get("counter"),
            device_ns=told.get("device_ns"),
            exposure_us=told.get("exposure_us"),
            metadata=notes,
            **picture,
        )

    def _is_late(self, arrived_ns: int) -> bool:
        spec, fired_ns = self._spec, self._fired_ns
        return bool(spec and fired_ns and (arrived_ns - fired_ns) / 1e9 > spec.deadline_s)


def _decode(told: Mapping[str, Any], payload: bytes) -> Image:
    if not {"pixel_format", "width", "height"} <= told.keys():
        raise ValueError("the frame says neither its size nor its format")
    return pixels.decode(told["pixel_format"], told["width"], told["height"], payload)
