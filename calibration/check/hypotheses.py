"""What may have happened between the reference and the check, as directions of change."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.special import chdtrc, gammaln

from calibration.adjustment.camera import INTERIOR, PER_CAMERA
from calibration.check.epoch import Epoch
from calibration.check.linear import Columns
from geometry.arrays import Floats, Ints

ALPHA = 1e-3
"""Chance that a check of an unchanged rig raises any alarm."""

LEAST_FOR_BEND = 9
FLAT = 0.02
TAIL = 600.0
"""Above this the tail of chi-square is taken from its series: the exact one underflows."""


class Cause(StrEnum):
    """Families of hypotheses."""

    POSE = "pose"
    LENS = "lens"
    ALL_FOCAL = "all-focal"
    ALL_SHIFT = "all-shift"
    TARGET = "target"
    SCALE = "scale"
    BEND = "bend"
    SHAPE = "shape"
    ALL_SCALE = "all-scale"
    VIEW = "view"
    CAMERA_SYNC = "camera-sync"
    PLACE_SYNC = "place-sync"


SHARES = {
    Cause.POSE: 0.30,
    Cause.LENS: 0.10,
    Cause.ALL_FOCAL: 0.03,
    Cause.ALL_SHIFT: 0.02,
    Cause.TARGET: 0.10,
    Cause.SCALE: 0.05,
    Cause.BEND: 0.05,
    Cause.SHAPE: 0.05,
    Cause.ALL_SCALE: 0.05,
    Cause.VIEW: 0.05,
    Cause.CAMERA_SYNC: 0.05,
    Cause.PLACE_SYNC: 0.05,
}
"""How the families share the chance of a false alarm (Bonferroni); the rest is the noise test's.
Within a family all members have equal parts, whatever their number."""

NOISE_SHARE = 0.10


ALL_LENSES = (Cause.ALL_FOCAL, Cause.ALL_SHIFT)
"""What changes the pictures of all cameras alike."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One cause for one subject: ``columns`` (c,) of the base and ``ways`` (c, d) along them.

    ``subject`` is an index: of a camera, carrier, target, view or place. ``alpha``: its part of
    the chance of a false alarm.
    """

    cause: Cause
    subject: int
    columns: Ints
    ways: Floats
    alpha: float

    def directions(self, base: int) -> Floats:
        """The directions (base, d)."""
        out = np.zeros((base, self.ways.shape[1]))
        out[self.columns] = self.ways
        return out


def log_tail(statistic: float, dof: int) -> float:
    """Natural logarithm of the chance that chi-square exceeds ``statistic``."""
    if dof == 0:
        return 0.0
    if statistic < TAIL:
        return float(np.log(chdtrc(dof, statistic)))
    half = dof / 2.0
    x = statistic / 2.0
    # Upper incomplete gamma function by its leading terms: the ratio falls as (half - 1) / x.
    series = 1.0 / (1.0 - min((half - 1.0) / x, 0.9))
    return float((half - 1.0) * np.log(x) - x - gammaln(half) + np.log(series))


def hypotheses(epoch: Epoch) -> tuple[Hypothesis, ...]:
    """All single causes that this epoch could show."""
    columns = Columns.of(epoch)
    groups = {
        **_cameras(epoch, columns),
        **_carriers(epoch, columns),
        **_views(epoch, columns),
    }
    out = []
    for cause, found in groups.items():
        for subject, places, ways in found:
            alpha = ALPHA * SHARES[cause] / len(found)
            out.append(Hypothesis(cause, subject, places, ways, alpha))
    return tuple(out)


_Parts = list[tuple[int, Ints, Floats]]


def _plain(subject: int, places: Ints) -> tuple[int, Ints, Floats]:
    return subject, places, np.eye(len(places))


def _cameras(epoch: Epoch, columns: Columns) -> dict[Cause, _Parts]:
    seen = [int(k) for k in np.unique(epoch.camera)]
    focal = np.array([columns.camera(k, 0, 1)[0] for k in seen])
    axis = np.concatenate([columns.camera(k, 1, 3) for k in seen])
    return {
        Cause.ALL_FOCAL: [(0, focal, epoch.reference.interior[seen, 0][:, None])],
        Cause.ALL_SHIFT: [(0, axis, np.tile(np.eye(2), (len(seen), 1)))],
        Cause.POSE: [_plain(k, columns.camera(k, INTERIOR, PER_CAMERA)) for k in seen],
        Cause.LENS: [_plain(k, columns.camera(k, 0, 3)) for k in seen],
    }


def _carriers(epoch: Epoch, columns: Columns) -> dict[Cause, _Parts]:
    rays = np.bincount(epoch.target, minlength=columns.targets)
    seen = [int(k) for k in np.flatnonzero(rays >= 2)]
    out: dict[Cause, _Parts] = {Cause.TARGET: [_plain(k, columns.target(k)) for k in seen]}
    scale: _Parts = []
    bend: _Parts = []
    shape: _Parts = []
    for carrier in np.unique(epoch.target_carrier):
        own = np.array([k for k in seen if epoch.target_carrier[k] == carrier], dtype=np.int64)
        if len(own) < 2:
            continue
        points = epoch.reference.target[own] - epoch.reference.target[own].mean(axis=0)
        places = np.concatenate([columns.target(int(k)) for k in own])
        scale.append((int(carrier), places, points.reshape(-1, 1)))
        if len(own) >= 4:
            shape.append(_plain(int(carrier), places))
        if len(own) >= LEAST_FOR_BEND and _flat(points):
            bend.append((int(carrier), places, bend_ways(points)))
    out |= {Cause.SCALE: scale, Cause.BEND: bend, Cause.SHAPE: shape}
    if len(scale) > 1:
        places = np.concatenate([part[1] for part in scale])
        out[Cause.ALL_SCALE] = [(0, places, np.concatenate([part[2] for part in scale]))]
    return out


def _flat(points: Floats) -> bool:
    """Whether a carrier is a plate, even a bent one."""
    extents = np.linalg.svd(points, compute_uv=False)
    return bool(extents[2] < FLAT * extents[0] and extents[1] > FLAT * extents[0])


def bend_ways(points: Floats) -> Floats:
    """Bending of a plate with centred points (m, 3): quadratic out of its plane, (3 m, 3)."""
    _, _, axes = np.linalg.svd(points, full_matrices=False)
    x, y = points @ axes[0], points @ axes[1]
    size = float(np.sqrt(np.mean(x * x + y * y)))
    forms = np.stack([x * x, x * y, y * y], axis=1) / size**2
    return np.asarray((forms[:, None, :] * axes[2][None, :, None]).reshape(-1, 3))


def _views(epoch: Epoch, columns: Columns) -> dict[Cause, _Parts]:
    moving = epoch.moving[epoch.view_place]
    views = [int(k) for k in np.flatnonzero(moving)]
    out: dict[Cause, _Parts] = {Cause.VIEW: [_plain(v, columns.view(v)) for v in views]}
    cameras: _Parts = []
    for camera in np.unique(epoch.view_camera[moving]):
        own = np.flatnonzero(moving & (epoch.view_camera == camera))
        if len(own) >= 2:
            cameras.append(_plain(int(camera), _all_views(columns, own)))
    places: _Parts = []
    for place in np.flatnonzero(epoch.moving):
        own = np.flatnonzero(epoch.view_place == place)
        if len(own) >= 3:
            places.append(_plain(int(place), _all_views(columns, own)))
    return out | {Cause.CAMERA_SYNC: cameras, Cause.PLACE_SYNC: places}


def _all_views(columns: Columns, views: Ints) -> Ints:
    return np.concatenate([columns.view(int(v)) for v in views])
