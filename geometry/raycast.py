"""Ray casting on the scan: lines of sight that are free, and what blocks the others."""

from __future__ import annotations

from functools import cached_property
from typing import cast

import numpy as np

from geometry.arrays import Bools, Floats, Ints, frozen, frozen_ints


class Occluder:
    """A triangle mesh against which lines of sight are tested (Embree, float32 inside).

    ``vertices_mm`` (V, 3) in the rig frame, ``faces`` (F, 3). An empty mesh hides nothing.
    Embree works in float32 and may hit the very triangle a ray starts on, so the mesh is
    centred before it is handed over and rays start ``lift_mm`` above the surface.
    Instances pickle: the acceleration structure is rebuilt on the other side.
    """

    def __init__(self, vertices_mm: Floats, faces: Ints, lift_mm: float = 0.05) -> None:
        self.vertices_mm = frozen(np.reshape(vertices_mm, (-1, 3)))
        self.faces = frozen_ints(np.reshape(faces, (-1, 3)))
        self.lift_mm = lift_mm
        self._origin = self.vertices_mm.mean(axis=0) if len(self.vertices_mm) else np.zeros(3)
        self._scene = self._build()

    @classmethod
    def none(cls) -> Occluder:
        """An occluder that hides nothing."""
        return cls(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))

    @cached_property
    def extent_mm(self) -> tuple[Floats, Floats]:
        """Least and largest coordinates of the vertices, (3,) each; infinite without any."""
        low = self.vertices_mm.min(axis=0, initial=np.inf)
        return frozen(low), frozen(self.vertices_mm.max(axis=0, initial=-np.inf))

    def _build(self) -> object | None:
        if len(self.faces) == 0:
            return None
        # Imported here: Embree takes memory that users of a bare point list need not pay for.
        from embreex import rtcore_scene
        from embreex.mesh_construction import TriangleMesh

        scene = rtcore_scene.EmbreeScene(robust=True)
        local = (self.vertices_mm - self._origin).astype(np.float32)
        TriangleMesh(scene=scene, vertices=local, indices=self.faces.astype(np.int32))
        return cast("object", scene)

    def __getstate__(self) -> dict[str, object]:
        return {"vertices_mm": self.vertices_mm, "faces": self.faces, "lift_mm": self.lift_mm}

    def __setstate__(self, state: dict[str, object]) -> None:
        self.__init__(state["vertices_mm"], state["faces"], state["lift_mm"])  # type: ignore[misc]

    def first_hits(self, origins_mm: Floats, directions: Floats) -> tuple[Ints, Floats]:
        """First triangle hit by each ray, (N,), -1 for none, and the distance to it, (N,), mm.

        ``directions`` (N, 3) must be unit vectors.
        """
        count = len(origins_mm)
        if self._scene is None or count == 0:
            return np.full(count, -1, dtype=np.int64), np.full(count, np.inf)
        local = (np.asarray(origins_mm) - self._origin).astype(np.float32)
        hits = self._scene.run(local, np.asarray(directions, dtype=np.float32), output=True)  # type: ignore[attr-defined]
        triangle = np.asarray(hits["primID"], dtype=np.int64)
        distance = np.where(triangle >= 0, np.asarray(hits["tfar"], dtype=np.float64), np.inf)
        return triangle, distance

    def hidden(self, points_mm: Floats, normals: Floats, eye_mm: Floats) -> Bools:
        """Whether something stands between each surface point (N, 3) and the eye (3,) or (N, 3)."""
        start = points_mm + self.lift_mm * normals
        way = np.broadcast_to(eye_mm, start.shape) - start
        length = np.linalg.norm(way, axis=1)
        direction = way / np.maximum(length, 1e-12)[:, None]
        triangle, distance = self.first_hits(start, direction)
        return np.asarray((triangle >= 0) & (distance < length))

    def face_normals(self, triangles: Ints) -> Floats:
        """Unit normals (N, 3) of the given triangles."""
        a, b, c = (self.vertices_mm[self.faces[triangles, k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        return np.asarray(
            normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        )
