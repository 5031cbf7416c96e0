"""GigE Vision and USB3 Vision cameras through Aravis.

Aravis comes with the system, not with pip, and binds to the system's Python. So each camera's
worker runs under a Python that has PyGObject and Aravis's typelib, whichever that is.
"""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Literal

from pydantic import Field

from common.files.strict import StrictModel
from rig.acquisition.cameras.base import CameraInfo
from rig.acquisition.cameras.options import missing, read_options
from rig.acquisition.cameras.remote import RemoteBackend
from rig.acquisition.cameras.remotecamera import WorkerSpec

INSTALL = "apt install gir1.2-aravis-0.8 python3-gi"
_PROBE = "import gi; gi.require_version('Aravis', '0.8'); from gi.repository import Aravis"


class AravisOptions(StrictModel):
    """Options of Aravis cameras."""

    trigger: Literal["edge", "software", "none"] = "edge"
    trigger_line: str = "Line0"
    frame_rate_hz: Annotated[float, Field(gt=0)] | None = None
    """Only for ``trigger = "none"``."""
    packet_size: Annotated[int, Field(ge=576, le=16000)] | None = None
    """Bytes; None leaves what the camera has."""
    packet_delay_ns: Annotated[int, Field(ge=0)] | None = None
    ptp: bool = False
    ptp_wait_s: Annotated[float, Field(ge=0, le=60)] = 8.0
    command_deadline_s: Annotated[float, Field(gt=0, le=60)] = 1.5
    addresses: Annotated[dict[str, str], Field(default_factory=dict)]
    """Network addresses of cameras by serial number, where discovery does not reach them."""
    python: str | None = None
    """A Python with PyGObject and Aravis; found by itself where there is one."""


def find_python(wanted: str | None = None) -> str:
    """A Python under which Aravis can be used; DeviceError ``device/backend-missing`` if none."""
    candidates = [wanted] if wanted else _candidates()
    for candidate in candidates:
        try:
            probe = subprocess.run(  # noqa: S603
                [candidate, "-I", "-c", _PROBE], capture_output=True, timeout=20, check=False
            )
        except (OSError, subprocess.TimeoutExpired):
            continue
        if probe.returncode == 0:
            return candidate
    tried = ", ".join(candidates) or "no Python"
    raise missing("aravis", f"no PyGObject with Aravis 0.8 (tried {tried})", INSTALL)


def _candidates() -> list[str]:
    own = [sys.executable] if importlib.util.find_spec("gi") else []
    system = [shutil.which("python3", path="/usr/bin:/usr/local/bin:/opt/homebrew/bin")]
    return list(dict.fromkeys([*own, *filter(None, [*system, shutil.which("python3")])]))


class AravisBackend(RemoteBackend):
    """Cameras on the networks and USB of this machine, by serial number."""

    def __init__(self, **options: object) -> None:
        given = read_options("aravis", AravisOptions, options)
        self._addresses = dict(given.addresses)
        super().__init__(
            WorkerSpec(
                backend="aravis",
                driver="rig.acquisition.cameras.workers.aravis_driver:AravisDriver",
                interpreter=find_python(given.python),
                options={
                    **given.model_dump(exclude={"python", "command_deadline_s", "addresses"}),
                    "address": "",
                },
                open_deadline_s=10.0 + (given.ptp_wait_s if given.ptp else 0.0),
                command_deadline_s=given.command_deadline_s,
            )
        )

    def discover(self) -> Sequence[CameraInfo]:
        """The cameras that answer now; their addresses are remembered for opening them."""
        found = super().discover()
        self._addresses.update({info.id: info.address for info in found})
        return found

    def spec_for(self, camera_id: str) -> WorkerSpec:
        """How the worker of one camera is started: with its address, where that is known."""
        address = self._addresses.get(camera_id, "")
        return replace(self._spec, hints={"address": address})
