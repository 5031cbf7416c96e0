"""A ball in many colours and three pictures of it: what is on its surface afterwards."""

from __future__ import annotations

import io
from dataclasses import replace

import matching_scenes as scenes
import numpy as np
import pytest
import trimesh
from PIL import Image

from common.errors import InputError
from evaluation.reconstruction.meshfile import mesh_files
from evaluation.reconstruction.surface import SurfaceMesh
from evaluation.reconstruction.texture import Texture, sheet_corners, textured
from evaluation.reconstruction.views import View

RADIUS_MM = 30.0
SIZE_PX, FOCAL_PX = 200, 900.0
PLACES = ((-220.0, -300.0, 0.0), (0.0, -400.0, 60.0), (220.0, -300.0, 0.0))
BRIGHTNESS = (1.0, 0.7, 1.2)
"""How the three cameras' exposures differ."""


def colour_of(directions: np.ndarray) -> np.ndarray:
    """Smooth to a pixel, never dark and, 1.2 times as bright, never saturated."""
    return np.asarray(120.0 + 50.0 * np.sin(6.0 * directions + [0.0, 1.0, 2.0]))


def ball_view(name: str, place: tuple[float, float, float], brightness: float) -> View:
    pose = scenes.looking_at_origin(place)
    middle = (SIZE_PX - 1) / 2.0
    matrix = np.array([[FOCAL_PX, 0.0, middle], [0.0, FOCAL_PX, middle], [0.0, 0.0, 1.0]])
    v, u = np.mgrid[0:SIZE_PX, 0:SIZE_PX].astype(float)
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(matrix).T
    rays = rays @ pose.rotation_rig_to_camera
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    eye = pose.position_rig_mm
    along = -rays @ eye
    under = along**2 - eye @ eye + RADIUS_MM**2
    hit = eye + (along - np.sqrt(np.maximum(under, 0.0)))[..., None] * rays
    shown = np.where((under > 0.0)[..., None], brightness * colour_of(hit / RADIUS_MM), 0.0)
    colour = np.rint(shown).astype(np.uint8)
    grey = (colour.mean(axis=2) / 255.0).astype(np.float32)
    return View(name, grey, colour, matrix, pose, np.zeros(grey.shape, dtype=bool))


@pytest.fixture(scope="module")
def views() -> list[View]:
    made = zip(PLACES, BRIGHTNESS, strict=True)
    return [ball_view(f"cam{k}", place, bright) for k, (place, bright) in enumerate(made)]


@pytest.fixture(scope="module")
def mesh() -> SurfaceMesh:
    """The half of the ball that faces the cameras, and a little more."""
    ball = trimesh.creation.icosphere(subdivisions=5)
    out = np.asarray(ball.vertices)
    faces = np.asarray(ball.faces)
    faces = faces[(out[faces][..., 1] < 0.2).all(axis=1)]
    used, packed = np.unique(faces, return_inverse=True)
    out = out[used]
    grey = np.full((len(out), 3), 77, dtype=np.uint8)
    return SurfaceMesh(RADIUS_MM * out, packed.reshape(-1, 3), out, grey, np.full(len(out), 0.01))


@pytest.fixture(scope="module")
def texture(mesh: SurfaceMesh, views: list[View]) -> Texture:
    return textured(mesh, views)


def shown_at(texture: Texture) -> np.ndarray:
    """The colour in the middle of each triangle (F, 3), as a viewer reads it."""
    height, width = texture.image.shape[:2]
    u, v = texture.uv[texture.faces].mean(axis=1).T
    column = np.clip(u * width - 0.5, 0, width - 1)
    row = np.clip((1.0 - v) * height - 0.5, 0, height - 1)
    return texture.image[np.rint(row).astype(int), np.rint(column).astype(int)].astype(float)


def seen(texture: Texture) -> np.ndarray:
    """Triangles that got a picture, not the plain colour of their vertices."""
    return np.asarray((shown_at(texture) != 77.0).any(axis=1))


def test_each_triangle_shows_its_own_place(mesh: SurfaceMesh, texture: Texture) -> None:
    shown, there = shown_at(texture), seen(texture)
    middle = mesh.vertices_mm[mesh.faces].mean(axis=1)
    true = colour_of(middle / np.linalg.norm(middle, axis=1, keepdims=True))
    ratio = (shown / true)[there]
    # Gains have the geometric mean of the cameras' brightness.
    common = np.prod(BRIGHTNESS) ** (1.0 / 3.0)
    # 6 per radian on a ball of 64 px make 5 steps a pixel; half a pixel of the nearest one, and
    # half as much for a surface seen at 60 degrees.
    assert np.median(np.abs(ratio / common - 1.0)) < 0.02
    assert np.quantile(np.abs(ratio / common - 1.0), 0.99) < 0.1


