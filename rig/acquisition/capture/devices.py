"""From a station's plan to open devices; the one place that knows which drivers there are."""

from __future__ import annotations

import contextlib
import time
from typing import Protocol

from rig.acquisition.cameras.base import CameraBackend
from rig.acquisition.capture.rigfacts import simulated_cameras
from rig.acquisition.station.simulation import simulation_settings
from rig.acquisition.station.spec import Station, TriggerPlan
from rig.acquisition.trigger.box import TriggerBox

SIMULATED = "simulated"


class DeviceMaker(Protocol):
    """Makes what a station names. A station's devices are all made by one of these."""

    def make_box(self, plan: TriggerPlan) -> TriggerBox:
        """The box, not yet open."""
        ...

    def make_backend(self, name: str, station: Station, box: TriggerBox | None) -> CameraBackend:
        """A backend. ``box`` is for cameras that exist only in the program and hear its edges."""
        ...

    def close(self) -> None:
        """Let go of what was made beside them."""
        ...


class StationDevices:
    """The devices that there are: drivers by backend, and the fake box where it is named."""

    def __init__(self) -> None:
        self._beside = contextlib.ExitStack()

    def make_box(self, plan: TriggerPlan) -> TriggerBox:
        """The driver of the box that ``plan`` names."""
        url = self._fake_url(plan) if plan.url.startswith("fake:") else plan.url
        from rig.acquisition.trigger.driver import BoxAddress, SerialTriggerBox
        from rig.acquisition.trigger.esper import EsperTriggerBox

        address = BoxAddress(url, plan.serial_number or "")
        return EsperTriggerBox(address) if plan.backend == "esper" else SerialTriggerBox(address)

    def _fake_url(self, plan: TriggerPlan) -> str:
        """A box made of nothing, on a pseudo-terminal of this process."""
        from rig.acquisition.trigger.endpoint import PtyEndpoint
        from rig.acquisition.trigger.fake.device import FakeBox, FakeSettings
        from rig.acquisition.trigger.fake.line import FakeLine
        from rig.acquisition.trigger.fake.serving import FakeServer

        box = FakeBox(time.monotonic_ns, FakeSettings(plan.serial_number or "fake"))
        server = FakeServer(FakeLine(box, time.monotonic_ns), PtyEndpoint())
        self._beside.callback(server.close)
        return server.url

    def make_backend(self, name: str, station: Station, box: TriggerBox | None) -> CameraBackend:
        """The backend of that name with the station's options for it."""
        from rig.acquisition.cameras.registry import make_backend

        options = dict(station.backend_options.get(name, {}))
        if name == SIMULATED:
            options |= {
                "cameras": list(simulated_cameras(station).values()),
                "settings": simulation_settings(station),
                "box": box,
            }
        return make_backend(name, options)

    def close(self) -> None:
        """End the fake box, where there is one."""
        self._beside.close()
