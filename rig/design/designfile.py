"""Design files: a :class:`solver.result.Design` as JSON, and cameras read back from one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from common.errors import InputError
from common.files.reading import read_json
from common.files.strict import validated
from common.version import program_version
from geometry.arrays import Floats
from geometry.camera import Body, Camera, RigCamera
from geometry.frames import Pose, rotation_from_omega_phi_kappa
from geometry.rotations import nearest_rotation
from geometry.scan import Scan
from rig.design.designmodel import DesignFile, LensFacts, PlacedCamera
from rig.design.figures import constraint_figures, point_figures, quality_figures, solver_figures
from rig.specification.rigfile import RigFile
from rig.specification.sections.camera import BodySection
from rig.specification.spec import RigSpec
from solver.result import Design, Quality

SCHEMA = "rigwright.design/1"
EVALUATION_SCHEMA = "rigwright.evaluation/1"
LARGEST_FILE_BYTES = 200_000_000
SAME_ROTATION = 1e-3
"""Largest difference of a matrix to the one its angles give before they contradict each other."""

SAME_MATRIX_PX = 1e-6


@dataclass(frozen=True, eq=False)
class ReadDesign:
    """What a design file says: the cameras, ready to be evaluated, and the file itself."""

    name: str
    cameras: tuple[RigCamera, ...]
    file: DesignFile


def design_document(
    design: Design,
    *,
    spec: RigSpec | None = None,
    scan: Scan | None = None,
    scan_name: str = "",
) -> dict[str, Any]:
    """The whole design as JSON data, without NaN or infinity; ``json.dumps`` keeps every bit."""
    names = [camera.name for camera in design.cameras]
    start, quality = design.start_quality, design.quality
    document: dict[str, Any] = {
        "schema": SCHEMA,
        "rigwright": program_version(),
        "name": spec.name if spec is not None else "rig",
        "feasible": bool(design.feasible),
        "cameras": [placed_camera(camera) for camera in design.cameras],
        "quality": quality_figures(quality, names),
        "constraints": constraint_figures(quality.constraints),
        "solver": solver_figures(design.solver),
        "points": point_figures(quality),
        "start": {
            "cameras": [_start_pose(camera) for camera in design.start_cameras],
            "quality": quality_figures(start, [camera.name for camera in design.start_cameras]),
            "constraints": constraint_figures(start.constraints),
            "points": point_figures(start),
        },
    }
    if scan is not None:
        document["scan"] = scan_facts(scan, scan_name)
    if spec is not None:
        document["rig"] = RigFile.from_spec(spec).model_dump(by_alias=True, exclude_none=True)
    return document


def evaluation_document(cameras: tuple[RigCamera, ...], quality: Quality) -> dict[str, Any]:
    """The figures of given cameras as JSON data: the same keys as in a design file."""
    return {
        "schema": EVALUATION_SCHEMA,
        "rigwright": program_version(),
        "feasible": bool(quality.feasible),
        "cameras": [placed_camera(camera) for camera in cameras],
        "quality": quality_figures(quality, [camera.name for camera in cameras]),
        "constraints": constraint_figures(quality.constraints),
        "points": point_figures(quality),
    }


def scan_facts(scan: Scan, name: str) -> dict[str, Any]:
    """The scan a design was made for, as JSON data."""
    return {
        "name": name,
        "vertices": len(scan.vertices_mm),
        "faces": len(scan.faces),
        "size_mm": np.round(np.ptp(scan.vertices_mm, axis=0), 3).tolist(),
        "rig_from_file": scan.rig_from_file.tolist(),
        "notes": [{"kind": note.kind, "text": note.text} for note in scan.notes],
    }


def placed_camera(rig_camera: RigCamera) -> dict[str, Any]:
    """One camera as JSON data; reading it back gives the same camera to the last bit."""
    camera, pose = rig_camera.camera, rig_camera.pose
    lens = LensFacts(
        kind=camera.name,
        pixel_pitch_mm=camera.pixel_pitch_mm,
        focal_length_mm=camera.focal_length_mm,
        f_number=camera.f_number,
        circle_of_confusion_mm=camera.circle_of_confusion_mm,
        min_focus_mm=camera.min_focus_distance_mm,
        set_focus_mm=camera.focus_distance_mm,
    )
    placed = PlacedCamera(
        name=rig_camera.name,
        position_mm=pose.position_rig_mm.tolist(),
        rotation_rig_to_camera=pose.rotation_rig_to_camera.tolist(),
        omega_phi_kappa_deg=pose.omega_phi_kappa_deg.tolist(),
        image_size_px=list(camera.image_size_px),
        camera_matrix=camera.camera_matrix.tolist(),
        distortion=camera.distortion.tolist(),
        focus_distance_mm=rig_camera.focus_distance_mm,
        fixed=rig_camera.fixed,
        lens=lens,
        body=BodySection.from_body(camera.body),
    )
    return placed.model_dump()


def _start_pose(camera: RigCamera) -> dict[str, Any]:
    return {
        "name": camera.name,
        "position_mm": camera.pose.position_rig_mm.tolist(),
        "rotation_rig_to_camera": camera.pose.rotation_rig_to_camera.tolist(),
        "omega_phi_kappa_deg": camera.pose.omega_phi_kappa_deg.tolist(),
        "focus_distance_mm": camera.focus_distance_mm,
    }


def read_design(path: Path, default_camera: Camera | None = None) -> ReadDesign:
    """The cameras of a design file; raises a one-line :class:`InputError`.

    ``default_camera`` supplies lens and body where the file describes an existing rig by its
    poses and camera matrices only.
    """
    data = read_json(path, "design", "design file", LARGEST_FILE_BYTES)
    return design_from_mapping(data, path.name, default_camera)


def design_from_mapping(
    data: object, name: str = "design", default_camera: Camera | None = None
) -> ReadDesign:
    """The same from parsed JSON; ``name`` stands in front of every error."""
    file = validated(DesignFile, data, name)
    names = [camera.name for camera in file.cameras]
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        raise InputError(
            "value", f"{name}: two cameras are called {twice[0]!r}", "give each a name of its own"
        )
    cameras = tuple(_rig_camera(placed, default_camera, name) for placed in file.cameras)
    return ReadDesign(file.name or "rig", cameras, file)


def _rig_camera(placed: PlacedCamera, default: Camera | None, source: str) -> RigCamera:
    camera = _camera(placed, default, source)
    focus = placed.focus_distance_mm or camera.focus_distance_mm
    if focus is None:
        raise InputError(
            "key-missing", f"{source}: camera {placed.name!r} has no focus_distance_mm", "add it"
        )
    return RigCamera(placed.name, camera, _pose(placed, source), focus, placed.fixed)


def _pose(placed: PlacedCamera, source: str) -> Pose:
    position, angles = np.array(placed.position_mm), placed.omega_phi_kappa_deg
    if placed.rotation_rig_to_camera is None and angles is None:
        raise InputError(
            "key-missing",
            f"{source}: camera {placed.name!r} has no orientation",
            "give rotation_rig_to_camera or omega_phi_kappa_deg",
        )
    if placed.rotation_rig_to_camera is None:
        return Pose.from_omega_phi_kappa(position, np.array(angles))
    rotation = nearest_rotation(np.array(placed.rotation_rig_to_camera))
    if angles is not None:
        off = np.abs(rotation_from_omega_phi_kappa(np.array(angles)) - rotation).max()
        if off > SAME_ROTATION:
            raise InputError(
                "value",
                f"{source}: rotation_rig_to_camera and omega_phi_kappa_deg of camera "
                f"{placed.name!r} contradict each other",
                "correct one or leave it out",
            )
    return Pose(position, rotation)


def _camera(placed: PlacedCamera, default: Camera | None, source: str) -> Camera:
    matrix = np.array(placed.camera_matrix)
    lens, body = _lens_and_body(placed, matrix, default, source)
    camera = Camera(
        name=lens.kind,
        image_size_px=(placed.image_size_px[0], placed.image_size_px[1]),
        pixel_pitch_mm=lens.pixel_pitch_mm,
        focal_length_mm=lens.focal_length_mm,
        f_number=lens.f_number,
        circle_of_confusion_mm=lens.circle_of_confusion_mm,
        min_focus_distance_mm=lens.min_focus_mm,
        body=body,
        focus_distance_mm=lens.set_focus_mm,
        principal_point_px=matrix[:2, 2],
        distortion=np.array(placed.distortion),
    )
    if not np.allclose(camera.camera_matrix, matrix, rtol=1e-9, atol=SAME_MATRIX_PX):
        raise InputError(
            "value",
            f"{source}: camera_matrix of camera {placed.name!r} is not that of square pixels with "
            f"a focal length of {camera.focal_length_px:.3f} px",
            "correct the matrix, or the lens that contradicts it",
        )
    return camera


def _lens_and_body(
    placed: PlacedCamera, matrix: Floats, default: Camera | None, source: str
) -> tuple[LensFacts, Body]:
    """What the file says of lens and body, and the default camera's where it says nothing."""
    if placed.lens is not None and placed.body is not None:
        return placed.lens, placed.body.to_body()
    if default is None:
        missing = " and ".join(key for key in ("lens", "body") if getattr(placed, key) is None)
        raise InputError(
            "key-missing",
            f"{source}: camera {placed.name!r} does not say its {missing}",
            "add it or give a rig file",
        )
    body = default.body if placed.body is None else placed.body.to_body()
    return placed.lens or _lens_of(default, matrix), body


def _lens_of(default: Camera, matrix: Floats) -> LensFacts:
    """The default camera's lens, with the focal length that the matrix gives."""
    focal = float(matrix[0, 0]) * default.pixel_pitch_mm
    if not focal > 0.0:
        raise InputError("value", "a camera matrix has no positive focal length", "correct it")
    return LensFacts(
        kind=default.name,
        pixel_pitch_mm=default.pixel_pitch_mm,
        focal_length_mm=focal,
        f_number=default.f_number,
        circle_of_confusion_mm=default.circle_of_confusion_mm,
        min_focus_mm=default.min_focus_distance_mm,
    )
