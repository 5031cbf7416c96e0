"""Webcams and streams through OpenCV's VideoCapture.

They run freely. A software trigger picks the next frame that began after it; so cameras are as far
apart as their frame periods, and the time of a frame is that of its arrival.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from pydantic import Field

from common.errors import NotFoundError
from common.files.strict import StrictModel
from rig.acquisition.cameras.base import CameraInfo
from rig.acquisition.cameras.options import read_options
from rig.acquisition.cameras.remote import RemoteBackend
from rig.acquisition.cameras.remotecamera import RemoteCamera, WorkerSpec

BY_ID = "/dev/v4l/by-id"


class OpencvOptions(StrictModel):
    """Options of OpenCV cameras."""

    sources: Annotated[dict[str, str | int], Field(default_factory=dict)]
    """Names for addresses, file patterns (``frames/f_%04d.png``) or, where there is nothing
    better, numbers of the system, which change when cables are moved."""
    image_size_px: tuple[int, int] | None = None
    """Width and height to ask for."""
    skip_frames: Annotated[int, Field(ge=0, le=30)] = 1
    """Frames let go after a trigger: the first was being exposed already when it came."""
    command_deadline_s: Annotated[float, Field(gt=0, le=60)] = 3.0
    by_id: str = BY_ID
    """Folder of the system's stable names of cameras."""


def stable_names(folder: str) -> dict[str, str]:
    """Cameras of this machine by their stable name: maker, model and, if it has one, serial.

    Only first interfaces: the others of a camera carry data about frames, no pictures.
    """
    place = Path(folder)
    if not place.is_dir():
        return {}
    links = sorted(entry for entry in place.iterdir() if entry.name.endswith("-index0"))
    return {link.name: str(link) for link in links}


class OpencvBackend(RemoteBackend):
    """Cameras of ``/dev/v4l/by-id`` and those named in the option ``sources``."""

    def __init__(self, **options: object) -> None:
        given = read_options("opencv", OpencvOptions, options)
        self._given = given
        super().__init__(
            WorkerSpec(
                backend="opencv",
                driver="rig.acquisition.cameras.workers.opencv_driver:OpencvDriver",
                interpreter=sys.executable,
                options=given.model_dump(exclude={"command_deadline_s", "sources", "by_id"}),
                command_deadline_s=given.command_deadline_s,
            )
        )

    def _sources(self) -> dict[str, str | int]:
        return {**stable_names(self._given.by_id), **self._given.sources}

    def discover(self) -> Sequence[CameraInfo]:
        """Named sources and stable names; nothing is opened, so none is known to answer."""
        return tuple(
            CameraInfo(name, "opencv", model=_kind(source), address=str(source))
            for name, source in sorted(self._sources().items())
        )

    def open(self, camera_id: str) -> RemoteCamera:
        """Open one by its stable name or its name in ``sources``."""
        sources = self._sources()
        if camera_id not in sources:
            raise NotFoundError(
                "camera",
                f"there is no OpenCV camera '{camera_id}'",
                f"plug it in, or name it in 'sources'; known: {', '.join(sources) or 'none'}",
            )
        return super().open(camera_id)

    def spec_for(self, camera_id: str) -> WorkerSpec:
        """How the worker of one camera is started: with its address."""
        source = self._sources()[camera_id]
        return replace(self._spec, options={**self._spec.options, "source": source})


def _kind(source: str | int) -> str:
    if isinstance(source, int):
        return f"camera {source} of the system"
    return "stream" if "://" in source else "UVC" if source.startswith("/dev/") else "file"
