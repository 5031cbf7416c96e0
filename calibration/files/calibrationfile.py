"""``calibration.json``: a reference with its covariance."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Len

from calibration.adjustment.camera import CalibratedCamera, Interior
from calibration.adjustment.noise import NoiseModel
from calibration.adjustment.result import Calibration, CalibrationQuality, CarrierPose
from calibration.files.packing import PackedCovariance, compact, packed, unpacked
from calibration.observations import Carrier, Distance, TargetSet
from common.errors import InputError
from common.files.plain import plain
from common.files.reading import read_limited
from common.files.records import model_of, record_of
from common.files.strict import StrictModel, parsed
from common.files.writing import write_whole
from geometry.arrays import Floats
from geometry.frames import Pose

SCHEMA = "rigwright.calibration/1"

Pair = Annotated[list[float], Len(2, 2)]
Vector = Annotated[list[float], Len(3, 3)]
Terms = Annotated[list[float], Len(4, 8)]
"""Four of a fisheye, five after Brown-Conrady, eight of a rational lens."""

Matrix = Annotated[list[Vector], Len(3, 3)]
Size = Annotated[list[int], Len(2, 2)]
Sparse = Annotated[list[float | None], Len(3, 3)]


class CameraModel(StrictModel):
    """One camera; the units stand in the names, as everywhere."""

    name: str
    image_size_px: Size
    focal_length_px: float
    principal_point_px: Pair
    distortion: Terms
    affinity: float
    position_rig_mm: Vector
    rotation_rig_to_camera: Matrix
    sigma_scale: float
    sigma_added_px: float
    blur_px: float | None = None


class CarrierModel(StrictModel):
    """A carrier; null is an unknown coordinate, or a sigma without bound."""

    name: str
    fixed: bool
    ids: list[str]
    nominal_mm: list[Sparse]
    sigma_mm: list[Sparse]


class DistanceModel(StrictModel):
    """A measured distance."""

    first: str
    second: str
    length_mm: float
    sigma_mm: float


class TargetsModel(StrictModel):
    """The target set the calibration was made with."""

    name: str
    carriers: list[CarrierModel]
    distances: list[DistanceModel]


class CarrierPoseModel(StrictModel):
    """Where a carrier stood."""

    carrier: str
    frame: str | None
    position_rig_mm: Vector
    rotation_carrier_to_rig: Matrix


# The quality's model is made from the dataclass, so that it cannot fall behind it.
QualityModel: Any = model_of(CalibrationQuality)


class CalibrationModel(StrictModel):
    """The whole file."""

    schema_: Literal["rigwright.calibration/1"]
    name: str
    made_utc: str
    datum: str
    cameras: list[CameraModel]
    targets: TargetsModel
    target_mm: list[Sparse]
    places: list[CarrierPoseModel]
    covariance: PackedCovariance
    quality: QualityModel

    model_config = StrictModel.model_config | {"alias_generator": lambda n: n.removesuffix("_")}


@dataclass(frozen=True, eq=False)
class CalibrationRecord:
    """A calibration with its name and the time it was made, UTC as text (ISO 8601)."""

    name: str
    made_utc: str
    calibration: Calibration


def calibration_document(record: CalibrationRecord) -> dict[str, Any]:
    """The file as plain data."""
    calibration = record.calibration
    return {
        "schema": SCHEMA,
        "name": record.name,
        "made_utc": record.made_utc,
        "datum": calibration.datum,
        "cameras": [_camera(calibration, k) for k in range(len(calibration.cameras))],
        "targets": _targets(calibration.targets),
        "target_mm": _sparse(calibration.target_mm),
        "places": [
            {
                "carrier": p.carrier,
                "frame": p.frame,
                "position_rig_mm": p.position_rig_mm.tolist(),
                "rotation_carrier_to_rig": p.rotation_carrier_to_rig.tolist(),
            }
            for p in calibration.places
        ],
        "covariance": packed(compact(calibration.covariance)),
        "quality": plain(calibration.quality),
    }


def _camera(calibration: Calibration, index: int) -> dict[str, Any]:
    camera, noise = calibration.cameras[index], calibration.noise
    interior, blur_px = camera.interior, float(calibration.blur_px[index])
    return {
        "name": camera.name,
        "image_size_px": list(camera.image_size_px),
        "focal_length_px": interior.focal_length_px,
        "principal_point_px": interior.principal_point_px.tolist(),
        "distortion": interior.distortion.tolist(),
        "affinity": interior.affinity,
        "position_rig_mm": camera.pose.position_rig_mm.tolist(),
        "rotation_rig_to_camera": camera.pose.rotation_rig_to_camera.tolist(),
        "sigma_scale": float(noise.scale[index]),
        "sigma_added_px": float(noise.added_px[index]),
        "blur_px": blur_px if np.isfinite(blur_px) else None,
    }


def _targets(targets: TargetSet) -> dict[str, Any]:
    return {
        "name": targets.name,
        "carriers": [
            {
                "name": c.name,
                "fixed": c.fixed,
                "ids": list(c.ids),
                "nominal_mm": _sparse(c.nominal_mm),
                "sigma_mm": _sparse(c.sigma_mm),
            }
            for c in targets.carriers
        ],
        "distances": [plain(d) for d in targets.distances],
    }


def _sparse(values: Floats) -> list[list[float | None]]:
    return [[float(v) if np.isfinite(v) else None for v in row] for row in values]


def _dense(rows: list[list[float | None]], missing: float) -> Floats:
    table = [[missing if v is None else v for v in row] for row in rows]
    return np.array(table, np.float64).reshape(-1, 3)


def calibration_from(text: str | bytes, source: str) -> CalibrationRecord:
    """A calibration from a file's text; raises a one-line :class:`InputError`."""
    model = parsed(CalibrationModel, text, source)
    targets = TargetSet(
        model.targets.name,
        tuple(
            Carrier(
                c.name,
                tuple(c.ids),
                _dense(c.nominal_mm, np.nan),
                _dense(c.sigma_mm, np.inf),
                c.fixed,
            )
            for c in model.targets.carriers
        ),
        tuple(
            Distance(d.first, d.second, d.length_mm, d.sigma_mm) for d in model.targets.distances
        ),
    )
    _must_agree(model, targets, source)
    covariance = unpacked(model.covariance, len(model.cameras), len(targets.ids), source)
    calibration = Calibration(
        tuple(_camera_of(c) for c in model.cameras),
        targets,
        _dense(model.target_mm, np.nan),
        tuple(
            CarrierPose(
                p.carrier,
                p.frame,
                np.array(p.position_rig_mm),
                np.array(p.rotation_carrier_to_rig),
            )
            for p in model.places
        ),
        covariance,
        NoiseModel(
            np.array([c.sigma_scale for c in model.cameras]),
            np.array([c.sigma_added_px for c in model.cameras]),
        ),
        model.datum,
        record_of(CalibrationQuality, model.quality),
        blur_px=np.array([np.nan if c.blur_px is None else c.blur_px for c in model.cameras]),
    )
    return CalibrationRecord(model.name, model.made_utc, calibration)