def test_exposures_that_differ_make_no_seams(texture: Texture) -> None:
    height, width = texture.image.shape[:2]
    place = np.stack([texture.uv[:, 0] * width - 0.5, (1.0 - texture.uv[:, 1]) * height - 0.5], 1)
    column, row = np.rint(place).astype(int).T
    colour = texture.image[row, column].astype(float)
    first, again = {}, []
    for k, vertex in enumerate(texture.vertex):
        if vertex in first:
            again.append((first[vertex], k))
        first[vertex] = k
    pairs = np.array(again)
    assert len(pairs) > 50
    apart = np.abs(colour[pairs[:, 0]] - colour[pairs[:, 1]])
    # Without gains 0.7 and 1.2 of 120 stand beside one another: 60 steps apart.
    assert np.median(apart) < 4.0


def test_what_no_camera_sees_keeps_the_colour_of_its_points(
    mesh: SurfaceMesh, texture: Texture, views: list[View]
) -> None:
    lone = textured(mesh, views[:1])
    away = -np.array(PLACES[0]) / np.linalg.norm(PLACES[0])
    middle = mesh.vertices_mm[mesh.faces].mean(axis=1) @ away
    behind = middle > 5.0
    assert behind.sum() > 1000
    assert np.array_equal(shown_at(lone)[behind], np.full((behind.sum(), 3), 77.0))
    assert lone.unseen >= behind.sum()
    assert texture.unseen < lone.unseen


def test_saturated_pixels_give_no_colour(mesh: SurfaceMesh, views: list[View]) -> None:
    white = [replace(v, clipped=np.ones_like(v.clipped)) for v in views]
    with pytest.raises(InputError, match="overexposed"):
        textured(mesh, white)


def test_an_atlas_is_no_larger_than_cards_take(mesh: SurfaceMesh, views: list[View]) -> None:
    small = textured(mesh, views, largest_px=100)
    assert max(small.image.shape[:2]) == 100
    middle = mesh.vertices_mm[mesh.faces].mean(axis=1)
    true = colour_of(middle / np.linalg.norm(middle, axis=1, keepdims=True))
    there = seen(small)
    assert np.median(np.abs(shown_at(small) / true - 0.944)[there]) < 0.1


def test_pieces_lie_beside_one_another_on_a_sheet_that_is_no_strip() -> None:
    sizes = np.array([(60, 67), (58, 67), (30, 67), (61, 60), (60, 67), (12, 9), (59, 66)])
    low = sheet_corners(sizes)
    high = low + sizes
    assert (low >= 0).all()
    for k in range(len(sizes)):
        overlap = np.minimum(high[k], high) - np.maximum(low[k], low)
        assert (overlap > 0).all(axis=1).sum() == 1
    # Three by two of the larger ones: 3 x 61 wide. As a strip they would be 340 wide.
    assert high.max() < 1.1 * 3 * 61


def test_files_show_the_picture_where_the_mesh_has_it(mesh: SurfaceMesh, texture: Texture) -> None:
    (glb,) = mesh_files(mesh, "glb", texture).values()
    (back,) = trimesh.load_scene(io.BytesIO(glb), file_type="glb").geometry.values()
    assert np.array_equal(back.visual.material.baseColorTexture.convert("RGB"), texture.image)
    assert back.visual.uv == pytest.approx(texture.uv, abs=1e-6)
    assert np.array_equal(back.faces, texture.faces)
    assert back.vertex_attributes["_SIGMA_MM"].ravel() == pytest.approx(0.01)
    files = mesh_files(mesh, "obj", texture)
    assert sorted(files) == ["mesh.mtl", "mesh.obj", "mesh.png"]
    assert b"map_Kd mesh.png" in files["mesh.mtl"]
    assert b"mtllib mesh.mtl" in files["mesh.obj"]
    assert np.array_equal(Image.open(io.BytesIO(files["mesh.png"])).convert("RGB"), texture.image)
    lines = files["mesh.obj"].decode().splitlines()
    told = np.array([line.split()[1:] for line in lines if line.startswith("vt ")], dtype=float)
    assert told == pytest.approx(texture.uv, abs=1e-6)
    # PLY has no picture.
    assert sorted(mesh_files(mesh, "ply", texture)) == ["mesh.ply"]
