"""What a session tells about its rig: the folder ``rig``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from common.errors import ConflictError, InputError
from common.files.plain import plain
from geometry.arrays import Floats
from geometry.camera import RigCamera
from rig.acquisition.cameras.base import CameraInfo
from rig.acquisition.session import paths
from rig.acquisition.session.colmap import rig_config
from rig.acquisition.session.folder import SessionPlan
from rig.acquisition.session.jsonfiles import json_bytes
from rig.acquisition.session.records import SessionFile
from rig.acquisition.session.storage import sha256
from rig.acquisition.station.spec import Station
from rig.design.designfile import placed_camera, read_design
from rig.design.layoutfile import read_datum

RIG_SCHEMA = "rigwright.session-rig/1"
CALIBRATION_SCHEMA = "rigwright.session-calibration/1"


@dataclass(frozen=True, eq=False)
class RigDesign:
    """The design a station was built from: its cameras by name, and the file as it stood."""

    cameras: Mapping[str, RigCamera] = field(default_factory=dict)
    data: bytes = b""
    datum_rig_mm: Floats = field(default_factory=lambda: np.zeros(3))
    """That of the layout beside the design; else the origin of the rig's frame, (3,)."""


def read_rig_design(station: Station) -> RigDesign:
    """The station's design, an empty one where it has none.

    Raises :class:`InputError` when a camera of the station is not in it.
    """
    if station.design is None:
        return RigDesign()
    design = read_design(station.design)
    cameras = {camera.name: camera for camera in design.cameras}
    strange = [camera.name for camera in station.cameras if camera.name not in cameras]
    if strange:
        raise InputError(
            "design-other-rig",
            f"camera {strange[0]!r} of the station is not in {station.design.name}",
            f"call it as the design does: {', '.join(cameras)}",
        )
    named = {camera.name: cameras[camera.name] for camera in station.cameras}
    path = Path(station.design)
    datum = read_datum(path.with_name("layout.json"))
    return RigDesign(named, path.read_bytes(), np.zeros(3) if datum is None else datum)


def picture_sizes(station: Station, design: RigDesign) -> dict[str, tuple[int, int]]:
    """What each camera's pictures must measure, as far as that is known."""
    sizes = {name: placed.camera.image_size_px for name, placed in design.cameras.items()}
    for camera in station.cameras:
        if camera.image_size_px is not None:
            sizes[camera.name] = camera.image_size_px
    return sizes


def focal_lengths_mm(design: RigDesign) -> dict[str, float]:
    """Focal lengths by camera, as far as they are known."""
    return {name: placed.camera.focal_length_mm for name, placed in design.cameras.items()}


def session_plan(
    station: Station,
    design: RigDesign,
    infos: Mapping[str, CameraInfo],
    subject: str = "",
    operator: str = "",
) -> SessionPlan:
    """What a new session at this station is about."""
    files = {f"{paths.RIG}/rig.json": json_bytes(_rig_document(station, design, infos))}
    if station.text:
        files[f"{paths.RIG}/station.toml"] = station.text.encode()
    if design.cameras:
        files[f"{paths.RIG}/design.json"] = design.data
        files[f"{paths.RIG}/rig_config.json"] = json_bytes(rig_config(design.cameras))
        files[f"{paths.RIG}/calibration.json"] = json_bytes(_calibration(design))
    return SessionPlan(station.name, rig_sha256(station, design), files, subject, operator)


def rig_sha256(station: Station, design: RigDesign) -> str:
    """Names the rig: which devices are called what, and the design they stand in.

    Delays and settings are not part of it: they are kept with every capture.
    """
    devices = [[camera.name, camera.backend, camera.id] for camera in station.cameras]
    return sha256(json.dumps([devices, sha256(design.data)]).encode())


def require_same_rig(session: SessionFile, station: Station, design: RigDesign) -> None:
    """Raise :class:`ConflictError` for a session that was begun with another rig."""
    if session.rig_sha256 != rig_sha256(station, design):
        raise ConflictError(
            "session-other-rig",
            f"the session was begun with another rig ({session.station})",
            "begin a new session",
        )


def _rig_document(
    station: Station, design: RigDesign, infos: Mapping[str, CameraInfo]
) -> dict[str, object]:
    trigger = station.trigger
    return {
        "schema": RIG_SCHEMA,
        "station": station.name,
        "designed": bool(design.cameras),
        "trigger": None
        if trigger is None
        else {"backend": trigger.backend, "serial_number": trigger.serial_number},
        "cameras": [
            {
                "name": camera.name,
                "backend": camera.backend,
                "id": camera.id,
                "vendor": infos[camera.name].vendor if camera.name in infos else "",
                "model": infos[camera.name].model if camera.name in infos else "",
                "output": camera.output,
                "focus_output": camera.focus_output,
                "folder": f"{paths.IMAGES}/{camera.name}",
            }
            for camera in station.cameras
        ],
    }


def _calibration(design: RigDesign) -> object:
    return plain(
        {
            "schema": CALIBRATION_SCHEMA,
            "source": "design",
            "cameras": [placed_camera(camera) for camera in design.cameras.values()],
        }
    )
