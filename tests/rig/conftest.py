"""A small honest network: real cameras about a head, figures computed from first principles."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from geometry.camera import RigCamera
from geometry.frames import Pose
from geometry.optics import depth_of_field_mm
from geometry.raycast import Occluder
from geometry.subject import Subject
from geometry.surface import SurfacePoints
from rig.bodies import clearance_table_mm, place_body
from rig.examples import example_rig
from rig.sight import seen_by
from solver.limits import Limits
from solver.result import (
    CameraTable,
    ConstraintRow,
    CoverageShare,
    Design,
    PointTable,
    Quality,
    Sense,
    SolverReport,
    StartReport,
    Status,
)

REPO = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def repo() -> Path:
    return REPO


def egg_head() -> tuple[np.ndarray, np.ndarray]:
    """A watertight egg of 150 x 190 x 210 mm with a nose: enough of a head to look at."""
    from trimesh.creation import icosphere

    ball = icosphere(subdivisions=4)
    vertices = np.array(ball.vertices) * [75.0, 95.0, 105.0]
    nose = np.exp(-(((vertices[:, 0]) / 12.0) ** 2) - ((vertices[:, 2] + 10.0) / 20.0) ** 2)
    vertices[:, 1] -= np.where(vertices[:, 1] < 0.0, 22.0 * nose, 0.0)
    return vertices, np.array(ball.faces)


@pytest.fixture(scope="session")
def subject() -> Subject:
    import trimesh

    vertices, faces = egg_head()
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    front = mesh.vertex_normals[:, 1] < -0.45
    points = SurfacePoints(vertices[front], mesh.vertex_normals[front])
    return Subject(points.subset(np.arange(0, len(points), 4)), points, Occluder(vertices, faces))


def ring(count: int, radius_mm: float, stand_off_mm: float) -> tuple[RigCamera, ...]:
    """Cameras of the face example on a ring in front of the subject."""
    camera = example_rig("face").camera
    cameras = []
    for k in range(count):
        turn = 2.0 * np.pi * k / count
        across, up = radius_mm * np.cos(turn), radius_mm * np.sin(turn)
        back = np.sqrt(stand_off_mm**2 - radius_mm**2)
        pose = Pose.looking_at(np.array([across, -back, up]), np.array([0.0, -60.0, 0.0]))
        focus = float(np.linalg.norm(pose.position_rig_mm - [0.0, -105.0, 0.0]))
        cameras.append(RigCamera(f"cam{k + 1:02d}", camera, pose, focus))
    return tuple(cameras)


def _covariance(cameras: tuple[RigCamera, ...], seen: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Eq 6 by central differences of the projection itself, with a prior of 10 mm."""
    normal = np.broadcast_to(np.eye(3) / 100.0, (len(points), 3, 3)).copy()
    step = 1e-3
    for camera, mask in zip(cameras, seen, strict=True):
        jacobian = np.stack(
            [
                (
                    camera.camera.project(camera.pose, points + step * axis)[0]
                    - camera.camera.project(camera.pose, points - step * axis)[0]
                )
                / (2.0 * step)
                for axis in np.eye(3)
            ],
            axis=2,
        )
        weighted = np.einsum("pki,pkj->pij", jacobian, jacobian) / 0.5**2
        normal[mask] += weighted[mask]
    return np.linalg.inv(normal)