def _camera_of(model: CameraModel) -> CalibratedCamera:
    interior = Interior(
        model.focal_length_px,
        np.array(model.principal_point_px),
        np.array(model.distortion),
        model.affinity,
    )
    pose = Pose(np.array(model.position_rig_mm), np.array(model.rotation_rig_to_camera))
    size = (model.image_size_px[0], model.image_size_px[1])
    return CalibratedCamera(model.name, size, interior, pose)


def _must_agree(model: CalibrationModel, targets: TargetSet, source: str) -> None:
    names = [c.name for c in model.cameras]
    if len(model.target_mm) != len(targets.ids) or len(set(names)) != len(names) or not names:
        raise InputError(
            "calibration-file",
            f"{source}: cameras or target coordinates do not fit one another",
            "give the file as it was written",
        )
    if any(c.sigma_scale <= 0.0 or c.sigma_added_px < 0.0 for c in model.cameras):
        raise InputError(
            "calibration-file",
            f"{source}: a sigma_scale is not positive, or a sigma_added_px negative",
            "give the file as it was written",
        )


def write_calibration(path: Path, record: CalibrationRecord, overwrite: bool = False) -> None:
    """Writes ``calibration.json``, whole or not at all."""
    text = json.dumps(calibration_document(record), allow_nan=False, ensure_ascii=False) + "\n"
    write_whole(path, text.encode(), overwrite)


def read_calibration(path: Path) -> CalibrationRecord:
    """Reads ``calibration.json``; raises a one-line :class:`InputError`."""
    return calibration_from(read_limited(path), path.name)
