"""Opening a station's cameras, at once and again when they were lost."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor

from common.errors import DeviceError, RigwrightError
from rig.acquisition.cameras.base import CameraBackend, CameraHealth
from rig.acquisition.capture.camerathreads import CameraThread
from rig.acquisition.capture.devices import DeviceMaker
from rig.acquisition.station.spec import CameraPlan, Station
from rig.acquisition.trigger.box import TriggerBox

LARGEST_REMEDIES = 3
"""More things to do at once than these nobody reads in one line."""


class OpenCameras:
    """The cameras of a station that are open, by name, and why the others are not."""

    def __init__(self, station: Station, maker: DeviceMaker, box: TriggerBox | None) -> None:
        self._plans = {camera.name: camera for camera in station.cameras}
        self._hands: dict[str, CameraThread] = {}
        self.problems: dict[str, str] = {}
        self._remedies: dict[str, str] = {}
        self._backends: dict[str, CameraBackend] = {}
        try:
            for name in sorted({camera.backend for camera in station.cameras}):
                self._backends[name] = maker.make_backend(name, station, box)
            self.open_lost()
        except BaseException:
            self.close()
            raise

    def open_lost(self) -> None:
        """Open what is not open, and again what was lost; what cannot be is in ``problems``."""
        lost = [name for name, thread in self._hands.items() if not thread.health().connected]
        for name in lost:
            self._hands.pop(name).close()
        wanted = [plan for name, plan in self._plans.items() if name not in self._hands]
        if not wanted:
            return
        with ThreadPoolExecutor(len(wanted), "camera-open") as pool:
            opened = list(pool.map(self._open, wanted))
        for plan, outcome in zip(wanted, opened, strict=True):
            if isinstance(outcome, CameraThread):
                self._hands[plan.name] = outcome
                self.problems.pop(plan.name, None)
            else:
                self.problems[plan.name] = outcome

    def _open(self, plan: CameraPlan) -> CameraThread | str:
        """The open camera, or why there is none."""
        try:
            return CameraThread(plan, self._backends[plan.backend].open(plan.id))
        except RigwrightError as error:
            self._remedies[plan.name] = error.remedy
            return error.problem

    def require_some(self) -> None:
        """Raise :class:`DeviceError` ``camera-gone`` when not one camera is open."""
        if not self._hands:
            told = "; ".join(f"{name}: {text}" for name, text in self.problems.items())
            raise DeviceError(
                "camera-gone", f"no camera could be opened ({told})", self._what_to_do()
            )

    def _what_to_do(self) -> str:
        """What the errors say, each thing once; a station has many cameras of few kinds."""
        different = list(dict.fromkeys(self._remedies[name] for name in self.problems))
        return "; ".join(different[:LARGEST_REMEDIES])

    def threads(self, station: Station) -> tuple[CameraThread, ...]:
        """The open cameras in the station's order, with its present plans."""
        threads = []
        for plan in station.cameras:
            if plan.name in self._hands:
                self._hands[plan.name].plan = plan
                threads.append(self._hands[plan.name])
        return tuple(threads)

    def by_name(self) -> Mapping[str, CameraThread]:
        """The open cameras."""
        return dict(self._hands)

    def health(self) -> Mapping[str, CameraHealth]:
        """How each camera is; those that are not open say why."""
        return {
            name: self._hands[name].health()
            if name in self._hands
            else CameraHealth(False, problem=self.problems.get(name, "it is not open"))
            for name in self._plans
        }

    def close(self) -> None:
        """Let go of all of them, and of their backends."""
        with ThreadPoolExecutor(max(1, len(self._hands)), "camera-close") as pool:
            list(pool.map(CameraThread.close, self._hands.values()))
        self._hands.clear()
        for backend in self._backends.values():
            # A library that fails to end must not keep the others, and the box, from closing.
            with contextlib.suppress(RigwrightError):
                backend.close()
        self._backends.clear()
