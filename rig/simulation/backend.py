"""Simulated cameras: they expose at the trigger box's real edges and photograph a rendered scene.

A camera hears the box's reports and exposes at each rising edge of its output, after its lag. The
picture is rendered for that very exposure, so a moving head shows the skew and an LED board the
time. When a frame *arrives* is simulated too: end of exposure plus readout. Rendering takes
longer than that; :meth:`SimulatedCamera.wait_frames` then returns later than its timeout, with
frames that state when they would have come. So slow rendering never makes a frame late.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence

from common.closing import Closing
from common.errors import DeviceError, InputError
from geometry.camera import RigCamera
from rig.acquisition.cameras.base import CameraInfo
from rig.acquisition.trigger.box import Edge, FireReport, ReportSource
from rig.simulation.camera import SimulatedCamera, Triggered
from rig.simulation.pool import RenderPool
from rig.simulation.settings import SimulationSettings

NAME = "simulated"
_REMEMBERED = 256
"""Captures whose reports are remembered, so that a report heard twice fires once."""


class SimulatedBackend(Closing):
    """The cameras of a rig, simulated. ``cameras`` as a design file has them; ids are their names.

    ``box`` is listened to, if given; :meth:`expose` takes reports from elsewhere. ``clock`` is the
    host's monotonic clock. All methods may be called from any thread. Raises
    :class:`InputError` for settings of cameras that do not exist.
    """

    def __init__(
        self,
        cameras: Sequence[RigCamera],
        settings: SimulationSettings | None = None,
        box: ReportSource | None = None,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self.settings = settings or SimulationSettings()
        self._clock = clock
        self._infos = {
            camera.name: CameraInfo(camera.name, NAME, camera.camera.name, "Rigwright")
            for camera in cameras
        }
        self._check_names()
        self._rig = {camera.name: camera for camera in cameras}
        self._outputs = {
            name: self.settings.outputs.get(name, number)
            for number, name in enumerate(self._infos, 1)
        }
        scene, sensor = self.settings.scene, self.settings.sensor
        self._pool = RenderPool(cameras, scene, sensor, self.settings.workers)
        self._lock = threading.Lock()
        self._devices: dict[str, SimulatedCamera] = {}
        self._gone: set[str] = set()
        self._origins: dict[str, int] = {}
        self._heard: dict[str, None] = {}
        self._captures = 0
        self._unsubscribe = box.subscribe(self.expose) if box is not None else None

    @property
    def name(self) -> str:
        """``simulated``."""
        return NAME

    def discover(self) -> Sequence[CameraInfo]:
        """All cameras of the rig that are not unplugged."""
        with self._lock:
            return tuple(info for name, info in self._infos.items() if name not in self._gone)

    def open(self, camera_id: str) -> SimulatedCamera:
        """Open a camera; a camera that is open already is the same object."""
        with self._lock:
            if camera_id not in self._infos or camera_id in self._gone:
                raise DeviceError(
                    "camera-gone",
                    f"there is no simulated camera {camera_id!r}",
                    f"choose one of {', '.join(self._infos)}, and plug it in",
                )
            device = self._devices.get(camera_id)
            if device is None or not device.health().connected:
                device = SimulatedCamera(
                    self._infos[camera_id],
                    self.settings,
                    self._rig[camera_id].camera.f_number,
                    self._pool,
                    self._clock,
                    self._unplugged,
                    self._origin,
                    device,
                )
                self._devices[camera_id] = device
            self._pool.begin()
            return device

    def expose(self, report: FireReport) -> None:
        """Let the cameras expose at the edges of a report. A report heard twice fires once."""
        with self._lock:
            if report.capture_id in self._heard or not report.edges:
                return
            self._heard[report.capture_id] = None
            self._captures += 1
            capture = self._captures
            while len(self._heard) > _REMEMBERED:
                self._heard.pop(next(iter(self._heard)))
            devices = list(self._devices.items())
        rising = sorted((e for e in report.edges if e.rising), key=lambda e: e.at_host_ns)
        if not rising:
            return
        origin = self._origin(report.capture_id, rising[0].at_host_ns)
        board = self.settings.scene.board
        sync = None if board is None else board.sync_output
        zeros = {e.shot: e.at_host_ns for e in reversed(rising) if e.output == sync}
        for name, device in devices:
            for edge in self._edges_of(name, rising):
                zero = zeros.get(edge.shot)
                device.triggered(Triggered(edge.at_host_ns, origin, zero, capture))

    def replug(self, camera_id: str) -> None:
        """Plug an unplugged camera in again; it can then be opened anew."""
        with self._lock:
            self._gone.discard(camera_id)

    def warm_up(self) -> None:
        """Start the rendering processes now rather than at the first capture; takes seconds."""
        self._pool.warm_up()

    def close(self) -> None:
        """Close all cameras and end the rendering processes. Closing twice changes nothing."""
        if self._unsubscribe is not None:
            self._unsubscribe()
            self._unsubscribe = None
        with self._lock:
            devices = list(self._devices.values())
        for device in devices:
            device.close()
        self._pool.close()

    def _check_names(self) -> None:
        if not self._infos:
            raise InputError("simulation-rig", "the rig has no cameras", "give a design file")
        for name in (*self.settings.outputs, *self.settings.faults):
            if name != "*" and name not in self._infos:
                raise InputError(
                    "simulation-camera",
                    f"the simulation names a camera {name!r} that the rig does not have",
                    f"choose one of {', '.join(self._infos)}",
                )

    def _edges_of(self, name: str, rising: list[Edge]) -> list[Edge]:
        """The edges a camera really gets, wherever its cable is plugged in."""
        output = self.settings.faults_of(name).swapped_to_output or self._outputs[name]
        return [edge for edge in rising if edge.output == output]

    def _origin(self, capture_id: str, instant_ns: int) -> int:
        """When the head is in its place for a capture: the first instant named for it."""
        with self._lock:
            origin = self._origins.setdefault(capture_id, instant_ns)
            while len(self._origins) > _REMEMBERED:
                self._origins.pop(next(iter(self._origins)))
            return origin

    def _unplugged(self, camera_id: str) -> None:
        with self._lock:
            self._gone.add(camera_id)
