"""Cleaning a mesh: what scanners and exporters leave behind, counted as it goes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.errors import InputError
from geometry.arrays import Bools, Floats, Ints
from geometry.loading import RawScan
from geometry.scan import ScanNote

_WELD_SHARE = 1e-7
_PIECE_SHARE = 0.02
_INNER_PIECE_SHARE = 0.002
_NAN_SHARE = 0.01
_MAX_COORDINATE = 1e15


@dataclass(frozen=True, eq=False)
class CleanMesh:
    """``vertices`` (V, 3) and ``faces`` (F, 3), wound outward, with notes of what was changed."""

    vertices: Floats
    faces: Ints
    notes: tuple[ScanNote, ...]


def clean_mesh(raw: RawScan, drop_pieces: bool = True) -> CleanMesh:
    """Weld, drop broken faces and (if asked) floating pieces, and wind all faces outward.

    Raises :class:`InputError` when nothing with an area remains.
    """
    notes: list[ScanNote] = []
    vertices, faces = _weld(raw.vertices, raw.faces, notes)
    faces = _drop_broken_faces(vertices, faces, notes)
    if len(faces) == 0:
        problem = "the faces of the scan have no area"
        raise InputError("scan-zero-area", problem, "export the scan again, check its scale")
    if drop_pieces:
        faces = _drop_floating_pieces(vertices, faces, notes)
    faces = _wind_outward(vertices, faces, notes)
    _report_edges(faces, len(vertices), notes)
    used, renumbered = np.unique(faces, return_inverse=True)
    return CleanMesh(vertices[used], renumbered.reshape(-1, 3), tuple(notes))


def drop_not_finite(raw: RawScan) -> tuple[RawScan, tuple[ScanNote, ...]]:
    """The scan without the few vertices that hold NaN or infinity and the faces that use them.

    Raises :class:`InputError` for an empty scan, when more than one vertex in a hundred is not
    finite, and for coordinates so large that their products overflow.
    """
    if len(raw.vertices) == 0:
        problem = "the scan has no faces and no points"
        raise InputError("scan-empty", problem, "export it again with its geometry")
    if len(raw.faces) and (raw.faces.min() < 0 or raw.faces.max() >= len(raw.vertices)):
        problem = "faces of the scan refer to vertices it lacks"
        raise InputError("scan-faces-index", problem, "export the scan again")
    good = np.asarray(np.isfinite(raw.vertices).all(axis=1))
    bad = int(np.count_nonzero(~good))
    if bad < len(good) and np.abs(raw.vertices[good]).max() > _MAX_COORDINATE:
        problem = "the scan has coordinates of astronomical size"
        raise InputError("scan-coordinates", problem, "repair the scan and export it again")
    if bad == 0:
        return raw, ()
    if bad > _NAN_SHARE * len(good):
        problem = f"{bad} of {len(good)} vertices of the scan are NaN or infinite"
        raise InputError("scan-not-finite", problem, "repair the scan and export it again")
    faces = raw.faces[good[raw.faces].all(axis=1)]
    number = np.cumsum(good) - 1
    normals = None if raw.normals is None else raw.normals[good]
    kept = RawScan(raw.vertices[good], number[faces].reshape(-1, 3), normals, raw.unit)
    return kept, (_changed(bad, "vertices that are NaN or infinite dropped"),)


def unique_rows(rows: Ints) -> tuple[Ints, Ints]:
    """Where each different row of (N, 3) stands first, and the different row that each is, (N,)."""
    from trimesh import grouping

    first, inverse = grouping.unique_rows(rows)  # type: ignore[no-untyped-call]
    return np.asarray(first, dtype=np.int64), np.asarray(inverse, dtype=np.int64)


def _changed(count: int, what: str) -> ScanNote:
    return ScanNote("changed", f"{count:,} {what}")


def _add(notes: list[ScanNote], count: int, what: str) -> None:
    if count:
        notes.append(_changed(count, what))


def _weld(vertices: Floats, faces: Ints, notes: list[ScanNote]) -> tuple[Floats, Ints]:
    size = float(np.ptp(vertices, axis=0).max())
    if size == 0.0:
        return vertices, faces
    # Coordinates are counted in ten-millionths of the size: finer than float32 files resolve.
    local = np.round((vertices - vertices.min(axis=0)) / (size * _WELD_SHARE)).astype(np.int64)
    first, inverse = unique_rows(local)
    _add(notes, len(vertices) - len(first), "vertices at the same place welded")
    return vertices[first], inverse[faces]


def _areas(vertices: Floats, faces: Ints) -> Floats:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0)


def _drop_broken_faces(vertices: Floats, faces: Ints, notes: list[ScanNote]) -> Ints:
    # Area below float64 rounding of the scan's size squared: no normal can be had from it.
    size = float(np.ptp(vertices, axis=0).max())
    sound = _areas(vertices, faces) > 1e-14 * size**2
    _add(notes, int(np.count_nonzero(~sound)), "faces without area dropped")
    faces = faces[sound]
    if len(faces) == 0:
        return faces
    first, _ = unique_rows(np.sort(faces, axis=1))
    _add(notes, len(faces) - len(first), "duplicate faces dropped")
    return np.asarray(faces[np.sort(first)])


def _face_pieces(faces: Ints, vertex_count: int) -> Ints:
    """Number of the connected piece that each face belongs to, (F,)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    rows = np.concatenate([faces[:, 0], faces[:, 1]])
    columns = np.concatenate([faces[:, 1], faces[:, 2]])
    links = coo_array((np.ones(len(rows), np.int8), (rows, columns)), (vertex_count, vertex_count))
    _, label = connected_components(links, directed=False)
    _, piece = np.unique(label[faces[:, 0]], return_inverse=True)
    return piece.astype(np.int64)


