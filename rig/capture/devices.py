"""From a station's plan to open devices; the one place that knows which drivers there are."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Mapping
from typing import Any, Protocol

from geometry.errors import InputError
from rig.cameras.base import CameraBackend
from rig.capture.rigfacts import read_rig_design
from rig.station.simulation import simulation_settings
from rig.station.spec import Station, TriggerPlan
from rig.trigger.box import TriggerBox


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
        from rig.trigger.driver import BoxAddress, SerialTriggerBox

        url = self._fake_url(plan) if plan.url.startswith("fake:") else plan.url
        address = BoxAddress(url, plan.serial_number or "")
        if plan.backend == "esper":
            from rig.trigger.esper import EsperTriggerBox

            return EsperTriggerBox(address)
        return SerialTriggerBox(address)

    def _fake_url(self, plan: TriggerPlan) -> str:
        """A box made of nothing, on a pseudo-terminal of this process."""
        from rig.trigger.endpoint import PtyEndpoint
        from rig.trigger.fake.device import FakeBox, FakeSettings
        from rig.trigger.fake.line import FakeLine
        from rig.trigger.fake.serving import FakeServer

        box = FakeBox(time.monotonic_ns, FakeSettings(plan.serial_number or "fake"))
        server = FakeServer(FakeLine(box, time.monotonic_ns), PtyEndpoint())
        self._beside.callback(server.close)
        return server.url

    def make_backend(self, name: str, station: Station, box: TriggerBox | None) -> CameraBackend:
        """The backend of that name with the station's options for it."""
        from rig.cameras.registry import make_backend

        return make_backend(name, self._options(name, station, box))

    def _options(self, name: str, station: Station, box: TriggerBox | None) -> Mapping[str, Any]:
        options = dict(station.backend_options.get(name, {}))
        return options | _simulated(station, box) if name == "simulated" else options

    def close(self) -> None:
        """End the fake box, where there is one."""
        self._beside.close()


def _simulated(station: Station, box: TriggerBox | None) -> dict[str, Any]:
    """What simulated cameras need beyond their section: the rig itself, and the box to hear."""
    cameras = tuple(read_rig_design(station).cameras.values())
    if not cameras:
        raise InputError(
            "simulation-no-design",
            "simulated cameras stand where a design puts them, and the station names none",
            'add design = "design.json"',
        )
    return {"cameras": cameras, "settings": simulation_settings(station), "box": box}
