"""What the rays of one camera meet: the head, flat things, the backdrop.

Rays are given as x/z and y/z in the camera frame, so the distance along a ray in units of its
own length is the depth. Everything that does not change from picture to picture is in
:class:`HeadModel`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Floats
from geometry.camera import RigCamera
from geometry.raycast import Occluder
from rig.simulation.flats import FlatView, bounds_px
from rig.simulation.grain import grain
from rig.simulation.heads import head_mesh
from rig.simulation.lighting import openness, vertex_light
from rig.simulation.mesh import TexturedMesh, subdivided
from rig.simulation.motion import HeadPlacement
from rig.simulation.sampling import LINEAR_OF_SRGB, sampled
from rig.simulation.settings import BackdropSettings, HeadSettings, LightSettings, SceneSettings

Singles = NDArray[np.float32]

BACKDROP, HEAD, FIRST_FLAT = 0, 1, 2
"""Kinds of things a ray can meet; flat things count on from the last."""

FAR_MM = np.float32(1e6)

_ENOUGH_VERTICES = 15_000


class HeadModel:
    """The head at rest, ready for ray casting: acceleration structure, shadows, texture."""

    def __init__(self, scene: SceneSettings) -> None:
        # Imported here: Embree takes memory that a scene without a head need not pay for.
        from embreex import rtcore_scene
        from embreex.mesh_construction import TriangleMesh

        # Grain and sheen are laid on later: heads that differ in them alone are one mesh.
        self.mesh = mesh = _lit_mesh(replace(scene.head, grain_contrast=0, sheen=0), scene.lights)
        self.settings = scene.head
        self._scene = scene
        self._normals = mesh.normals
        self._middle = mesh.vertices_mm.mean(axis=0)
        self._faces = mesh.faces.astype(np.int32)
        local = (mesh.vertices_mm - self._middle).astype(np.float32)
        self._embree = rtcore_scene.EmbreeScene(robust=True)
        TriangleMesh(scene=self._embree, vertices=local, indices=self._faces)

    def view(self, rig_camera: RigCamera, placement: HeadPlacement) -> HeadView:
        """The head at a placement as one camera sees it."""
        scene = self._scene
        light = vertex_light(
            self.mesh.vertices_mm,
            self._normals,
            self.mesh.values,
            scene.lights,
            scene.ambient,
            scene.head.sheen,
            placement,
            rig_camera.pose.position_rig_mm,
        )
        light[:, :3] *= self.mesh.tint
        eye = placement.to_rest(rig_camera.pose.position_rig_mm) - self._middle
        turn = rig_camera.pose.rotation_rig_to_camera @ placement.rotation
        points = placement.to_rig(self.mesh.vertices_mm)
        return HeadView(
            self,
            light,
            eye.astype(np.float32),
            turn.astype(np.float32),
            bounds_px(points, rig_camera),
            rig_camera.camera.focal_length_px,
        )

    def cast(
        self, eye: Singles, directions: Singles
    ) -> tuple[NDArray[np.intp], dict[str, NDArray[np.float32]]]:
        """Numbers of the rays (N, 3) from ``eye`` (3,) that hit, and Embree's words on them."""
        origins = np.broadcast_to(eye, directions.shape)
        hits = self._embree.run(origins, directions, output=True)
        which = np.flatnonzero(hits["primID"] >= 0)
        names = ("primID", "u", "v", "tfar", "Ng")
        return which, {name: np.asarray(hits[name])[which] for name in names}

    def interpolated(
        self, hits: dict[str, NDArray[np.float32]], light: Singles
    ) -> tuple[Singles, Singles]:
        """Linear colour of the skin's picture (N, 3) and light (N, 4) at hits."""
        face = hits["primID"]
        u, v = hits["u"][:, None], hits["v"][:, None]
        w = np.float32(1.0) - u - v
        a, b, c = self._faces[face].T
        here = w * light[a] + u * light[b] + v * light[c]
        corner = self.mesh.texture_px[face]
        place = w * corner[:, 0] + u * corner[:, 1] + v * corner[:, 2]
        colour = sampled(self.mesh.picture, place[:, 0], place[:, 1])
        return LINEAR_OF_SRGB[colour], here

    def grain(self, points_mm: Singles, footprint_mm: Singles) -> Singles:
        """Factors (N,) of the grain at points relative to the mesh's middle."""
        return grain(points_mm, footprint_mm, self.settings.grain_contrast, self.settings.seed)


@lru_cache(maxsize=2)
def _lit_mesh(head: HeadSettings, lights: tuple[LightSettings, ...]) -> TexturedMesh:
    """The mesh rounded as asked, with what each vertex sees of the lights as its values.

    Shadows are soft, so they are cast on a mesh of some ten thousand vertices and halved along
    the edges from there: a full mesh would take ten times as long.
    """
    base = head_mesh(head)
    before = 1 if len(base.vertices_mm) < _ENOUGH_VERTICES else 0
    before = min(before, head.subdivisions)
    mesh = subdivided(base, before)
    occluder = Occluder(mesh.vertices_mm, mesh.faces)
    values = openness(occluder, mesh.normals, lights)
    return subdivided(replace(mesh, values=values), head.subdivisions - before)


