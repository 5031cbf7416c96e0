"""Loop subdivision: known shapes, seams, borders."""

from __future__ import annotations

import numpy as np
import pytest

from common.errors import InputError
from rig.simulation.mesh import TexturedMesh, subdivided

PICTURE = np.zeros((4, 4, 3), dtype=np.uint8)


def mesh_of(vertices: np.ndarray, faces: np.ndarray) -> TexturedMesh:
    rng = np.random.default_rng(0)
    texture = rng.uniform(0.0, 4.0, (len(faces), 3, 2)).astype(np.float32)
    return TexturedMesh(vertices, faces, texture, PICTURE, np.ones(vertices.shape, np.float32))


def octahedron() -> TexturedMesh:
    vertices = np.concatenate([np.eye(3), -np.eye(3)])
    faces = [(0, 1, 2), (1, 3, 2), (3, 4, 2), (4, 0, 2), (1, 0, 5), (3, 1, 5), (4, 3, 5), (0, 4, 5)]
    return mesh_of(vertices, np.array(faces))


def sheet(count: int = 5) -> TexturedMesh:
    """A flat square of ``count`` x ``count`` vertices."""
    x, y = np.meshgrid(np.arange(count, dtype=float), np.arange(count, dtype=float))
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(count * count)], axis=1)
    first = (np.arange(count - 1)[:, None] * count + np.arange(count - 1)).ravel()
    faces = [
        np.stack([first, first + 1, first + count + 1], axis=1),
        np.stack([first, first + count + 1, first + count], axis=1),
    ]
    return mesh_of(vertices, np.concatenate(faces))


def test_an_octahedron_rounds_as_loops_masks_say() -> None:
    round_once = subdivided(octahedron(), 1)
    assert (len(round_once.vertices_mm), len(round_once.faces)) == (18, 32)
    # Valence 4: beta = (5/8 - (3/8 + cos(90 deg)/4)^2) / 4 = 31/256; the four neighbours of a tip
    # cancel, so it moves to 1 - 4 beta. An edge's middle is 3/8 of both ends, 1/8 of both tips.
    assert np.abs(round_once.vertices_mm[:6]).max() == pytest.approx(1.0 - 4.0 * 31.0 / 256.0)
    middles = np.sort(np.abs(round_once.vertices_mm[6:]), axis=1)
    assert np.allclose(middles, [0.0, 0.375, 0.375])


def test_the_mesh_stays_closed_and_wound_outward() -> None:
    mesh = subdivided(octahedron(), 3)
    sides = np.sort(mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    _, uses = np.unique(sides, axis=0, return_counts=True)
    assert (uses == 2).all()
    assert ((mesh.normals * mesh.vertices_mm).sum(axis=1) > 0.0).all()


def test_texture_coordinates_keep_their_faces() -> None:
    mesh, fine = octahedron(), subdivided(octahedron(), 2)
    area = lambda uv: np.abs(np.cross(uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0])).sum()  # noqa: E731
    assert area(np.pad(fine.texture_px, ((0, 0), (0, 0), (0, 1)))) == pytest.approx(
        area(np.pad(mesh.texture_px, ((0, 0), (0, 0), (0, 1)))), rel=1e-5
    )


def test_a_border_keeps_to_itself() -> None:
    mesh = subdivided(sheet(), 2)
    assert np.abs(mesh.vertices_mm[:, 2]).max() == 0.0
    # The curve of the border pulls the four corners in; its straight parts stay.
    assert mesh.vertices_mm[:, 0].min() == pytest.approx(0.0, abs=1e-12)
    assert mesh.vertices_mm[:, 0].max() == pytest.approx(4.0)


def test_values_of_vertices_are_halved_along_edges() -> None:
    mesh = sheet()
    height = mesh.vertices_mm[:, :1].astype(np.float32)
    from dataclasses import replace

    fine = subdivided(replace(mesh, values=height), 1)
    assert np.allclose(np.unique(fine.values), np.arange(9) / 2.0)


def test_a_mesh_without_faces_is_refused() -> None:
    with pytest.raises(InputError, match="no faces"):
        mesh_of(np.zeros((3, 3)), np.zeros((0, 3), dtype=np.int64))
