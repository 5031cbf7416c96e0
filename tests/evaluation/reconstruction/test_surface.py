"""A mesh through points of a ball with a hole: whole where points are, open elsewhere."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
import trimesh

from common.errors import InputError
from evaluation.comparison.referencefile import read_reference
from evaluation.reconstruction.cloud import Cloud
from evaluation.reconstruction.cloudfile import read_points
from evaluation.reconstruction.meshfile import mesh_glb, mesh_obj, mesh_ply
from evaluation.reconstruction.surface import SurfaceMesh, meshed, spacing_mm

pytest.importorskip("igl")
RADIUS_MM, NOISE_MM, COUNT = 30.0, 0.02, 12_000
HOLE = 0.8
"""The ball lacks what lies above this share of its radius."""


def cloud_of(directions: np.ndarray, radius_mm: np.ndarray) -> Cloud:
    count = len(directions)
    # A colour and a sigma that change over the ball: what the mesh shows can be told.
    shade = np.rint(127.5 * (1.0 + directions)).astype(np.uint8)
    sigma = NOISE_MM * (1.5 + directions[:, 0])
    points = radius_mm[:, None] * directions
    return Cloud(points, directions, shade, sigma, np.full(count, 3, np.uint8))


@pytest.fixture(scope="module")
def cloud() -> Cloud:
    rng = np.random.default_rng(4)
    directions = rng.normal(size=(COUNT, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions = directions[directions[:, 2] < HOLE]
    return cloud_of(directions, RADIUS_MM + rng.normal(0.0, NOISE_MM, len(directions)))


@pytest.fixture(scope="module")
def mesh(cloud: Cloud) -> SurfaceMesh:
    return meshed(cloud)


def test_the_surface_is_where_the_points_are(cloud: Cloud, mesh: SurfaceMesh) -> None:
    cap_mm2 = 4.0 * np.pi * RADIUS_MM**2 * (1.0 + HOLE) / 2.0
    # Spread at random, the 8th neighbour is known to 1/sqrt(8) for one point and to 1 % for all;
    # Gauss' gap between median and mean of 8 events is 4 %.
    assert spacing_mm(cloud) == pytest.approx(np.sqrt(cap_mm2 / len(cloud)), rel=0.05)
    cell = 1.5 * spacing_mm(cloud)
    off = np.linalg.norm(mesh.vertices_mm, axis=1) - RADIUS_MM
    # Tangents of points within a cell's reach stand outside by up to cell^2 / (2 R).
    assert 0.0 < off.mean() < cell**2 / (2.0 * RADIUS_MM)
    # The mean over several points is quieter than each.
    assert off.std() < NOISE_MM
    # The rim may end one cell before the last point or one behind it.
    rim_mm = 2.0 * np.pi * RADIUS_MM * np.sqrt(1.0 - HOLE**2)
    assert mesh.area_mm2() == pytest.approx(cap_mm2, abs=rim_mm * cell)


def test_holes_stay_holes_and_all_else_is_whole(mesh: SurfaceMesh) -> None:
    solid = trimesh.Trimesh(mesh.vertices_mm, mesh.faces, process=False)
    assert solid.body_count == 1
    assert solid.is_winding_consistent
    assert np.einsum("ni,ni->n", solid.face_normals, solid.triangles_center).min() > 0.0
    rim = mesh.vertices_mm[np.unique(mesh.rims())]
    assert len(rim) > 20
    # All open edges are at the one hole: within a cell's reach of where the points end.
    assert np.abs(rim[:, 2] / RADIUS_MM - HOLE).max() < 0.1


def test_colour_and_sigma_are_those_of_the_points_near(mesh: SurfaceMesh) -> None:
    directions = mesh.vertices_mm / np.linalg.norm(mesh.vertices_mm, axis=1, keepdims=True)
    # The six nearest points are within 3 mm: a tenth of the radius, of 127 steps of colour.
    assert np.abs(mesh.colours - 127.5 * (1.0 + directions)).max() < 13.0
    expected = NOISE_MM * (1.5 + directions[:, 0])
    assert np.abs(mesh.sigma_mm - expected).max() < 0.1 * NOISE_MM
    assert np.einsum("ni,ni->n", mesh.normals, directions).min() > 0.99


def test_files_hold_what_the_mesh_holds(mesh: SurfaceMesh, tmp_path: Path) -> None:
    path = tmp_path / "mesh.ply"
    path.write_bytes(mesh_ply(mesh))
    assert np.array_equal(read_points(path), mesh.vertices_mm)
    assert np.array_equal(read_reference(path).faces, mesh.faces)
    obj = trimesh.load_mesh(io.BytesIO(mesh_obj(mesh)["mesh.obj"]), file_type="obj", process=False)
    # Six digits behind the point.
    assert obj.vertices == pytest.approx(mesh.vertices_mm, abs=0.6e-6)
    assert np.array_equal(obj.faces, mesh.faces)
    assert np.array_equal(obj.visual.vertex_colors[:, :3], mesh.colours)
    told = [
        line.split()[1:]
        for line in mesh_obj(mesh)["mesh.obj"].decode().splitlines()
        if line[:2] == "vn"
    ]
    assert np.array(told, dtype=float) == pytest.approx(mesh.normals, abs=0.6e-6)
    glb = trimesh.load_scene(io.BytesIO(mesh_glb(mesh)), file_type="glb")
    (back,) = glb.geometry.values()
    # The hole looks up along Z of the rig, which is Y in glTF; metres in single precision.
    upward = mesh.vertices_mm @ np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]]).T / 1000.0
    assert back.vertices == pytest.approx(upward, abs=1e-8)
    assert np.array_equal(back.visual.vertex_colors[:, :3], mesh.colours)
    assert back.vertex_attributes["_SIGMA_MM"].ravel() == pytest.approx(mesh.sigma_mm, rel=1e-6)


def test_two_sheets_a_few_cells_apart_stay_two(cloud: Cloud) -> None:
    outer = cloud.points_mm * (1.0 + 5.0 * spacing_mm(cloud) / RADIUS_MM)
    both = Cloud(
        np.concatenate([cloud.points_mm, outer]),
        np.tile(cloud.normals, (2, 1)),
        np.tile(cloud.colours, (2, 1)),
        np.tile(cloud.sigma_mm, 2),
        np.tile(cloud.views, 2),
    )
    found = meshed(both, cell_mm=1.2 * spacing_mm(cloud))
    assert trimesh.Trimesh(found.vertices_mm, found.faces, process=False).body_count == 2


def test_dust_is_no_surface(cloud: Cloud) -> None:
    few = slice(0, 8)
    rng = np.random.default_rng(1)
    with pytest.raises(InputError, match="too few or too scattered"):
        meshed(Cloud(*(v[few] for v in vars(cloud).values())))
    dust = rng.uniform(-50.0, 50.0, (200, 3))
    lone = Cloud(dust, *(v[:200] for v in list(vars(cloud).values())[1:]))
    with pytest.raises(InputError, match="too few or too scattered"):
        meshed(lone, cell_mm=0.5)