@dataclass(frozen=True, eq=False)
class HeadView:
    """The head as one camera sees it, in its own frame at rest, from its own middle.

    ``light`` (V, 4), see :func:`~rig.simulation.lighting.vertex_light`; ``eye`` (3,) the
    projection centre; ``turn`` (3, 3) maps directions to the camera frame.
    """

    model: HeadModel
    light: Singles
    eye: Singles
    turn: Singles
    bounds_px: tuple[float, float, float, float]
    focal_length_px: float

    def trace(self, rays: Singles) -> tuple[NDArray[np.intp], Singles, Singles]:
        """Which of the rays (N, 2) hit, and depth (K,) and radiance (K, 3) of the hits."""
        directions = rays @ self.turn[:2] + self.turn[2]
        which, hits = self.model.cast(self.eye, directions)
        if len(which) == 0:
            return which, np.zeros(0, np.float32), np.zeros((0, 3), np.float32)
        depth, way = hits["tfar"], directions[which]
        skin, light = self.model.interpolated(hits, self.light)
        skin *= self.model.grain(
            self.eye + depth[:, None] * way, self._footprint(depth, way, hits["Ng"])
        )[:, None]
        return which, depth, skin * light[:, :3] + light[:, 3:]

    def _footprint(self, depth: Singles, way: Singles, normal: Singles) -> Singles:
        """Width of a pixel on the surface, (K,): wider where the surface turns away."""
        along = np.abs(np.einsum("ij,ij->i", way, normal))
        norms = np.einsum("ij,ij->i", way, way) * np.einsum("ij,ij->i", normal, normal)
        cosine = along / np.sqrt(np.maximum(norms, np.float32(1e-30)))
        width = depth * np.float32(1.0 / self.focal_length_px)
        return np.asarray(width / np.maximum(cosine, np.float32(0.1)), dtype=np.float32)


@dataclass(frozen=True, eq=False)
class BackdropView:
    """The wall behind the head as one camera sees it."""

    settings: BackdropSettings
    position_rig_mm: Floats
    rotation_rig_to_camera: Floats

    def radiance(self, rays: Singles) -> Singles:
        """Radiance (N, 3) of the wall in the direction of rays (N, 2)."""
        turn = self.rotation_rig_to_camera.astype(np.float32)
        x, y, z = (rays[:, 0] * turn[0, k] + rays[:, 1] * turn[1, k] + turn[2, k] for k in range(3))
        away = np.float32(self.settings.distance_mm - self.position_rig_mm[1])
        # A ray that leaves forwards never meets the wall: it sees the edge of the glow.
        reach = away / np.where(y > 1e-3, y, np.float32(1e-3))
        px, pz = (np.float32(self.position_rig_mm[k]) for k in (0, 2))
        square = (px + reach * x) ** 2 + (pz + reach * z) ** 2
        glow = (
            np.float32(1.0)
            / (np.float32(1.0) + square / np.float32(self.settings.radius_mm**2)) ** 2
        )
        edge = np.array(self.settings.edge, dtype=np.float32)
        rise = np.array(self.settings.centre, dtype=np.float32) - edge
        return np.asarray(edge + glow[:, None] * rise, dtype=np.float32)


@dataclass(frozen=True, eq=False)
class SceneView:
    """Everything that stands before one camera in one instant."""

    backdrop: BackdropView
    head: HeadView | None
    flats: tuple[FlatView, ...]

    def trace(
        self, x_px: Singles, y_px: Singles, rays: Singles
    ) -> tuple[Singles, Singles, NDArray[np.uint8]]:
        """Radiance (N, 3), depth (N,) in mm and kind (N,) of what rays (N, 2) meet.

        ``x_px`` and ``y_px`` (N,) say where in the image the rays belong, so that those that can
        meet nothing are left out.
        """
        radiance = np.empty((len(rays), 3), dtype=np.float32)
        depth = np.full(len(rays), FAR_MM, dtype=np.float32)
        kind = np.full(len(rays), BACKDROP, dtype=np.uint8)
        if self.head is not None:
            near = _within(self.head.bounds_px, x_px, y_px)
            which, far, light = self.head.trace(rays[near])
            hit = near[which]
            radiance[hit], depth[hit], kind[hit] = light, far, HEAD
        for number, flat in enumerate(self.flats):
            near = _within(flat.bounds_px, x_px, y_px)
            if len(near) == 0:
                continue
            inside, far, across, along = flat.hits(rays[near])
            front = inside & (far < depth[near])
            hit = near[front]
            radiance[hit] = flat.radiance(across[front], along[front])
            depth[hit] = far[front]
            kind[hit] = min(FIRST_FLAT + number, 255)
        beyond = np.flatnonzero(kind == BACKDROP)
        radiance[beyond] = self.backdrop.radiance(rays[beyond])
        return radiance, depth, kind


def _within(
    bounds_px: tuple[float, float, float, float], x_px: Singles, y_px: Singles
) -> NDArray[np.intp]:
    left, top, right, bottom = bounds_px
    return np.flatnonzero((x_px >= left) & (x_px <= right) & (y_px >= top) & (y_px <= bottom))
