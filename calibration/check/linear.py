"""The linear model of a check: normal equations of all that could have changed.

Columns ("base"): all cameras (19 each), the used targets (3 each), and each view's own shift and
turn of its carrier (6 each). Unknowns: errors of the reference (unit normal numbers, mapped by a
root of its covariance), the places of carriers, and whatever an accepted finding set free.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import csr_array

from calibration.adjustment.camera import PER_CAMERA
from calibration.adjustment.initialisation.views import spread_rank
from calibration.adjustment.model import ObservationIndex, partials
from calibration.adjustment.state import State
from calibration.check.epoch import Epoch
from geometry.arrays import Floats, Ints

LOOSE = 1e-11
"""Weight of the pull on freed unknowns, against their own: keeps the equations solvable."""


@dataclass(frozen=True, eq=False)
class Columns:
    """Where what stands among the base columns."""

    cameras: int
    targets: int
    views: int

    @classmethod
    def of(cls, epoch: Epoch) -> Columns:
        """Of an epoch."""
        return cls(len(epoch.camera_names), len(epoch.target_names), len(epoch.view_camera))

    @property
    def count(self) -> int:
        """How many there are."""
        return PER_CAMERA * self.cameras + 3 * self.targets + 6 * self.views

    @property
    def reference(self) -> int:
        """How many belong to what the reference holds."""
        return PER_CAMERA * self.cameras + 3 * self.targets

    def camera(self, index: int, first: int = 0, last: int = PER_CAMERA) -> Ints:
        """Some parameters of a camera."""
        return PER_CAMERA * index + np.arange(first, last)

    def target(self, index: int) -> Ints:
        """Coordinates of a target."""
        return PER_CAMERA * self.cameras + 3 * index + np.arange(3)

    def view(self, index: int) -> Ints:
        """Shift and turn of a view."""
        return self.reference + 6 * index + np.arange(6)


CHUNK = 1024
GONE = 1e-7
"""A column whose score keeps less than this share of its variance is determined by others."""


def sight_of(epoch: Epoch) -> ObservationIndex:
    """Each view has a place of its own in the state."""
    return ObservationIndex(epoch.camera, epoch.view, epoch.target)


def moved(state: State, change: Floats, columns: Columns) -> State:
    """The state after a change of the base columns."""
    size = PER_CAMERA * columns.cameras
    core = np.concatenate([change[:size], change[columns.reference :]])
    return state.moved(core, change[size : columns.reference].reshape(-1, 3))


class Linear:
    """The model about one state. Costly parts are made when first asked for, and kept."""

    def __init__(
        self,
        epoch: Epoch,
        state: State,
        freed: Floats | None = None,
        like: Linear | None = None,
    ) -> None:
        """``freed`` (base, e): directions that accepted findings set free.

        ``like``: a model about a state so near that its equations serve here, too.
        """
        self.epoch, self.columns = epoch, Columns.of(epoch)
        self.freed = np.zeros((self.columns.count, 0)) if freed is None else freed
        if like is None:
            self.design = self._design(state)
            self.normal: Floats = (self.design.T @ self.design).toarray()
        else:
            self.design, self.normal = like.design, like.normal
            self._kept = like._kept
            self.spread = self._cut(_without(like.spread, self.freed[:, like.freed.shape[1] :]))

    def _design(self, state: State) -> csr_array:
        """Weighted partials (2 n, base)."""
        epoch, columns = self.epoch, self.columns
        parts = partials(state, sight_of(epoch))
        values = np.concatenate([parts.camera, parts.target, parts.pose], axis=2)
        values /= epoch.sigma_px[:, :, None]
        places = np.concatenate(
            [
                PER_CAMERA * epoch.camera[:, None] + np.arange(PER_CAMERA),
                PER_CAMERA * columns.cameras + 3 * epoch.target[:, None] + np.arange(3),
                columns.reference + 6 * epoch.view[:, None] + np.arange(6),
            ],
            axis=1,
        )
        width, rows = places.shape[1], 2 * len(places)
        spans = np.arange(0, rows * width + 1, width)
        index = np.repeat(places, 2, axis=0).ravel()
        return csr_array((values.reshape(-1), index, spans), shape=(rows, columns.count))

    @cached_property
    def _kept(self) -> tuple[Floats, Floats]:
        """What the unknowns that are never freed do to the base columns, and to the score."""
        epoch, columns = self.epoch, self.columns
        root = epoch.reference.root
        out = np.zeros((columns.count, root.shape[1] + 6 * len(epoch.place_carrier)))
        out[: columns.reference, : root.shape[1]] = root
        for view, place in enumerate(epoch.view_place):
            first = root.shape[1] + 6 * int(place)
            out[columns.view(view), first + np.arange(6)] = 1.0
        return out, np.asarray(self.normal @ out)

    @cached_property
    def unknowns(self) -> Floats:
        """What each unknown does to the base columns, (base, u)."""
        return np.concatenate([self._kept[0], self.freed], axis=1)

    @cached_property
    def _effect(self) -> Floats:
        return np.concatenate([self._kept[1], self.normal @ self.freed], axis=1)

    @cached_property
    def pull(self) -> Floats:
        """Weights (u,) that draw unknowns to zero: 1 for errors of the reference."""
        epoch = self.epoch
        rank = epoch.reference.root.shape[1]
        out = np.zeros(self.unknowns.shape[1])
        out[:rank] = 1.0
        for place, carrier in enumerate(epoch.place_carrier):
            own = epoch.reference.target[epoch.target_carrier == carrier]
            if spread_rank(own) < 2:
                out[rank + 6 * place + 3 : rank + 6 * place + 6] = 1.0
        first = rank + 6 * len(epoch.place_carrier)
        own_weight = np.einsum("bu,bu->u", self.unknowns[:, first:], self._effect[:, first:])
        out[first:] = LOOSE * np.maximum(own_weight, 1e-300)
        return out

    @cached_property
    def _factor(self) -> tuple[tuple[Floats, bool], Floats]:
        matrix = self.unknowns.T @ self._effect
        places = np.arange(len(matrix))
        matrix[places, places] += self.pull
        diagonal = np.diag(matrix)
        scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        # A place that too few points tie down must not stop the check of everything else.
        matrix[places, places] = np.where(diagonal > 0.0, diagonal * (1.0 + 1e-12), 1.0)
        return cho_factor(matrix * scale[:, None] * scale, lower=True, check_finite=False), scale

    def solve(self, right: Floats) -> Floats:
        """Unknowns (u, ...) of right-hand sides."""
        factor, scale = self._factor
        shape = (-1,) + (1,) * (right.ndim - 1)
        scaled = scale.reshape(shape) * right
        return np.asarray(scale.reshape(shape) * cho_solve(factor, scaled, check_finite=False))

    @cached_property
    def spread(self) -> Floats:
        """Covariance (base, base) of the score ``design^T v`` when nothing happened."""
        return self._cut(np.asarray(self.normal - self._effect @ self.solve(self._effect.T)))

    def _cut(self, spread: Floats) -> Floats:
        """Without the rounding that is left of directions that are free already."""
        kept = np.diag(spread) > GONE * np.diag(self.normal)
        return np.asarray(spread * kept[:, None] * kept)

    @cached_property
    def leverage(self) -> Floats:
        """Variance (n, 2) of the fitted image points in units of their own."""
        fitted = self.unknowns @ self.solve(np.ascontiguousarray(self.unknowns.T))
        width = self.design.indptr[1]
        # Both coordinates of a point have the same columns.
        values = self.design.data.reshape(-1, 2, width)
        index = self.design.indices.reshape(-1, 2, width)[:, 0]
        out = np.empty((len(values), 2))
        for first in range(0, len(out), CHUNK):
            part = slice(first, first + CHUNK)
            blocks = fitted[index[part, :, None], index[part, None, :]]
            out[part] = np.sum((values[part] @ blocks) * values[part], axis=2)
        return out


def _without(spread: Floats, freed: Floats) -> Floats:
    """The score's covariance when further directions (base, e) are free."""
    across = spread @ freed
    inner = freed.T @ across
    scale = np.sqrt(np.maximum(np.diag(inner), 1e-300))
    inverse = np.linalg.pinv(inner / np.outer(scale, scale), rcond=1e-10, hermitian=True)
    across = across / scale
    return np.asarray(spread - across @ inverse @ across.T)
