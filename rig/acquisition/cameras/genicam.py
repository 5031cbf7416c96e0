"""Cameras behind a GenTL producer (a ``.cti`` file of the maker), through Harvesters."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from common.errors import InputError
from common.files.strict import StrictModel
from rig.acquisition.cameras.options import read_options, require
from rig.acquisition.cameras.remote import RemoteBackend
from rig.acquisition.cameras.remotecamera import WorkerSpec

INSTALL = "pip install 'harvesters>=1.4.3,<2'"
PRODUCERS = "GENICAM_GENTL64_PATH"
"""Folders of producers, by the GenTL standard; makers' installers set it."""


class GenicamOptions(StrictModel):
    """Options of GenICam cameras."""

    producers: tuple[str, ...] = ()
    """Files ``*.cti``; empty: those in the folders of ``GENICAM_GENTL64_PATH``."""
    trigger: Literal["edge", "software", "none"] = "edge"
    trigger_line: str = "Line0"
    frame_rate_hz: Annotated[float, Field(gt=0)] | None = None
    """Only for ``trigger = "none"``."""
    ptp: bool = False
    ptp_wait_s: Annotated[float, Field(ge=0, le=60)] = 8.0
    command_deadline_s: Annotated[float, Field(gt=0, le=60)] = 2.0


def find_producers(given: Sequence[str]) -> list[str]:
    """Producers to load, as absolute paths. InputError when there are none."""
    for name in given:
        if not Path(name).is_file():
            raise InputError(
                "camera-producer", f"there is no GenTL producer {name}", "correct 'producers'"
            )
    if given:
        return [str(Path(name).resolve()) for name in given]
    folders = [Path(part) for part in os.environ.get(PRODUCERS, "").split(os.pathsep) if part]
    found = sorted(str(file) for folder in folders for file in folder.glob("*.cti"))
    if not found:
        raise InputError(
            "camera-producer",
            "no GenTL producer is known",
            f"install the camera maker's, or set {PRODUCERS} or the option 'producers'",
        )
    return found


class GenicamBackend(RemoteBackend):
    """Cameras of all producers, by serial number."""

    def __init__(self, **options: object) -> None:
        given = read_options("genicam", GenicamOptions, options)
        require("genicam", "harvesters", INSTALL)
        super().__init__(
            WorkerSpec(
                backend="genicam",
                driver="rig.acquisition.cameras.workers.genicam_driver:GenicamDriver",
                interpreter=sys.executable,
                options={
                    **given.model_dump(exclude={"command_deadline_s"}),
                    "producers": find_producers(given.producers),
                },
                open_deadline_s=20.0 + (given.ptp_wait_s if given.ptp else 0.0),
                command_deadline_s=given.command_deadline_s,
            )
        )