def _piece_bounds(vertices: Floats, faces: Ints, piece: Ints, count: int) -> tuple[Floats, Floats]:
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    for k in range(3):
        np.minimum.at(low, piece, vertices[faces[:, k]])
        np.maximum.at(high, piece, vertices[faces[:, k]])
    return low, high


def _drop_floating_pieces(vertices: Floats, faces: Ints, notes: list[ScanNote]) -> Ints:
    piece = _face_pieces(faces, len(vertices))
    sizes = np.bincount(piece)
    largest = int(sizes.argmax())
    low, high = _piece_bounds(vertices, faces, piece, len(sizes))
    inside: Bools = (low >= low[largest]).all(axis=1) & (high <= high[largest]).all(axis=1)
    # Eyes and teeth are small but lie within the head; what lies outside is scatter.
    share = np.where(inside, _INNER_PIECE_SHARE, _PIECE_SHARE)
    keep = sizes >= share * sizes[largest]
    if keep.all():
        return faces
    lost = int(sizes[~keep].sum())
    _add(notes, int(np.count_nonzero(~keep)), f"floating pieces dropped ({lost:,} faces)")
    return np.asarray(faces[keep[piece]])


def _wind_outward(vertices: Floats, faces: Ints, notes: list[ScanNote]) -> Ints:
    import trimesh

    mesh = trimesh.Trimesh(vertices, faces, process=False)
    wound = faces
    if not mesh.is_winding_consistent:
        trimesh.repair.fix_winding(mesh)  # type: ignore[no-untyped-call]
        wound = np.asarray(mesh.faces, dtype=np.int64)
    piece = _face_pieces(wound, len(vertices))
    a, b, c = (vertices[wound[:, k]] for k in range(3))
    doubled, middle = np.cross(b - a, c - a), (a + b + c) / 3.0
    area = np.linalg.norm(doubled, axis=1)
    total = np.bincount(piece, area)
    moment = np.stack([np.bincount(piece, area * middle[:, k]) for k in range(3)], axis=1)
    centre = moment / total[:, None]
    # For a closed piece this is six times its volume wherever the centre is; an open one, like a
    # face seen from the front, bulges outward from the centre of its area.
    outward = np.bincount(piece, np.einsum("ij,ij->i", doubled, middle - centre[piece]))
    inward = outward[piece] < 0.0
    result = np.where(inward[:, None], wound[:, ::-1], wound)
    turned = np.count_nonzero(_parity(result) != _parity(faces))
    _add(notes, int(turned), "faces turned to point outward")
    return np.asarray(result)


def _parity(faces: Ints) -> Bools:
    """Whether each face lists its vertices in an odd order, (F,)."""
    a, b, c = faces.T
    return np.asarray((a > b) ^ (b > c) ^ (a > c))


def _report_edges(faces: Ints, vertex_count: int, notes: list[ScanNote]) -> None:
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, count = np.unique(edges[:, 0] * vertex_count + edges[:, 1], return_counts=True)
    shared, open_edges = int(np.count_nonzero(count > 2)), int(np.count_nonzero(count == 1))
    if shared:
        text = f"{shared:,} edges are shared by more than two faces (non-manifold)"
        notes.append(ScanNote("warning", text))
    if open_edges:
        text = f"the surface is open: {open_edges:,} edges have a face on one side only"
        notes.append(ScanNote("warning", text))
