"""Backends whose cameras are held by worker processes: what all of them share."""

from __future__ import annotations

import threading
from collections.abc import Sequence

from common.errors import DeviceError
from rig.acquisition.cameras.base import CameraInfo
from rig.acquisition.cameras.link import LinkDown, WorkerLink
from rig.acquisition.cameras.remotecamera import RemoteCamera, WorkerSpec, read_info
from rig.acquisition.cameras.workers import wire


class RemoteBackend:
    """Finds and opens cameras through workers; a :class:`CameraBackend`."""

    def __init__(self, spec: WorkerSpec) -> None:
        self._spec = spec
        self._open: dict[str, RemoteCamera] = {}
        self._lock = threading.Lock()

    @property
    def name(self) -> str:
        """Its name in station files."""
        return self._spec.backend

    def discover(self) -> Sequence[CameraInfo]:
        """The cameras that can be opened now, and those that are open here."""
        held = [camera.info for camera in self._held()]
        spec = self._spec
        link = WorkerLink(
            spec.interpreter, spec.driver, spec.environment, _ignore_message, _ignore_end
        )
        try:
            args = {"options": spec.options, "skip": [info.address for info in held]}
            told = link.ask("discover", args, spec.open_deadline_s)
        except LinkDown as error:
            raise DeviceError(
                "discovery-failed",
                f"looking for {spec.backend} cameras failed: {error}",
                "check the library and its drivers, then try again",
            ) from None
        finally:
            link.close()
        found = {info.id: info for info in held}
        for one in told:
            found.setdefault(one["id"], read_info(spec.backend, one))
        return tuple(found[key] for key in sorted(found))

    def _held(self) -> list[RemoteCamera]:
        with self._lock:
            self._open = {k: c for k, c in self._open.items() if c.worker_pid is not None}
            return list(self._open.values())

    def open(self, camera_id: str) -> RemoteCamera:
        """Open one by its id; it must not be open here already."""
        if any(camera.info.id == camera_id for camera in self._held()):
            raise DeviceError(
                "camera-busy", f"camera {camera_id} is open already", "close it first"
            )
        camera = RemoteCamera(self.spec_for(camera_id), camera_id)
        with self._lock:
            self._open[camera_id] = camera
        return camera

    def spec_for(self, camera_id: str) -> WorkerSpec:  # noqa: ARG002  the same for all, mostly
        """How the worker of one camera is started."""
        return self._spec

    def close(self) -> None:
        """Close what is open."""
        for camera in self._held():
            camera.close()


def _ignore_message(header: wire.Header, payload: bytes) -> None:
    """Nothing but answers is expected while looking for cameras."""


def _ignore_end(reason: str) -> None:
    """The question that was asked tells of it."""
