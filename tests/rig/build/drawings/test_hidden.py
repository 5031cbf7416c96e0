"""Hidden lines against answers worked out by hand and against rays."""

from __future__ import annotations

import numpy as np
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.build.drawings.hidden import visible_lines
from rig.solids.convex import box_corners

AXES = np.eye(3)


def total(lines: np.ndarray) -> float:
    return float(np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1).sum())


def box(size: tuple[float, float, float], centre: tuple[float, float, float]) -> np.ndarray:
    return box_corners(np.array(size), np.array(centre))


def test_a_box_alone_shows_its_outline() -> None:
    (lines,) = visible_lines([box((10, 20, 30), (0, 0, 0))], AXES)
    assert np.isclose(total(lines), 2 * (10 + 20))


def test_a_nearer_box_hides_what_is_behind_it() -> None:
    behind, before = box((10, 10, 10), (0, 0, 0)), box((4, 30, 2), (0, 0, 20))
    far, near = visible_lines([behind, before], AXES)
    # Each of the two level edges loses the 4 mm behind the bar, less the 0.05 mm it is shrunk by.
    assert abs(total(far) - (40.0 - 2 * 4.0)) < 0.5
    assert np.isclose(total(near), 2 * (4 + 30))


def test_boxes_that_touch_keep_their_edges() -> None:
    lower, upper = box((10, 10, 10), (0, 0, 0)), box((6, 6, 10), (0, 0, 10))
    far, near = visible_lines([lower, upper], AXES)
    assert np.isclose(total(far), 40.0) and np.isclose(total(near), 24.0)


def test_a_round_lens_shows_only_its_ends_and_outline() -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False)
    ring = 5.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    lens = np.concatenate([np.column_stack([ring, np.full(32, z)]) for z in (0.0, 10.0)])
    side = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    (lines,) = visible_lines([lens], side)
    assert abs(total(lines) - (2 * 10.0 + 2 * 10.0)) < 0.5


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000))
def test_what_is_drawn_is_what_rays_see(seed: int) -> None:
    rng = np.random.default_rng(seed)
    clouds = [rng.uniform(-8, 8, (8, 3)) + rng.uniform(-10, 10, 3) for _ in range(3)]
    meshes = [trimesh.convex.convex_hull(cloud) for cloud in clouds]
    drawn = visible_lines(clouds, AXES)
    for index, lines in enumerate(drawn):
        for start, end in lines:
            middle = (start + end) / 2.0
            heights = [_highest(mesh, middle) for mesh in meshes]
            own = _highest(meshes[index], middle * (1 - 1e-9) + 1e-9 * meshes[index].centroid[:2])
            others = [h for k, h in enumerate(heights) if k != index and h is not None]
            # An edge's middle lies on its solid's surface; hiding solids are shrunk by 0.05 mm.
            if own is not None and others:
                assert own >= max(others) - 1.0 or _inside_edge(middle, meshes, index)


def _highest(mesh: trimesh.Trimesh, place: np.ndarray) -> float | None:
    """Height of a convex mesh's upper surface over a place, None beside it."""
    planes = np.column_stack(
        [mesh.face_normals, -(mesh.face_normals * mesh.triangles[:, 0]).sum(axis=1)]
    )
    up = planes[:, 2] > 1e-9
    down = planes[:, 2] < -1e-9
    tops = -(planes[up, :2] @ place + planes[up, 3]) / planes[up, 2]
    bottoms = -(planes[down, :2] @ place + planes[down, 3]) / planes[down, 2]
    return float(tops.min()) if tops.min() > bottoms.max() else None


def _inside_edge(place: np.ndarray, meshes: list[trimesh.Trimesh], index: int) -> bool:
    """Whether the hiding solid is seen edge-on there: the shrunk solid ends before it."""
    shrunk = [m for k, m in enumerate(meshes) if k != index]
    around = [place + 0.3 * np.array([np.cos(a), np.sin(a)]) for a in np.linspace(0, 6.28, 16)]
    return any(_highest(mesh, spot) is None for mesh in shrunk for spot in around)