def judge(cameras: tuple[RigCamera, ...], subject: Subject, limits: Limits) -> Quality:
    """The figures of a network, computed the plain way."""
    points, n = subject.check_points, len(cameras)
    seen = np.array(
        [seen_by(c, points, subject.occluder, limits.incidence.ray_max_deg) for c in cameras]
    )
    covariance = _covariance(cameras, seen, points.points_mm)
    sigma = np.sqrt(np.linalg.eigvalsh(covariance)[:, -1])
    places = np.array([c.pose.position_rig_mm for c in cameras])
    axes = np.array([c.pose.axis_rig for c in cameras])
    away = np.linalg.norm(places - points.centroid_mm, axis=1)
    base = np.linalg.norm(places[:, None] - places[None], axis=2)
    gaps = clearance_table_mm(tuple(place_body(c) for c in cameras)).min(axis=1)
    rows, gsd, incidence, depths, focus, sharp = [], [], [], [], [], []
    for i, camera in enumerate(cameras):
        lens = camera.camera
        _, depth = lens.project(camera.pose, points.points_mm[seen[i]])
        way = places[i] - points.points_mm[seen[i]]
        cosine = np.einsum("ij,ij->i", way, points.normals[seen[i]]) / np.linalg.norm(way, axis=1)
        angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        pixel = depth / lens.focal_length_px
        near, far = depth_of_field_mm(
            camera.focus_distance_mm,
            lens.focal_length_mm,
            lens.f_number,
            lens.circle_of_confusion_mm,
        )
        gsd.append([pixel.min(), pixel.mean(), pixel.max()])
        incidence.append([angle.mean(), angle.max()])
        depths.append([depth.min(), depth.max()])
        focus.append([near, far])
        sharp.append((depth >= near) & (depth <= far))
        slack = float(depth.min() - near)
        rows.append(
            ConstraintRow(
                f"depth_of_field/{camera.name}",
                float(depth.min()),
                near,
                Sense.AT_LEAST,
                "mm",
                slack,
                abs(slack) < 0.5,
                slack >= 0.0,
            )
        )
    for i in range(n):
        for j in range(i):
            slack = float(base[i, j] / ((away[i] + away[j]) / 2.0) - 0.1)
            rows.append(
                ConstraintRow(
                    f"base_height_min/{cameras[j].name}-{cameras[i].name}",
                    slack + 0.1,
                    0.1,
                    Sense.AT_LEAST,
                    "",
                    slack,
                    abs(slack) < 1e-4,
                    slack >= 0.0,
                )
            )
    views = seen.sum(axis=0)
    in_focus = np.zeros_like(views)
    for mask, good in zip(seen, sharp, strict=True):
        in_focus[mask] += good
    cost = float(np.linalg.norm(covariance, axis=(1, 2)).mean())
    heights = (away[:, None] + away[None]) / 2.0
    convergence = np.degrees(np.arccos(np.clip(axes @ axes.T, -1.0, 1.0)))
    return Quality(
        cost_mm2=cost,
        sigma_median_mm=float(np.median(sigma)),
        sigma_p95_mm=float(np.percentile(sigma, 95)),
        sigma_max_mm=float(sigma.max()),
        coverage=tuple(CoverageShare(k, float((views >= k).mean())) for k in range(1, n + 1)),
        in_focus_share=float(np.concatenate(sharp).mean()),
        in_frame_share=1.0,
        base_height=base / heights,
        convergence_deg=convergence,
        cameras=CameraTable(
            seen.sum(axis=1),
            np.array(gsd),
            np.array(incidence),
            np.array(depths),
            np.array(focus),
            away,
            gaps,
        ),
        points=PointTable(points, covariance, sigma, views, in_focus),
        constraints=tuple(rows),
    )


def make_design(
    cameras: tuple[RigCamera, ...], start: tuple[RigCamera, ...], subject: Subject
) -> Design:
    limits = example_rig("face").limits
    quality, before = judge(cameras, subject, limits), judge(start, subject, limits)
    starts = (
        StartReport(0, "k-means", True, quality.cost_mm2, 0.0, 40, 3, "first-order optimum"),
        StartReport(1, "jittered", False, quality.cost_mm2 * 1.2, 0.01, 55, 4, "iteration limit"),
    )
    report = SolverReport(
        "ipopt",
        Status.CONVERGED,
        "first-order optimum within tolerance",
        3.2e-9,
        40,
        3,
        7,
        1.234,
        starts,
    )
    return Design(cameras, quality, start, before, limits, report)


@pytest.fixture(scope="session")
def design(subject: Subject) -> Design:
    return make_design(ring(7, 260.0, 620.0), ring(7, 90.0, 700.0), subject)


@pytest.fixture
def hostile_design(design: Design) -> Design:
    """The same with names that would break a page that does not escape them."""
    evil = "</script><script>document.title='owned'</script><img src=x onerror=alert(1)>"
    cameras = (replace(design.cameras[0], name=evil), *design.cameras[1:])
    row = replace(design.quality.constraints[0], name=f"frame/{evil}")
    quality = replace(design.quality, constraints=(row, *design.quality.constraints[1:]))
    return replace(design, cameras=cameras, quality=quality)
