"""Pictures of the moment, one camera at a time, by the thread that the camera belongs to."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future, wait
from dataclasses import dataclass
from datetime import UTC, datetime

from common.errors import ConflictError, DeviceError, NotFoundError
from rig.acquisition.cameras.base import CameraDevice, Frame, Previewing
from rig.acquisition.capture.camerathreads import CameraThread

LEAST_INTERVAL_S = 0.4
"""A picture younger than this is shown again: however many look, a camera is asked no oftener."""

PATIENCE_S = 8.0
"""A camera that needs longer for a picture of the moment is told as slow."""

_LOOK_S = 0.01
MOST_LOOKERS = 12
"""So many may wait for pictures at once; each of them holds a thread of a service."""


@dataclass(frozen=True, eq=False)
class LivePicture:
    """What a camera saw. ``number`` counts its live pictures from 1."""

    number: int
    at: datetime
    frame: Frame


class _Sight:
    """The last look through one camera."""

    def __init__(self) -> None:
        self.turn = threading.Lock()
        self.last: LivePicture | None = None
        self.at_s = -LEAST_INTERVAL_S


class LiveView:
    """Live pictures of one rig. All methods may be called from any thread.

    ``threads``: the open cameras by name; ``doing``: what keeps the rig busy, None when nothing.
    As soon as it is busy no new picture is begun, and one that is under way is given up.
    """

    def __init__(
        self, threads: Callable[[], Mapping[str, CameraThread]], doing: Callable[[], str | None]
    ) -> None:
        self._threads, self._doing = threads, doing
        self._sights: dict[str, _Sight] = {}
        self._lookers = threading.BoundedSemaphore(MOST_LOOKERS)

    def able(self, name: str) -> bool:
        """Whether a camera is open and can show what it sees."""
        thread = self._threads().get(name)
        return thread is not None and thread.device.capabilities.previews

    def look(self, name: str) -> LivePicture:
        """What a camera sees now, or saw less than :data:`LEAST_INTERVAL_S` ago.

        Raises :class:`ConflictError` ``rig-busy`` and ``too-many-look``, :class:`NotFoundError`
        ``preview`` for a camera that cannot, :class:`DeviceError` for one that does not answer.
        """
        if not self._lookers.acquire(blocking=False):
            raise ConflictError(
                "too-many-look", f"{MOST_LOOKERS} wait for live pictures", "ask again in a moment"
            )
        try:
            self._require_rest()
            thread = self._thread(name)
            sight = self._sights.setdefault(name, _Sight())
            if not sight.turn.acquire(timeout=PATIENCE_S):
                raise _slow(name)
            try:
                return self._shared(thread, sight)
            finally:
                sight.turn.release()
        finally:
            self._lookers.release()

    def known(self, name: str, number: int) -> LivePicture | None:
        """The live picture of that number where it is the camera's last."""
        sight = self._sights.get(name)
        last = None if sight is None else sight.last
        return last if last is not None and last.number == number else None

    def _shared(self, thread: CameraThread, sight: _Sight) -> LivePicture:
        if sight.last is not None and time.monotonic() - sight.at_s < LEAST_INTERVAL_S:
            return sight.last
        frame = self._frame(thread)
        number = 1 if sight.last is None else sight.last.number + 1
        sight.last, sight.at_s = LivePicture(number, datetime.now(UTC), frame), time.monotonic()
        return sight.last

    def _frame(self, thread: CameraThread) -> Frame:
        given_up = threading.Event()

        def over() -> bool:
            return given_up.is_set() or self._doing() is not None

        def show(device: CameraDevice) -> Frame | None:
            if over() or not isinstance(device, Previewing):
                return None
            if not thread.set_up:
                device.configure(thread.plan.settings)
                thread.set_up = True
            return device.preview(over)

        try:
            frame = self._awaited(thread.do(show), thread.plan.name)
        finally:
            given_up.set()
        if frame is None or not frame.has_picture:
            self._require_rest()
            raise DeviceError(
                "camera-error", f"camera {thread.plan.name} showed nothing", "look again"
            )
        return frame

    def _awaited(self, showing: Future[Frame | None], name: str) -> Frame | None:
        until = time.monotonic() + PATIENCE_S
        while not wait([showing], _LOOK_S).done:
            self._require_rest()
            if time.monotonic() > until:
                raise _slow(name)
        return showing.result()

    def _require_rest(self) -> None:
        doing = self._doing()
        if doing is not None:
            raise ConflictError(
                "rig-busy", f"the rig is busy with {doing}", "live pictures go on when it has ended"
            )

    def _thread(self, name: str) -> CameraThread:
        thread = self._threads().get(name)
        if thread is None:
            raise DeviceError(
                "camera-gone", f"camera {name} is not open", "check its power and cable"
            )
        if not thread.device.capabilities.previews:
            backend = thread.device.info.backend
            raise NotFoundError(
                "preview",
                f"camera {name} ({backend}) cannot show what it sees between captures",
                "take a capture and look at its picture",
            )
        return thread


def _slow(name: str) -> DeviceError:
    return DeviceError(
        "camera-slow",
        f"camera {name} shows nothing within {PATIENCE_S:g} s",
        "check its cable, or look again",
    )
