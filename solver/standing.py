"""Rigs that stand already: cameras that cannot be, and all figures of those that can."""

from __future__ import annotations

import numpy as np

from common.errors import InputError
from geometry.camera import RigCamera
from geometry.frames import Pose
from geometry.optics import blur_ratio
from geometry.raycast import Occluder
from geometry.subject import Subject
from solver.limits import Limits
from solver.quality import evaluate
from solver.result import NOBODY, Design, SolverReport, Status

_LOOKS = 200
_INSIDE = 0.5
"""Share of looks out of a closed head that meet its inside, open necks and torn ears allowed for;
from outside hardly any does."""

_LARGEST_RAD = 6.3
_ASKEW_DEG = 60.0


def as_it_stands(
    subject: Subject, cameras: tuple[RigCamera, ...], limits: Limits, seed: int = 0
) -> Design:
    """The design that ``cameras`` are.

    Raises :class:`InputError` for fewer than two of them, and for those that cannot be.
    """
    if len(cameras) < 2:
        problem = f"{len(cameras)} cameras stand, and none is to be placed"
        raise InputError("no-cameras", problem, "ask for at least one more camera")
    check_places(subject, cameras, limits)
    quality = evaluate(subject, cameras, limits)
    report = SolverReport(
        engine=NOBODY,
        status=Status.CONVERGED if quality.feasible else Status.INFEASIBLE,
        why_stopped="no camera was to be placed, so the rig is told of as it stands",
        kkt_error=np.nan,
        iterations=0,
        rounds=0,
        seed=seed,
        seconds=0.0,
        starts=(),
    )
    return Design(cameras, quality, cameras, quality, limits, report)


def check_places(subject: Subject, cameras: tuple[RigCamera, ...], limits: Limits) -> None:
    """Raise :class:`InputError` for the first camera that cannot stand or look as it is said to.

    Its centre or body is within the scan, nothing so near can be sharp, or it looks past the
    subject with angles that are radians.
    """
    for camera in cameras:
        _check_body(subject, camera)
        _check_focus(subject, camera, limits)
        check_angles(subject, camera.pose, f"camera {camera.name!r}")


def _check_body(subject: Subject, camera: RigCamera) -> None:
    where = ", ".join(f"{v:.0f}" for v in camera.pose.position_rig_mm)
    remedy = "move it out: position_mm is in millimetres in the rig frame, and so is the scan"
    if inside(subject.occluder, camera.pose):
        problem = f"camera {camera.name!r} at ({where}) mm is inside the scan of the subject"
        raise InputError("camera-in-subject", problem, remedy)
    if _touches(subject.occluder, camera):
        problem = f"the body of camera {camera.name!r} at ({where}) mm reaches into the subject"
        raise InputError("camera-in-subject", problem, remedy)


def inside(occluder: Occluder, pose: Pose) -> bool:
    """Whether a camera's centre is within the scan: most ways out of it meet its inside."""
    k = np.arange(_LOOKS) + 0.5
    up, turn = 1.0 - 2.0 * k / _LOOKS, np.pi * (1.0 + np.sqrt(5.0)) * k
    flat = np.sqrt(1.0 - up**2)
    ways = np.stack([flat * np.cos(turn), flat * np.sin(turn), up], axis=1)
    met, _ = occluder.first_hits(np.tile(pose.position_rig_mm, (_LOOKS, 1)), ways)
    hit = np.flatnonzero(met >= 0)
    if not len(hit):
        return False
    outward = np.einsum("nk,nk->n", occluder.face_normals(met[hit]), ways[hit]) > 0.0
    return bool(outward.sum() > _INSIDE * _LOOKS)


def _touches(occluder: Occluder, camera: RigCamera) -> bool:
    """Whether a corner of the scan lies within the camera's box or lens."""
    if not len(occluder.vertices_mm):
        return False
    body = camera.camera.body
    local = camera.pose.to_camera(occluder.vertices_mm)
    box = (np.abs(local - body.centre_camera_mm) < body.size_mm / 2.0).all(axis=1)
    deep = local[:, 2] - body.front_z_mm
    round_ = np.linalg.norm(local[:, :2], axis=1) < body.lens_diameter_mm / 2.0
    return bool((box | (round_ & (deep > 0.0) & (deep < body.lens_length_mm))).any())


def _check_focus(subject: Subject, camera: RigCamera, limits: Limits) -> None:
    kind = camera.camera
    nearest = kind.min_focus_distance_mm
    if limits.depth_of_field:
        optics = (kind.focal_length_mm, kind.f_number, kind.circle_of_confusion_mm)
        nearest /= 1.0 + blur_ratio(nearest, *optics)
    middle = subject.design_points.centroid_mm
    away = float(np.linalg.norm(camera.pose.position_rig_mm - middle))
    if away < nearest:
        raise InputError(
            "camera-too-near",
            f"camera {camera.name!r} stands {away:.0f} mm from the middle of the subject's points, "
            f"but its lens keeps everything nearer than {nearest:.0f} mm unsharp",
            "move it away, correct its position_mm, or give a lens with a smaller min_focus_mm",
        )


def check_angles(subject: Subject, pose: Pose, who: str) -> None:
    """Raise :class:`InputError` where angles look past the subject, but not as radians."""
    angles = pose.omega_phi_kappa_deg
    if not 0.0 < np.abs(angles).max() <= _LARGEST_RAD:
        return
    meant = Pose.from_omega_phi_kappa(pose.position_rig_mm, np.degrees(angles))
    if _askew_deg(subject, pose) > _ASKEW_DEG > 2.0 * _askew_deg(subject, meant):
        given, better = (
            ", ".join(f"{v:.4g}" for v in a + 0.0) for a in (angles, np.degrees(angles))
        )
        raise InputError(
            "camera-angles",
            f"{who} looks past the subject with omega_phi_kappa_deg = [{given}]",
            f"give degrees: did you mean [{better}] (radians)?",
        )


def _askew_deg(subject: Subject, pose: Pose) -> float:
    """Angle between a camera's axis and the way to the middle of the subject."""
    way = subject.design_points.centroid_mm - pose.position_rig_mm
    cosine = float(way @ pose.axis_rig) / max(float(np.linalg.norm(way)), 1e-9)
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
