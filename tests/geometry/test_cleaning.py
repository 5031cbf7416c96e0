"""Cleaning: each flaw is removed, counted, and nothing else is touched."""

from __future__ import annotations

import numpy as np
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.cleaning import CleanMesh, clean_mesh
from geometry.loading import RawScan


def ball(
    radius: float = 100.0,
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0),
    subdivisions: int = 4,
) -> RawScan:
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return RawScan(
        np.asarray(mesh.vertices) + np.array(centre), np.asarray(mesh.faces, dtype=np.int64)
    )


def both(first: RawScan, second: RawScan) -> RawScan:
    return RawScan(
        np.concatenate([first.vertices, second.vertices]),
        np.concatenate([first.faces, second.faces + len(first.vertices)]),
    )


def texts(mesh: CleanMesh) -> str:
    return " / ".join(note.text for note in mesh.notes)


def volume(mesh: CleanMesh) -> float:
    return float(trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).volume)


def test_a_sound_mesh_is_left_alone() -> None:
    raw = ball()
    clean = clean_mesh(raw)
    assert clean.notes == ()
    assert len(clean.vertices) == len(raw.vertices)
    assert len(clean.faces) == len(raw.faces)


def test_split_vertices_are_welded() -> None:
    raw = ball()
    split = RawScan(
        raw.vertices[raw.faces].reshape(-1, 3), np.arange(3 * len(raw.faces)).reshape(-1, 3)
    )
    clean = clean_mesh(split)
    assert len(clean.vertices) == len(raw.vertices)
    assert f"{3 * len(raw.faces) - len(raw.vertices):,} vertices" in texts(clean)


def test_degenerate_and_duplicate_faces_are_dropped() -> None:
    raw = ball()
    extra = np.array([[0, 0, 1], raw.faces[3], raw.faces[7][::-1]])
    clean = clean_mesh(RawScan(raw.vertices, np.concatenate([raw.faces, extra])))
    assert len(clean.faces) == len(raw.faces)
    assert "1 faces without area" in texts(clean)
    assert "2 duplicate faces" in texts(clean)


def test_scatter_goes_and_eyes_stay() -> None:
    head = ball()
    scatter = ball(radius=3.0, centre=(300.0, 0.0, 0.0), subdivisions=0)
    eye = ball(radius=10.0, centre=(30.0, -60.0, 0.0), subdivisions=1)
    clean = clean_mesh(both(both(head, scatter), eye))
    assert len(clean.faces) == len(head.faces) + len(eye.faces)
    assert "1 floating pieces dropped (20 faces)" in texts(clean)
    kept = clean_mesh(both(head, scatter), drop_pieces=False)
    assert len(kept.faces) == len(head.faces) + len(scatter.faces)


def test_an_inside_out_mesh_is_turned() -> None:
    raw = ball()
    clean = clean_mesh(RawScan(raw.vertices, raw.faces[:, ::-1]))
    assert volume(clean) > 0.0
    assert f"{len(raw.faces):,} faces turned" in texts(clean)


@settings(max_examples=15, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**31))
def test_random_winding_is_made_consistent(seed: int) -> None:
    raw = ball(subdivisions=2)
    flip = np.random.default_rng(seed).random(len(raw.faces)) < 0.3
    clean = clean_mesh(
        RawScan(raw.vertices, np.where(flip[:, None], raw.faces[:, ::-1], raw.faces))
    )
    mesh = trimesh.Trimesh(clean.vertices, clean.faces, process=False)
    assert mesh.is_winding_consistent
    assert mesh.volume > 0.0
    assert f"{np.count_nonzero(flip):,} faces turned" in texts(clean) or not flip.any()


def test_an_open_surface_faces_outward_and_says_that_it_is_open() -> None:
    raw = ball()
    front = raw.faces[raw.vertices[raw.faces][:, :, 1].mean(axis=1) < -20.0][:, ::-1]
    clean = clean_mesh(RawScan(raw.vertices, front))
    corners = clean.vertices[clean.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ij,ij->i", normal, corners.mean(axis=1)) > 0.0).all()
    assert "open" in texts(clean)
