"""Where a name fits on a face of a wedge, and its outlines there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats
from rig.build.wedges.lettering import Words, words
from rig.build.wedges.shape import facets

ENGRAVED_MM = 0.6
LETTERS_MM = (8.0, 7.0, 6.0, 5.0, 4.0, 3.5, 3.0, 2.5)
"""Heights of capitals to try: below 2.5 mm a nozzle of 0.4 mm fills them in."""

LINE_PITCH = 1.5
EDGE_MM = 1.0
FACES_UP = np.cos(np.radians(50.0))
"""Walls of letters lean as the face does; steeper faces would make them overhang."""


@dataclass(frozen=True, eq=False)
class Engraving:
    """Outlines in the plane of ``print_from_face`` (4, 4), whose z points out of the part."""

    print_from_face: Floats
    outlines_mm: tuple[Floats, ...]
    letters_mm: float


def engravings(name: str, corners_mm: Floats) -> Iterator[Engraving]:
    """Places for a name on the faces that look up, the largest letters first."""
    faces = [_flat(n, c) for n, c in facets(corners_mm) if n[2] >= FACES_UP]
    for height in LETTERS_MM:
        for lines in _lines(name):
            shapes = [words(line) for line in lines]
            for frame, outline in faces:
                for placed in _places(outline, shapes, height):
                    yield Engraving(frame, placed, height)


def _flat(normal: Floats, corners_mm: Floats) -> tuple[Floats, Floats]:
    """The frame (4, 4) of a face, and its outline (N, 2) anticlockwise in it."""
    from scipy.spatial import ConvexHull

    across = np.cross([0.0, 1.0, 0.0], normal)
    across /= np.linalg.norm(across)
    frame = np.eye(4)
    frame[:3, :3] = np.column_stack([across, np.cross(normal, across), normal])
    frame[:3, 3] = corners_mm.mean(axis=0)
    flat = (corners_mm - frame[:3, 3]) @ frame[:3, :2]
    return frame, flat[ConvexHull(flat).vertices]


def _lines(name: str) -> list[list[str]]:
    """A name on one, two or three lines."""
    lengths = [-(-len(name) // count) for count in (1, 2, 3)]
    return [[name[k : k + n] for k in range(0, len(name), n)] for n in dict.fromkeys(lengths)]


def _places(outline: Floats, lines: list[Words], height: float) -> Iterator[tuple[Floats, ...]]:
    """Contours where a block of text fits into a face, level or along one of its edges."""
    wide = max(line.width for line in lines) * height
    tall = (LINE_PITCH * (len(lines) - 1) + 1.0) * height
    steps = np.roll(outline, -1, axis=0) - outline
    angles = {round(_readable(float(np.arctan2(y, x))), 6): None for x, y in steps}
    for angle in (0.0, *angles):
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, -s], [s, c]])
        for centre in _centres(outline, turn, wide + 2.0 * EDGE_MM, tall + 2.0 * EDGE_MM):
            yield tuple(
                (contour * height + _start(line, k, height, tall)) @ turn.T + centre
                for k, line in enumerate(lines)
                for contour in line.contours
            )


def _start(line: Words, row: int, height: float, tall: float) -> Floats:
    """Where a line of a block begins, from the block's middle."""
    return np.array([-line.width * height / 2.0, tall / 2.0 - height * (1.0 + row * LINE_PITCH)])


def _readable(angle_rad: float) -> float:
    """The same direction, not upside down."""
    return float((angle_rad + np.pi / 2.0) % np.pi - np.pi / 2.0)


def _centres(outline: Floats, turn: Floats, wide: float, tall: float) -> list[Floats]:
    """Centres where a turned box lies inside a convex outline: a few, the deepest inside first."""
    corners = np.array([[-wide, -tall], [wide, -tall], [wide, tall], [-wide, tall]]) / 2.0 @ turn.T
    steps = np.roll(outline, -1, axis=0) - outline
    outwards = np.column_stack([steps[:, 1], -steps[:, 0]])
    outwards /= np.maximum(np.linalg.norm(outwards, axis=1, keepdims=True), 1e-12)
    limits = (outwards * outline).sum(axis=1) - (outwards @ corners.T).max(axis=1)
    low, high = outline.min(axis=0), outline.max(axis=0)
    grid = np.stack(np.meshgrid(*np.linspace(low, high, 25).T), axis=-1).reshape(-1, 2)
    depth = (limits - grid @ outwards.T).min(axis=1)
    order = np.argsort(-depth, kind="stable")
    inside = [k for k in order if depth[k] >= 0.0]
    return [grid[k] for k in inside[:: max(1, len(inside) // 4)]]
