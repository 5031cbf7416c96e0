"""DSLR and mirrorless bodies over USB through libgphoto2: one process per body.

The trigger box fires the bodies by cable; this backend makes them ready before and fetches the
files after. While the box holds the half press most bodies do not answer USB, so nothing is asked
of a body between :meth:`arm` and :meth:`wait_frames`.
"""

from __future__ import annotations

import sys
from typing import Annotated, Literal

from pydantic import Field

from common.files.strict import StrictModel
from rig.acquisition.cameras.options import read_options, require
from rig.acquisition.cameras.remote import RemoteBackend
from rig.acquisition.cameras.remotecamera import WorkerSpec

INSTALL = "pip install 'gphoto2>=2.6,<3'"


class GphotoOptions(StrictModel):
    """Options of gphoto2 cameras."""

    trigger: Literal["edge", "software"] = "edge"
    target: Literal["memory", "card"] = "memory"
    """Where the body keeps a picture until it is fetched; those on the card stay there."""
    suffixes: tuple[str, ...] = ()
    """Files wanted, such as ``[".nef"]``; empty: all. Bodies may make two files per shot."""
    busy_s: Annotated[float, Field(ge=0, le=60)] = 5.0
    """How long a body may refuse USB after firing, while its focus is held."""
    command_deadline_s: Annotated[float, Field(gt=0, le=120)] = 10.0
    virtual_folder: str | None = None
    """Use libgphoto2's virtual camera, which shows the first JPEG of this folder, instead of
    real ones: for trying out."""


class GphotoBackend(RemoteBackend):
    """Bodies on USB, by serial number."""

    def __init__(self, **options: object) -> None:
        given = read_options("gphoto2", GphotoOptions, options)
        require("gphoto2", "gphoto2", INSTALL)
        super().__init__(
            WorkerSpec(
                backend="gphoto2",
                driver="rig.acquisition.cameras.workers.gphoto2_driver:GphotoDriver",
                interpreter=sys.executable,
                options=given.model_dump(exclude={"command_deadline_s"}),
                open_deadline_s=30.0,
                command_deadline_s=given.command_deadline_s,
            )
        )
