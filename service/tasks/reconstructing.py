"""Reconstructions: pictures of one instant and the cameras that took them, in; a cloud, out."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from calibration.detection.images import read_colour
from calibration.exports import rig_cameras
from calibration.files import read_calibration
from common.errors import InputError
from common.progress import Progress, within
from evaluation.extras import require_numba
from evaluation.reconstruction.cloudfile import write_cloud
from evaluation.reconstruction.depthfile import write_depth_maps
from evaluation.reconstruction.meshfile import mesh_files
from evaluation.reconstruction.reconstructing import (
    Reconstruction,
    ReconstructionOptions,
    reconstruct,
)
from evaluation.reconstruction.surface import SurfaceMesh, meshed
from evaluation.reconstruction.texture import Texture, textured
from evaluation.reconstruction.views import View, view_of
from evaluation.report.pages import reconstruction_page
from geometry.camera import RigCamera
from rig.design.designfile import ReadDesign, read_design
from service.jobs.engine import Running, Task
from service.kinds.reconstruction import (
    CameraPart,
    DoubtPart,
    ReconstructionRequest,
    ReconstructionResult,
    TexturePart,
)
from service.pictures.listing import Picture
from service.tasks.seeing import taken_pictures

READING = 0.1
"""Share of the progress that goes to reading the pictures."""
MATCHING = 0.92
"""How far it has come when the points are there."""

SHOWN_FACES = 60_000
"""A page with more turns slowly."""


def reconstruction(
    task: Task[ReconstructionRequest, ReconstructionResult], running: Running
) -> ReconstructionResult:
    """Write ``cloud.ply``, the mesh, the depth maps that were asked for, and ``report.html``.

    The cameras come from the input ``calibration``, or ``design`` where they are as designed.
    """
    require_numba()
    design = read_design(task.inputs["design"]) if "design" in task.inputs else None
    cameras = _cameras(task.inputs, design)
    with tempfile.TemporaryDirectory(prefix="pictures-", dir=task.folder.parent) as temporary:
        frame, chosen = _one_frame(taken_pictures(task, Path(temporary)), task.request.frame)
        views = _views(cameras, chosen, running)
    options = replace(
        matching_options(design, task.request.stride_px, task.run.workers),
        keep_maps=task.request.depth_maps,
    )
    matching = within(running.report, READING, MATCHING, "matching")
    done = reconstruct(views, options=options, progress=matching, cancel=running.cancel)
    missing = sorted({c.name for c in cameras} - {v.name for v in views})
    running.report(Progress("meshing", MATCHING))
    mesh = meshed(done.cloud, task.request.cell_mm, options.workers)
    write_cloud(task.folder / "cloud.ply", done.cloud)
    texture = textured(mesh, views) if task.request.texture else None
    for ending in task.request.meshes:
        for name, content in mesh_files(mesh, ending, texture).items():
            (task.folder / name).write_bytes(content)
    if task.request.depth_maps:
        write_depth_maps(task.folder / "depthmaps", done.maps)
    running.report(Progress("drawing", 0.97))
    title = task.request.name or f"Reconstruction of {frame}"
    notes = [f"No picture of {', '.join(missing)}."] if missing else []
    notes += [doubt.words for doubt in done.doubts]
    page = reconstruction_page(done, _shown(mesh, done, options.workers), title, notes)
    (task.folder / "report.html").write_text(page, encoding="utf-8")
    running.report(Progress("done", 1.0))
    return _result(done, mesh, texture, frame, missing)


def _shown(mesh: SurfaceMesh, done: Reconstruction, workers: int) -> SurfaceMesh:
    """The mesh, or a coarser one where a page could not hold it."""
    if len(mesh.faces) <= SHOWN_FACES:
        return mesh
    # Triangles of about half a cube's face: so many cubes' faces make the area.
    return meshed(done.cloud, (2.5 * mesh.area_mm2() / SHOWN_FACES) ** 0.5, workers)


def matching_options(
    design: ReadDesign | None, stride_px: int, workers: int
) -> ReconstructionOptions:
    """How to match: what the design's rig file counts on."""
    options = ReconstructionOptions(stride_px=stride_px, workers=max(workers, 1))
    if design is None or design.file.rig is None:
        return options
    told = design.file.rig.matching
    return replace(
        options,
        farthest_deg=told.max_angle_deg,
        steepest_deg=told.max_incidence_deg,
        largest_ratio=told.max_scale_ratio,
    )


def _cameras(inputs: Mapping[str, Path], design: ReadDesign | None) -> tuple[RigCamera, ...]:
    like = design.cameras if design is not None else ()
    if "calibration" in inputs:
        return rig_cameras(read_calibration(inputs["calibration"]).calibration.cameras, like)
    return like


def _one_frame(pictures: Sequence[Picture], wanted: str | None) -> tuple[str, dict[str, Picture]]:
    """The pictures of one instant by camera. Raises :class:`InputError` where it is not clear."""
    frames = sorted({p.frame for p in pictures})
    if wanted is None and len(frames) > 1:
        raise InputError(
            "frames",
            f"the pictures show {len(frames)} instants ({frames[0]} to {frames[-1]})",
            "name one with --frame, or one capture of the session with --capture",
        )
    frame = frames[0] if wanted is None else wanted
    if frame not in frames:
        raise InputError(
            "frame", f"no picture is of the instant {frame!r}", f"give one of {', '.join(frames)}"
        )
    return frame, {p.camera: p for p in pictures if p.frame == frame}


def _views(
    cameras: Sequence[RigCamera], pictures: Mapping[str, Picture], running: Running
) -> list[View]:
    known = [camera for camera in cameras if camera.name in pictures]
    if len(known) < 2:
        raise InputError(
            "cameras-few",
            f"{len(known)} of the {len(cameras)} cameras of this rig have a picture here "
            f"(pictures are of {', '.join(sorted(pictures)) or 'none'})",
            "name the folders of pictures as the cameras are named",
        )
    views = []
    for number, camera in enumerate(known):
        running.report(Progress("reading the pictures", READING * number / len(known)))
        views.append(view_of(read_colour(pictures[camera.name].path), camera))
    return views


def _result(
    done: Reconstruction,
    mesh: SurfaceMesh,
    texture: Texture | None,
    frame: str,
    missing: list[str],
) -> ReconstructionResult:
    return ReconstructionResult(
        frame=frame,
        points=len(done.cloud),
        sigma_median_mm=float(np.median(done.cloud.sigma_mm)),
        views_median=int(np.median(done.cloud.views)),
        centre_rig_mm=[float(v) for v in done.volume.centre_rig_mm],
        radius_mm=done.volume.radius_mm,
        cameras=[
            CameraPart(camera=c.name, tried=c.tried, measured=c.measured, points=c.points)
            for c in done.cameras
        ],
        mesh_faces=len(mesh.faces),
        mesh_area_mm2=round(mesh.area_mm2(), 1),
        without_pictures=missing,
        texture=None if texture is None else _texture(texture),
        doubts=tuple(DoubtPart(camera=d.camera, kind=d.kind, words=d.words) for d in done.doubts),
    )


def _texture(texture: Texture) -> TexturePart:
    height, width = texture.image.shape[:2]
    return TexturePart(width_px=width, height_px=height, unseen_faces=texture.unseen)
