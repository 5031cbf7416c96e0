"""Faces as a rig would measure them: the error model that thousands of probes are drawn from.

A point has noise of the covariance that the design predicts for it (Eq 6) at an image sigma that
full captures measured, the same for all points of one matching patch, because patches overlap.
Where fewer than two cameras see, there is nothing. Overexposed, the brightest part is lost, in
the dark the darkest; how much, full captures measured too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import Delaunay
from scipy.spatial.transform import Rotation

from evaluation.recognition.population import expressive, front_of
from evaluation.trial.seen import seen_by
from geometry.arrays import Bools, Floats, Ints
from geometry.camera import RigCamera
from geometry.head import HeadShape, random_head_shape
from geometry.raycast import Occluder
from geometry.sampling import spread
from geometry.scan import vertex_normals
from rig.simulation.settings import SceneSettings

TIP_MM = np.array([0.2, -121.1, -39.1])
"""The nose of the bundled head, for which the rigs are designed."""

POINTS = 12_000
PATCH_PX = 9
_REACH_MM = 110.0
_TURN_DEG, _SHIFT_MM = 3.0, 4.0
_FRONT = 0.05
_TIP_REACH_MM, _TIP_SIDE_MM = 12.0, 8.0
"""The tip of one person's nose is another vertex than that of another's."""


@dataclass(frozen=True)
class Light:
    """What an exposure does: ``sigma_px`` of a matched point, ``lost_share`` of the seen face."""

    name: str
    sigma_px: float
    lost_share: float
    brightest: bool


@dataclass(frozen=True, eq=False)
class Head:
    """A head before the cameras: ``vertices_mm`` (V, 3), ``faces`` (F, 3), its nose tip (3,)."""

    vertices_mm: Floats
    faces: Ints
    tip_mm: Floats

    def placed(self, rng: np.random.Generator) -> Head:
        """As somebody sits there: a little turned and off, the nose about where it belongs."""
        turn = Rotation.from_rotvec(np.radians(_TURN_DEG * rng.normal(size=3))).as_matrix()
        tip = TIP_MM + _SHIFT_MM * rng.normal(size=3)
        return Head((self.vertices_mm - self.tip_mm) @ turn.T + tip, self.faces, tip)

    def samples(self, count: int = POINTS) -> tuple[Floats, Floats]:
        """Points (n, 3) of the front about the nose, and their normals."""
        near = np.linalg.norm(self.vertices_mm - self.tip_mm, axis=1) <= _REACH_MM
        faces = self.faces[near[self.faces].any(axis=1)]
        found = spread(self.vertices_mm, faces, self.vertices_mm, count)
        front = found.normals[:, 1] < -_FRONT
        return found.points_mm[front], found.normals[front]


class IctPersons:
    """Persons of the ICT face model: a compact file, see its own README."""

    def __init__(self, path: str) -> None:
        with np.load(path, allow_pickle=False) as data:
            self._neutral = data["neutral"].astype(np.float64)
            self._identity = data["identity"].astype(np.float64)
            self._expression = data["expression"].astype(np.float64)
            self._faces = data["triangles"].astype(np.int64)
            self._names = [str(n) for n in data["expression_names"]]
        middle = np.where(np.abs(self._neutral[:, 0]) < 1.5, self._neutral[:, 2], -np.inf)
        self._tip = int(np.argmax(middle))

    def head(self, person: int, capture: int) -> Head:
        """The person at rest (capture 0) or with a random mixture of expressions."""
        own = np.random.default_rng([1, person]).normal(size=len(self._identity))
        shape = self._neutral + np.tensordot(own, self._identity, 1)
        if capture:
            rng = np.random.default_rng([2, person, capture])
            strength = np.clip(0.35 * rng.normal(size=len(self._expression)), 0.0, 1.0)
            shape = shape + np.tensordot(strength, self._expression, 1)
        # Centimetres with Y up and Z front there; X is the subject's left in both.
        vertices = 10.0 * np.stack([shape[:, 0], -shape[:, 2], shape[:, 1]], axis=1)
        near = np.linalg.norm(vertices - vertices[self._tip], axis=1) < _TIP_REACH_MM
        near &= np.abs(vertices[:, 0]) < _TIP_SIDE_MM
        tip = np.flatnonzero(near)[np.argmin(vertices[near, 1])]
        return Head(vertices, self._faces, vertices[tip])


class GeneratedPersons:
    """Persons of the bundled generator, their fronts as meshes."""

    def head(self, person: int, capture: int) -> Head:
        """The person at rest (capture 0) or with a random expression."""
        shape: HeadShape = random_head_shape(person)
        if capture:
            shape = expressive(shape, np.random.default_rng([person, capture]))
        points, tip = front_of(shape)
        faces = Delaunay(points[:, [0, 2]]).simplices.astype(np.int64)
        normals = vertex_normals(points, faces)
        if normals[:, 1].mean() > 0.0:
            faces = faces[:, ::-1]
        return Head(points, faces, tip)


@dataclass(frozen=True, eq=False)
class Sight:
    """What a rig sees of a head: points and normals (n, 3), views (n,), covariance (n, 3, 3).

    The covariance is that of an image sigma of one pixel; ``patch_mm`` the width of a patch.
    """

    points_mm: Floats
    normals: Floats
    views: Ints
    covariance_mm2: Floats
    patch_mm: float


def sight_of(head: Head, cameras: Sequence[RigCamera]) -> Sight:
    """Cast all rays, and intersect them: Eq 6 summed over the cameras that see a point."""
    points, normals = head.samples()
    occluder = Occluder(head.vertices_mm, head.faces)
    views = np.zeros(len(points), dtype=np.int64)
    information = np.zeros((len(points), 3, 3))
    widths = []
    for camera in cameras:
        seen = seen_by(points, normals, camera, occluder)
        views += seen
        depth = camera.pose.to_camera(points)[:, 2]
        focal_px = camera.camera.focal_length_mm / camera.camera.pixel_pitch_mm
        across, up, axis = camera.pose.rotation_rig_to_camera
        local = camera.pose.to_camera(points)[seen]
        # How a pixel moves with its point: rows of the projection's derivative.
        x = (across - (local[:, :1] / local[:, 2:]) * axis) * (focal_px / local[:, 2:])
        y = (up - (local[:, 1:2] / local[:, 2:]) * axis) * (focal_px / local[:, 2:])
        information[seen] += x[:, :, None] * x[:, None, :] + y[:, :, None] * y[:, None, :]
        widths.append(float(np.median(depth)) / focal_px)
    good = views >= 2
    covariance = np.zeros_like(information)
    covariance[good] = np.linalg.inv(information[good])
    return Sight(points, normals, views, covariance, PATCH_PX * float(np.median(widths)))


def measured(sight: Sight, light: Light, rng: np.random.Generator) -> Floats:
    """Points (m, 3) as they would be measured in a light."""
    kept = (sight.views >= 2) & ~lost(sight, light)
    points = sight.points_mm[kept]
    patch = np.floor(points / sight.patch_mm).astype(np.int64)
    number = np.ravel(np.unique(patch, axis=0, return_inverse=True)[1])
    white = rng.normal(size=(number.max() + 1, 3))[number]
    factor = np.linalg.cholesky(sight.covariance_mm2[kept])
    return np.asarray(points + light.sigma_px * np.einsum("nij,nj->ni", factor, white))


def lost(sight: Sight, light: Light) -> Bools:
    """Points (n,) that a light takes away: the brightest or the darkest of what is seen."""
    shade = shading(sight.normals)
    if light.lost_share <= 0.0:
        return np.zeros(len(shade), dtype=np.bool_)
    at = 1.0 - light.lost_share if light.brightest else light.lost_share
    limit = np.quantile(shade[sight.views >= 2], at)
    return np.asarray(shade > limit if light.brightest else shade < limit)


def shading(normals: Floats) -> Floats:
    """How bright skin of these normals (n, 3) is in the simulated studio, without shadows, (n,)."""
    scene = SceneSettings()
    total = np.full(len(normals), scene.ambient)
    for lamp in scene.lights:
        way = np.array(lamp.position_rig_mm)
        total += lamp.power * np.maximum(normals @ (way / np.linalg.norm(way)), 0.0)
    return np.asarray(total)


def smaller(camera: RigCamera, width_px: int) -> RigCamera:
    """The same camera with fewer, larger pixels: as small pictures show it."""
    kind = camera.camera
    scale = kind.image_size_px[0] / width_px
    size = (width_px, round(kind.image_size_px[1] / scale))
    changed = replace(
        kind,
        image_size_px=size,
        pixel_pitch_mm=kind.pixel_pitch_mm * scale,
        principal_point_px=np.full(2, np.nan),
    )
    return replace(camera, camera=changed)
