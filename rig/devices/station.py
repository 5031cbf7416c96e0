"""From a station to its open devices: the one place that knows drivers and simulation alike."""

from __future__ import annotations

import contextlib
import time
from pathlib import Path

from rig.acquisition.cameras.base import CameraBackend
from rig.acquisition.capture.rig import Rig
from rig.acquisition.station.spec import Station, TriggerPlan
from rig.acquisition.trigger.box import TriggerBox
from rig.devices.registry import SIMULATED, make_backend
from rig.devices.simulated import simulated_backend


def open_station(station: Station, *, locks: Path | None = None) -> Rig:
    """Open a station's box and cameras by their drivers; see :class:`Rig` for what it raises.

    ``locks``: where lock files lie, one place per computer by default.
    """
    return Rig(station, StationDevices(), locks)


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
        options = station.backend_options.get(name, {})
        if name == SIMULATED:
            return simulated_backend(station, box, options)
        return make_backend(name, options)

    def close(self) -> None:
        """End the fake box, where there is one."""
        self._beside.close()
