"""USD: a stage with the cameras, through the optional package usd-core.

Centimetres, so that apertures and focal lengths, which USD counts in tenths of a unit, are
millimetres; Z up; cameras look along -z with y up. The principal point is an offset of the
aperture; distortion is kept as a custom attribute.
"""

from __future__ import annotations

import re
from importlib import import_module
from typing import Any

from common.errors import InputError
from geometry.camera import LensModel, RigCamera
from geometry.exchange.base import Cameras, ExportOptions, Files, Format, image_name, image_stem
from geometry.exchange.conventions import (
    CENTIMETRES_PER_MM,
    graphics_camera_to_rig,
    principal_offset_px,
)

METRES_PER_UNIT = 0.01


def _modules() -> tuple[Any, Any, Any, Any]:
    # usd-core is 29 MB and rarely wanted, so it is an extra and imported only here.
    try:
        gf, sdf = import_module("pxr.Gf"), import_module("pxr.Sdf")
        usd, geom = import_module("pxr.Usd"), import_module("pxr.UsdGeom")
    except ImportError as error:
        raise InputError(
            "extra-missing",
            "the USD export needs the package usd-core, which is not installed",
            "install rigwright[usd], or choose another format",
        ) from error
    return gf, sdf, usd, geom


def prim_names(cameras: Cameras) -> list[str]:
    """A valid and unique prim name for each camera: letters, digits and underscores only."""
    names: list[str] = []
    for camera in cameras:
        base = re.sub(r"[^A-Za-z0-9_]", "_", image_stem(camera.name))
        base = base if not base[:1].isdigit() else f"_{base}"
        name, again = base, 2
        while name in names:
            name, again = f"{base}_{again}", again + 1
        names.append(name)
    return names


def _define(stage: Any, path: str, rig_camera: RigCamera, options: ExportOptions) -> None:  # noqa: ANN401
    gf, sdf, _, geom = _modules()
    camera = rig_camera.camera
    right, down = principal_offset_px(camera) * camera.pixel_pitch_mm
    prim = geom.Camera.Define(stage, path)
    prim.CreateHorizontalApertureAttr(camera.sensor_size_mm[0])
    prim.CreateVerticalApertureAttr(camera.sensor_size_mm[1])
    # The aperture moves against the principal point; USD's vertical axis points up.
    prim.CreateHorizontalApertureOffsetAttr(-float(right))
    prim.CreateVerticalApertureOffsetAttr(float(down))
    prim.CreateFocalLengthAttr(camera.focal_length_mm)
    prim.CreateFocusDistanceAttr(rig_camera.focus_distance_mm * CENTIMETRES_PER_MM)
    prim.CreateFStopAttr(camera.f_number)
    matrix = graphics_camera_to_rig(rig_camera.pose, CENTIMETRES_PER_MM)
    # Gf multiplies row vectors from the left: its matrices are the transposes of ours.
    prim.AddTransformOp().Set(gf.Matrix4d(*matrix.T.ravel().tolist()))
    attributes = (
        ("name", sdf.ValueTypeNames.String, rig_camera.name),
        ("image", sdf.ValueTypeNames.String, image_name(rig_camera, options)),
        ("imageSizePx", sdf.ValueTypeNames.Int2, gf.Vec2i(*camera.image_size_px)),
        ("distortion", sdf.ValueTypeNames.DoubleArray, camera.distortion.tolist()),
    )
    for name, kind, value in attributes:
        prim.GetPrim().CreateAttribute(f"rigwright:{name}", kind).Set(value)


def write(cameras: Cameras, options: ExportOptions) -> Files:
    """``cameras.usda``; raises :class:`InputError` when usd-core is not installed."""
    _, _, usd, geom = _modules()
    stage = usd.Stage.CreateInMemory()
    geom.SetStageUpAxis(stage, geom.Tokens.z)
    geom.SetStageMetersPerUnit(stage, METRES_PER_UNIT)
    stage.SetDefaultPrim(geom.Xform.Define(stage, "/Rig").GetPrim())
    for name, camera in zip(prim_names(cameras), cameras, strict=True):
        _define(stage, f"/Rig/{name}", camera, options)
    return {"cameras.usda": stage.GetRootLayer().ExportToString().encode()}


FORMAT = Format(
    "usd",
    "USD programs",
    "a USD stage with the cameras (needs the extra usd)",
    ("cameras.usda",),
    write,
    tuple(LensModel),
)
