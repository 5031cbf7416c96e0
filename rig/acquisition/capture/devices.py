"""What makes a station's devices. Which drivers there are is known above, to nobody here."""

from __future__ import annotations

from typing import Protocol

from rig.acquisition.cameras.base import CameraBackend
from rig.acquisition.station.spec import Station, TriggerPlan
from rig.acquisition.trigger.box import TriggerBox


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
