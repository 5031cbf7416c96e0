"""Small subjects and rigs for tests: an ellipsoid face, the paper's wall."""

from __future__ import annotations

import numpy as np

from geometry.camera import Body, Camera, RigCamera
from geometry.frames import Pose
from geometry.raycast import Occluder
from geometry.subject import Subject
from geometry.surface import SurfacePoints
from solver.limits import (
    BaseHeight,
    Centring,
    Coverage,
    CoverageTier,
    Frame,
    Incidence,
    Limits,
    PoseBounds,
    StandOff,
)
from solver.problem import camera_at
from solver.starts import kmeans_start

SEMI_AXES_MM = np.array([75.0, 95.0, 105.0])


def ellipsoid_mesh(rings: int = 60, sectors: int = 90) -> tuple[np.ndarray, np.ndarray]:
    """A closed ellipsoid as vertices and faces."""
    polar = np.linspace(0.0, np.pi, rings + 1)[1:-1]
    turn = np.linspace(0.0, 2.0 * np.pi, sectors, endpoint=False)
    grid = np.stack(
        [
            np.outer(np.sin(polar), np.cos(turn)),
            np.outer(np.sin(polar), np.sin(turn)),
            np.outer(np.cos(polar), np.ones(sectors)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    vertices = np.concatenate([grid, [[0, 0, 1.0], [0, 0, -1.0]]]) * SEMI_AXES_MM
    faces = []
    north, south = len(grid), len(grid) + 1
    for r in range(rings - 2):
        for s in range(sectors):
            a, b = r * sectors + s, r * sectors + (s + 1) % sectors
            faces += [(a, a + sectors, b), (b, a + sectors, b + sectors)]
    last = (rings - 2) * sectors
    for s in range(sectors):
        faces += [(north, s, (s + 1) % sectors), (south, last + (s + 1) % sectors, last + s)]
    return vertices, np.array(faces)


def ellipsoid_points(count: int, seed: int, half_angle_deg: float = 55.0) -> SurfacePoints:
    """Points of the ellipsoid whose normals are within ``half_angle_deg`` of -Y."""
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=(40 * count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    points = direction * SEMI_AXES_MM
    normals = points / SEMI_AXES_MM**2
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    keep = np.flatnonzero(normals[:, 1] < -np.cos(np.radians(half_angle_deg)))[:count]
    return SurfacePoints(points[keep], normals[keep])


def face(count: int = 150, check: int = 600) -> Subject:
    """An ellipsoid face with the ellipsoid as occluder."""
    return Subject(
        ellipsoid_points(count, 1), ellipsoid_points(check, 2), Occluder(*ellipsoid_mesh())
    )


def compact_camera(**changes: object) -> Camera:
    """The paper's camera: 62 x 45 x 32 mm, 50 mm lens, 26 degrees."""
    values = {
        "name": "compact",
        "image_size_px": (4000, 2667),
        "pixel_pitch_mm": 23.1 / 4000,
        "focal_length_mm": 50.0,
        "f_number": 16.0,
        "circle_of_confusion_mm": 2 * 23.1 / 4000,
        "min_focus_distance_mm": 350.0,
        "body": Body([62.0, 45.0, 32.0], [0.0, 0.0, -30.0], 30.0, 25.0),
    }
    return Camera(**(values | changes))


def face_limits(**changes: object) -> Limits:
    """Limits of a face rig of the paper's kind."""
    values = {
        "base_height": BaseHeight(min=0.15),
        "incidence": Incidence(ray_max_deg=70.0),
        "frame": Frame(20.0),
        "coverage": Coverage((CoverageTier(2, 0.999), CoverageTier(3, 0.95))),
        "stand_off": StandOff(400.0, 1500.0),
    }
    return Limits(**(values | changes))


def names(count: int) -> tuple[str, ...]:
    """cam01, cam02, ..."""
    return tuple(f"cam{k:02d}" for k in range(1, count + 1))


def face_cameras(
    subject: Subject, count: int, limits: Limits | None = None, seed: int = 0
) -> tuple[RigCamera, ...]:
    """The k-means start on a subject."""
    return kmeans_start(subject, compact_camera(), limits or face_limits(), names(count), seed)


WALL_TARGETS_MM = 1000.0 * np.array(
    [
        (-19.5, 1.2, 12.0),
        (19.5, 1.2, 12.0),
        (19.5, 1.2, -2.0),
        (-19.5, 1.2, -2.0),
        (0.0, 1.2, 5.0),
        (-10.0, 1.2, 12.0),
        (10.0, 1.2, 12.0),
        (10.0, 1.2, -2.0),
        (-10.0, 1.2, -2.0),
    ]
)

WALL_START = (
    (90.12, 5.51, 0.0, 1.00, -24.23, 4.82),
    (91.00, 0.48, 0.0, 0.40, -35.74, 5.80),
    (90.49, 5.22, 0.0, -0.82, -33.74, -0.85),
    (90.16, 4.98, 0.0, 0.58, -36.45, 1.15),
)

WALL_PRINTED = (
    (81.21, -21.09, 0.0, -14.00, -28.64, 5.82),
    (79.12, 23.49, 0.0, 15.40, -27.69, 7.93),
    (102.99, -24.20, 0.0, -15.82, -27.25, -0.44),
    (99.15, 23.85, 0.0, 15.58, -27.66, 1.32),
)
"""Table 2 of the paper: omega, phi, kappa in degrees, X, Y, Z in metres."""


def wall() -> Subject:
    """The nine targets of Table 2."""
    points = SurfacePoints(WALL_TARGETS_MM, np.tile([0.0, -1.0, 0.0], (9, 1)))
    return Subject(points, points, Occluder.none())


def wall_poses(table: tuple[tuple[float, ...], ...]) -> tuple[Pose, ...]:
    """Poses of a table of angles and metres."""
    return tuple(
        Pose.from_omega_phi_kappa(np.array(r[3:]) * 1000.0, np.array(r[:3])) for r in table
    )


def wall_camera() -> Camera:
    """Sensor 22.3 x 14.9 mm; 17.2 mm fits the table best."""
    return Camera(
        "wall", (4460, 2980), 0.005, 17.2, 8.0, 0.01, 500.0, Body([100.0] * 3, [0.0, 0.0, -50.0])
    )


def wall_cameras(table: tuple[tuple[float, ...], ...]) -> tuple[RigCamera, ...]:
    """Cameras at the poses of a table."""
    middle = WALL_TARGETS_MM.mean(axis=0)
    return tuple(
        camera_at(wall_camera(), f"cam{k:02d}", pose, middle)
        for k, pose in enumerate(wall_poses(table), 1)
    )


def wall_limits(**changes: object) -> Limits:
    """The constraints of Table 2, heights within +-15 m as well."""
    values = {
        "bounds": PoseBounds(45.0, 45.0, 45.0, 15000.0, 15000.0, 15000.0),
        "base_height": BaseHeight(min=0.2, mean_min=0.6),
        "incidence": Incidence(ray_max_deg=89.0, mean_max_deg=30.0),
        "frame": Frame(),
        "centring": Centring(),
        "depth_of_field": False,
        "body_clearance_mm": None,
        "sight_line_clearance_mm": None,
        "coverage": Coverage(unseen_sigma_mm=1e6),
    }
    return Limits(**(values | changes))
