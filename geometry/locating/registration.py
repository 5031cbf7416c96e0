"""Laying the template on a surface: turn, shift, scale and bend by nearest points."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from geometry.arrays import Floats, Ints
from geometry.locating.template import FaceTemplate
from geometry.surface import SurfacePoints


@dataclass(frozen=True, eq=False)
class Laid:
    """The template on a surface: ``x = scale * rotation @ x_template + tip_mm``.

    ``misfit_mm`` is the root mean square distance of all but the worst of its points. ``peak_mm``
    (3,) is where the nose tip is held, ``shape`` (m,) bends the template by its modes.
    """

    rotation: Floats
    tip_mm: Floats
    scale: float
    peak_mm: Floats = field(default_factory=lambda: np.zeros(3))
    shape: Floats = field(default_factory=lambda: np.zeros(0))
    misfit_mm: float = np.inf

    @property
    def cost_mm(self) -> float:
        """The misfit, and how unusual a face it takes: each counts as if it were independent."""
        unusual = float(np.sqrt((self.shape**2).mean())) if len(self.shape) else 0.0
        return float(np.hypot(self.misfit_mm, _UNUSUAL_MM * unusual))

    def place(self, points_mm: Floats) -> Floats:
        """Template points (n, 3) where they lie, (n, 3)."""
        return np.asarray(self.scale * points_mm @ self.rotation.T + self.tip_mm)


FAR_MM = 10.0
"""No point counts for more than if it were this far from the surface."""

INNER_MM = 70.0
"""What is farther from the nose tip steers, but a scan may end before it: it is not judged."""

_ALIKE = float(np.cos(np.radians(60.0)))
_REACH = (25.0, 12.0)
_SIDEWAYS = 0.02
_SCALES = (0.72, 1.39)
_INDEPENDENT = 40.0
_BESIDE_MM = 4.0
_LOOK_MM = 20.0
_JUDGED = 0.85
_UNUSUAL_MM = 0.6
_QUERY_THREADS = 2
"""Threads that look for nearest points side by side, which changes nothing of what is found: a look
takes a few milliseconds, of which more threads would save less than it takes to begin them."""


@dataclass(frozen=True)
class Stiffness:
    """How a template resists: ``scale_sigma`` of the logarithm of its size, and of its points.

    ``place_mm``: how far points of a face still lie from the template where it fits best.
    ``modes``: how many of its modes bend. ``anchor``: how firmly its tip is held at a peak of
    the surface, as a share of its points.
    """

    scale_sigma: float = 0.1
    place_mm: float = 4.0
    modes: int = 0
    anchor: float = 0.5


class Surface:
    """Points of a scan in a tree, with their normals; which side is out does not matter."""

    def __init__(self, points: SurfacePoints) -> None:
        self.points_mm, self.normals = points.points_mm, points.normals
        self._tree = cKDTree(points.points_mm)

    def near(self, points_mm: Floats, most_mm: float) -> tuple[Floats, Ints]:
        """Distance (...) to the nearest point and its number; infinite beyond ``most_mm``."""
        distance, nearest = self._tree.query(
            points_mm, distance_upper_bound=most_mm, workers=_QUERY_THREADS
        )
        within = np.minimum(np.asarray(nearest, dtype=np.int64), len(self.points_mm) - 1)
        return np.asarray(distance), within


def rough(even_mm: Floats, points_mm: Floats, ways: list[Laid]) -> Floats:
    """Misfit (n,) in mm of template points (m, 3) laid in n ways on surface points (k, 3)."""
    placed = np.concatenate([way.place(points_mm) for way in ways])
    distance, _ = cKDTree(even_mm).query(
        placed, distance_upper_bound=FAR_MM, workers=_QUERY_THREADS
    )
    distance = np.minimum(distance, FAR_MM).reshape(len(ways), -1)
    return np.asarray(np.sqrt((distance**2).mean(axis=1)))


@dataclass(frozen=True, eq=False)
class _Many:
    """Many ways at once: each array has one more dimension than in :class:`Laid`, the first."""

    rotation: Floats
    tip_mm: Floats
    scale: Floats
    peak_mm: Floats
    shape: Floats


def register(
    surface: Surface,
    template: FaceTemplate,
    starts: list[Laid],
    steps: int,
    stiffness: Stiffness,
) -> list[Laid]:
    """The best place near each of ``starts``: Gauss-Newton on distances to the surface's planes.

    The template takes the shape of the face in the last two thirds of the steps.
    """
    if not starts:
        return []
    shape = np.zeros((len(starts), stiffness.modes))
    for row, start in zip(shape, starts, strict=True):
        kept = start.shape[: stiffness.modes]
        row[: len(kept)] = kept
    now = _Many(
        np.stack([s.rotation for s in starts]),
        np.stack([s.tip_mm for s in starts]),
        np.array([s.scale for s in starts]),
        np.stack([s.peak_mm for s in starts]),
        shape,
    )
    for step in range(steps):
        reach = _REACH[0] + (_REACH[1] - _REACH[0]) * step / steps
        bend = stiffness.modes if step >= steps // 3 else 0
        now = _step(surface, template, now, reach, bend, stiffness)
    misfit = _misfit(surface, template, now)
    return [
        Laid(now.rotation[k], now.tip_mm[k], float(now.scale[k]), s.peak_mm, now.shape[k], float(m))
        for k, (s, m) in enumerate(zip(starts, misfit, strict=True))
    ]


def _placed(template: FaceTemplate, now: _Many) -> Floats:
    """Points of the template (w, n, 3) in each of w ways."""
    points = template.points_mm[None]
    if now.shape.any():
        modes = template.modes_mm[:, :, : now.shape.shape[1]]
        points = points + (now.shape @ modes.reshape(-1, modes.shape[2]).T).reshape(
            len(now.shape), -1, 3
        )
    return np.asarray(
        now.scale[:, None, None] * (points @ now.rotation.transpose(0, 2, 1))
        + now.tip_mm[:, None, :]
    )


def _cross(one: Floats, other: Floats) -> Floats:
    # np.cross moves axes about, which takes longer than the product.
    x, y, z = (one[..., k] for k in range(3))
    u, v, w = (other[..., k] for k in range(3))
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)


def _step(
    surface: Surface,
    template: FaceTemplate,
    now: _Many,
    reach_mm: float,
    bend: int,
    stiffness: Stiffness,
) -> _Many:
    placed = _placed(template, now)
    distance, nearest = surface.near(placed, reach_mm * float(now.scale.max()))
    plane = surface.normals[nearest]
    local = plane @ now.rotation
    along = np.einsum("wnk,nk->wn", local, template.normals)
    reach = reach_mm * now.scale[:, None]
    weight = np.maximum(1.0 - (distance / reach) ** 2, 0.0) ** 2 * (np.abs(along) > _ALIKE)
    gap = np.einsum("wnk,wnk->wn", surface.points_mm[nearest] - placed, plane)
    arm = placed - now.tip_mm[:, None, :]
    rows = [_cross(arm, plane), plane, np.einsum("wnk,wnk->wn", arm, plane)[..., None]]
    if bend:
        modes = np.einsum("wnk,nkm->wnm", local, template.modes_mm[:, :, :bend], optimize=True)
        rows.append(now.scale[:, None, None] * modes)
    jacobian = np.concatenate(rows, axis=2)
    weighted = (weight[..., None] * jacobian).transpose(0, 2, 1)
    normal, right = weighted @ jacobian, np.einsum("wkn,wn->wk", weighted, gap)
    _hold(normal, right, now, stiffness, len(template.points_mm))
    move = np.linalg.solve(normal, right[..., None])[..., 0]
    length = np.linalg.norm(move[:, :3], axis=1, keepdims=True)
    turn = Rotation.from_rotvec(move[:, :3] * np.minimum(1.0, 0.35 / np.maximum(length, 1e-12)))
    shape = now.shape.copy()
    shape[:, :bend] += move[:, 7:]
    return _Many(
        turn.as_matrix() @ now.rotation,
        now.tip_mm + move[:, 3:6],
        np.clip(now.scale * np.exp(np.clip(move[:, 6], -0.15, 0.15)), *_SCALES),
        now.peak_mm,
        shape,
    )


def _hold(normal: Floats, right: Floats, now: _Many, stiffness: Stiffness, count: int) -> None:
    """Add what is known beforehand to the normal equations (w, k, k) and (w, k)."""
    # Faces differ from the template by millimetres over wide areas: few of its points are
    # independent of each other.
    strength = (stiffness.place_mm * now.scale) ** 2 * count / _INDEPENDENT
    normal[:, 6, 6] += strength / stiffness.scale_sigma**2
    right[:, 6] -= strength / stiffness.scale_sigma**2 * np.log(now.scale)
    # Sideways the symmetry of the face says more than where its nose is highest.
    side = now.rotation[:, :, 0]
    held = np.eye(3) - (1.0 - _SIDEWAYS) * side[:, :, None] * side[:, None, :]
    anchor = stiffness.anchor * count * held
    normal[:, 3:6, 3:6] += anchor
    right[:, 3:6] -= np.einsum("wij,wj->wi", anchor, now.tip_mm - now.peak_mm)
    bent = np.arange(7, normal.shape[1])
    normal[:, bent, bent] += strength[:, None]
    right[:, 7:] -= strength[:, None] * now.shape[:, : len(bent)]
    stable = np.arange(6)
    normal[:, stable, stable] += 1e-6 * np.trace(normal[:, :6, :6], axis1=1, axis2=2)[:, None]


def _misfit(surface: Surface, template: FaceTemplate, now: _Many) -> Floats:
    """The misfit (w,) of each way."""
    inner = np.linalg.norm(template.points_mm, axis=1) < INNER_MM
    judged = replace(
        template,
        points_mm=template.points_mm[inner],
        normals=template.normals[inner],
        modes_mm=template.modes_mm[inner],
    )
    placed = _placed(judged, now)
    distance, nearest = surface.near(placed, _LOOK_MM)
    plane = surface.normals[nearest]
    along = np.einsum("wnk,nk->wn", plane @ now.rotation, judged.normals)
    # Beside a point of a sparse scan there is surface all the same.
    gap = np.einsum("wnk,wnk->wn", surface.points_mm[nearest] - placed, plane)
    beside = np.sqrt(np.maximum(distance**2 - gap**2, 0.0))
    distance = np.hypot(gap, np.maximum(beside - _BESIDE_MM, 0.0)) / now.scale[:, None]
    distance = np.minimum(distance, FAR_MM)
    distance = np.where(np.abs(along) > _ALIKE, distance, FAR_MM)
    # Mouths open, hair hangs, and a scan may end within a face.
    kept = np.sort(distance, axis=1)[:, : int(_JUDGED * distance.shape[1])]
    return np.asarray(np.sqrt((kept**2).mean(axis=1)))


def nose_tip(surface: Surface, laid: Laid) -> Floats:
    """Where the surface is highest about the template's nose, (3,)."""
    local = (surface.points_mm - laid.tip_mm) @ laid.rotation / laid.scale
    about = local[
        (np.abs(local[:, 0]) < 8.0) & (np.abs(local[:, 2]) < 14.0) & (np.abs(local[:, 1]) < 14.0)
    ]
    if not len(about):
        return np.asarray(laid.tip_mm)
    # The mean of the highest few bears the noise of a scan.
    depth = about[:, 1]
    highest = about[depth <= np.sort(depth)[min(len(depth), 5) - 1] + 0.3]
    return np.asarray(laid.place(highest.mean(axis=0)[None])[0])
