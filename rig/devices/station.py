"""From a station to its open devices: the one place that knows drivers and simulation alike."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING

from rig.acquisition.cameras.base import CameraBackend
from rig.acquisition.capture.rig import Rig
from rig.acquisition.station.spec import Station, TriggerPlan
from rig.acquisition.trigger.box import ReportSource, TriggerBox
from rig.devices.registry import SIMULATED, make_backend
from rig.devices.simulated import simulated_backend

if TYPE_CHECKING:
    from rig.acquisition.trigger.fake.esper import FakeEsper


def open_station(station: Station, *, locks: Path | None = None) -> Rig:
    """Open a station's box and cameras by their drivers; see :class:`Rig` for what it raises.

    ``locks``: where lock files lie, one place per computer by default.
    """
    return Rig(station, StationDevices(), locks)


class StationDevices:
    """The devices that there are: drivers by backend, and the fake box where it is named."""

    def __init__(self) -> None:
        self._beside = contextlib.ExitStack()
        self._fake_esper: FakeEsper | None = None

    def make_box(self, plan: TriggerPlan) -> TriggerBox:
        """The driver of the box that ``plan`` names."""
        url = self._fake_url(plan) if plan.url.startswith("fake:") else plan.url
        from rig.acquisition.trigger.driver import BoxAddress, SerialTriggerBox
        from rig.acquisition.trigger.esper import EsperTriggerBox

        address = BoxAddress(url, plan.serial_number or "")
        if plan.backend != "esper":
            return SerialTriggerBox(address)
        return EsperTriggerBox(
            address, half_press=plan.half_press, focus_lead_us=plan.focus_lead_us
        )

    def _fake_url(self, plan: TriggerPlan) -> str:
        """A box made of nothing, on a pseudo-terminal of this process."""
        from rig.devices.fakes import serve_esper, serve_rigwright

        name = plan.serial_number or "fake"
        if plan.backend == "esper":
            server, self._fake_esper = serve_esper(name)
        else:
            server = serve_rigwright(name)
        self._beside.callback(server.close)
        return server.url

    def make_backend(self, name: str, station: Station, box: TriggerBox | None) -> CameraBackend:
        """The backend of that name with the station's options for it."""
        options = station.backend_options.get(name, {})
        if name == SIMULATED:
            return simulated_backend(station, self._heard(box), options)
        return make_backend(name, options)

    def _heard(self, box: TriggerBox | None) -> ReportSource | None:
        """Whose reports simulated cameras expose at."""
        if box is None or self._fake_esper is None:
            return box
        from rig.devices.fakes import FakeEsperReports

        return FakeEsperReports(box, self._fake_esper)

    def close(self) -> None:
        """End the fake box, where there is one."""
        self._beside.close()
