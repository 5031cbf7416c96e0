"""Eqs 6-7: information of rays, covariance of points, and the cost with two derivatives.

A ray from a camera at C with optical axis a to a point at P, ``d = P - C``, ``z = a . d``,
carries the information (Eq 6, one camera's ``B' W B``)

    N = (f / (s z))**2 [ I - (d a' + a d') / z + (d . d / z**2) a a' ]

with focal length f and image standard deviation s in pixels. It does not depend on the turn
about the axis. The covariance of a point is ``Q = (N0 + sum N)^-1`` with prior information
N0; the cost is the mean over the points of the norm of Q's eigenvalues (Eq 7), which is the
Frobenius norm of Q.

Lengths are in units of a length scale; arrays are camera by point, (n, p).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats
from solver.variables import PER_CAMERA, NetworkState

_CHUNK = 512
"""Points handled at a time where memory traffic, not arithmetic, takes the time."""

_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


def symmetric(entries: Floats) -> Floats:
    """(p, 3, 3) matrices from their six entries (6, p): xx, yy, zz, xy, xz, yz."""
    full = np.empty((entries.shape[1], 3, 3))
    for (k, m), row in zip(_PAIRS, entries, strict=True):
        full[:, k, m] = full[:, m, k] = row
    return full


def covariance_norms(entries: Floats) -> Floats:
    """Frobenius norms (...) of the inverses of symmetric matrices given by entries (..., 6).

    The six are on the axis before the last: entries (..., 6, p) give (..., p). By the invariants
    of the matrices, as ``sqrt(minors^2 - 2 trace determinant) / determinant``: a hundred thousand
    3 x 3 inverses at a time have no use for pivots. The root loses no digits, for its argument is
    at least a third of the square of the sum of the principal minors.
    """
    xx, yy, zz, xy, xz, yz = (entries[..., k, :] for k in range(6))
    xy2, xz2, minor = xy * xy, xz * xz, yy * zz
    minor -= yz * yz
    determinant = xx * minor
    determinant -= yy * xz2
    determinant -= zz * xy2
    mixed = 2.0 * xy
    mixed *= xz
    mixed *= yz
    determinant += mixed
    flat = yy + zz
    trace = xx + flat
    flat *= xx
    minor += flat
    minor -= xy2
    minor -= xz2
    minor *= minor
    trace *= determinant
    trace *= 2.0
    minor -= trace
    return np.asarray(np.sqrt(minor) / determinant)


@dataclass(frozen=True, eq=False)
class _Rays:
    """Quantities of all rays: d (3, n, p); z, d.d, weight (n, p)."""

    d: Floats
    z: Floats
    rr: Floats
    weight: Floats

    def part(self, points: slice) -> _Rays:
        """The rays of some of the points."""
        return _Rays(
            self.d[:, :, points], self.z[:, points], self.rr[:, points], self.weight[:, points]
        )


def _rays(state: NetworkState, points: Floats, weight: Floats) -> _Rays:
    d = points.T[:, None, :] - state.centre.T[:, :, None]
    axis = state.axis.T[:, :, None]
    z = d[0] * axis[0] + d[1] * axis[1] + d[2] * axis[2]
    # A point that no ray weighs must not poison the sums when it lies in the camera's plane.
    z = np.where(weight > 0.0, z, 1.0)
    return _Rays(d, z, d[0] ** 2 + d[1] ** 2 + d[2] ** 2, weight)


def _normal_entries(rays: _Rays, axis: Floats, prior: float) -> Floats:
    """Six entries of each point's normal matrix, (6, p)."""
    alpha = rays.weight / rays.z**2
    beta = alpha / rays.z
    gamma = beta * rays.rr / rays.z
    entries = np.empty((6, rays.z.shape[1]))
    # (3, p): sums over the cameras of beta d a' need each camera's axis once per component.
    arms = [axis.T @ (beta * rays.d[k]) for k in range(3)]
    squares = np.stack([axis[:, k] * axis[:, m] for k, m in _PAIRS]) @ gamma
    for row, (k, m) in enumerate(_PAIRS):
        entries[row] = squares[row] - arms[k][m] - arms[m][k]
    entries[:3] += alpha.sum(axis=0) + prior
    return entries


def ray_information(state: NetworkState, points: Floats, weight: Floats) -> Floats:
    """Six entries (n, 6, p) of the information of each camera's ray to each point (p, 3).

    ``weight`` (n, p) is (f/s)**2, or 0 where a camera does not see a point.
    """
    rays, axis = _rays(state, points, weight), state.axis
    alpha = weight / rays.z**2
    beta = alpha / rays.z
    gamma = beta * rays.rr / rays.z
    out = np.empty((len(axis), 6, len(points)))
    for row, (k, m) in enumerate(_PAIRS):
        own = axis[:, k, None] * rays.d[m] + rays.d[k] * axis[:, m, None]
        out[:, row] = (axis[:, k] * axis[:, m])[:, None] * gamma - beta * own
    out[:, :3] += alpha[:, None]
    return out


def loss_by_one_view(state: NetworkState, points: Floats, weight: Floats, prior: float) -> Floats:
    """By how much the norm of each point's covariance would grow without its best view, (p,)."""
    own = ray_information(state, points, weight)
    entries = own.sum(axis=0)
    entries[:3] += prior
    with np.errstate(divide="ignore", invalid="ignore"):
        # Without its only view a point has nothing but the prior, or what rounding leaves of it.
        without = np.abs(covariance_norms(entries - own))
    lost = np.where(weight > 0.0, np.nan_to_num(without, nan=np.inf), 0.0).max(axis=0)
    return np.asarray(np.maximum(lost - covariance_norms(entries), 0.0))


def normal_matrices(state: NetworkState, points: Floats, weight: Floats, prior: float) -> Floats:
    """``N0 + sum N`` of each point, (p, 3, 3); ``weight`` (n, p) is (f/s)**2 or 0 where unseen."""
    return symmetric(_normal_entries(_rays(state, points, weight), state.axis, prior))


class CovarianceCost:
    """The cost of Eq 7 with the seen rays held fixed, and its derivatives in closed form.

    ``points`` (p, 3) and ``prior`` (information, 1 / sigma**2) in units of the length scale;
    ``weight`` (n, p). ``gradient`` gives (7 n,), ``hessian`` (7 n, 7 n). Rays that end behind
    their camera make the value NaN, which an interior-point solver answers with a shorter step.
    """

    def __init__(self, points: Floats, weight: Floats, prior: float, scale: float = 1.0) -> None:
        self.points = points
        self.weight = weight
        self.prior = prior
        self.scale = scale

    def value(self, state: NetworkState) -> float:
        """Mean norm of the covariances, divided by ``scale``."""
        rays = _rays(state, self.points, self.weight)
        if (rays.z <= 0.0).any():
            return float("nan")
        return float(self._norms(rays, state).mean() / self.scale)

    def norms(self, state: NetworkState) -> Floats:
        """Norm (p,) of the covariance of each point, whatever the ``scale``."""
        return self._norms(_rays(state, self.points, self.weight), state)

    def _norms(self, rays: _Rays, state: NetworkState) -> Floats:
        q = np.linalg.inv(symmetric(_normal_entries(rays, state.axis, self.prior)))
        return np.asarray(np.sqrt(np.einsum("pkm,pkm->p", q, q)))

    def typical(self, state: NetworkState) -> float:
        """Median norm of the covariances: what the cost is made of when no point is lost."""
        return float(np.median(self.norms(state)))

    def gradient(self, state: NetworkState) -> Floats:
        """Derivative of :meth:`value` by all unknowns, (7 n,)."""
        rays = _rays(state, self.points, self.weight)
        q = np.linalg.inv(symmetric(_normal_entries(rays, state.axis, self.prior)))
        norm = np.sqrt(np.einsum("pkm,pkm->p", q, q))
        s = -(q @ q @ q) / norm[:, None, None]
        by_d, by_a, *_ = self._first(rays, state.axis, s)
        out = np.zeros((len(state.centre), PER_CAMERA))
        out[:, 0:3] = np.einsum("iak,ik->ia", state.rotation_1[:, :, 2, :], by_a)
        out[:, 3:6] = -by_d
        return np.asarray(out.ravel() / (len(self.points) * self.scale))

    def _first(self, rays: _Rays, axis: Floats, s: Floats) -> tuple[Floats, ...]:
        """Sums over points of the derivatives of tr(S N) by d and a, each (n, 3), and parts."""
        z, rr, w = rays.z, rays.rr, rays.weight
        trace = np.trace(s, axis1=1, axis2=2)
        # (3, n, p) products of S with the axis and with d, one symmetric entry at a time.
        entry = s.transpose(1, 2, 0)
        sa = np.stack([axis @ entry[k] for k in range(3)])
        sd = np.stack([sum(entry[k, m] * rays.d[m] for m in range(3)) for k in range(3)])
        b = sum(rays.d[k] * sa[k] for k in range(3))
        c = sum(sa[k] * axis[:, k, None] for k in range(3))
        inv = 1.0 / z
        z3 = w * inv**3
        z4 = z3 * inv
        psi_z = -2.0 * trace * z3 + 6.0 * b * z4 - 4.0 * rr * c * z4 * inv
        by_d = psi_z.sum(axis=1)[:, None] * axis
        by_d += _weighted(-2.0 * z3, sa) + _weighted(2.0 * c * z4, rays.d)
        by_a = _weighted(psi_z, rays.d) + _weighted(-2.0 * z3, sd) + _weighted(2.0 * rr * z4, sa)
        return by_d, by_a, trace, sa, sd, b, c, psi_z

    def hessian(self, state: NetworkState) -> Floats:
        """Second derivative of :meth:`value`, (7 n, 7 n)."""
        rays = _rays(state, self.points, self.weight)
        lam, u = np.linalg.eigh(symmetric(_normal_entries(rays, state.axis, self.prior)))
        lam = 1.0 / lam
        norm = np.sqrt((lam**2).sum(axis=1))
        s = -np.einsum("pkm,pm,pnm->pkn", u, lam**3, u) / norm[:, None, None]
        n = len(state.centre)
        out = self._between_cameras(rays, state, u, lam, norm)
        blocks = self._within_cameras(rays, state, s)
        for i in range(n):
            own = slice(PER_CAMERA * i, PER_CAMERA * (i + 1))
            out[own, own][:6, :6] += blocks[i]
        return np.asarray(out / (len(self.points) * self.scale))

    def _within_cameras(self, rays: _Rays, state: NetworkState, s: Floats) -> Floats:
        """Curvature of each ray's information, weighted by S, (n, 6, 6)."""
        axis = state.axis
        _, by_a, trace, sa, sd, b, c, psi_z = self._first(rays, axis, s)
        z, rr, w, d = rays.z, rays.rr, rays.weight, rays.d
        inv = 1.0 / z
        z3 = w * inv**3
        z4 = z3 * inv
        z5 = z4 * inv
        zz = 6.0 * trace * z4 - 24.0 * b * z5 + 20.0 * rr * c * z5 * inv
        zb, zr, zc = 6.0 * z4, -4.0 * c * z5, -4.0 * rr * z5
        total = [zz.sum(axis=1), (c * z4).sum(axis=1), psi_z.sum(axis=1)]

        def outer(left: Floats, right: Floats) -> Floats:
            return np.asarray(np.einsum("ik,im->ikm", left, right))

        def both(matrix: Floats) -> Floats:
            return np.asarray(matrix + matrix.transpose(0, 2, 1))

        def moment(left: Floats, factor: Floats, right: Floats) -> Floats:
            return np.asarray((left * factor).transpose(1, 0, 2) @ right.transpose(1, 2, 0))

        eye = np.eye(3)
        dd = total[0][:, None, None] * outer(axis, axis) + 2.0 * total[1][:, None, None] * eye
        dd += both(outer(axis, _weighted(zb, sa) + 2.0 * _weighted(zr, d)))
        aa = moment(d, zz, d) + both(moment(d, zb, sd)) + 2.0 * both(moment(d, zc, sa))
        aa += 2.0 * np.einsum("ip,pkm->ikm", rr * z4, s)
        da = outer(axis, _weighted(zz, d) + _weighted(zb, sd) + 2.0 * _weighted(zc, sa))
        da += moment(sa, zb, d) + 2.0 * moment(d, zr, d) + 4.0 * moment(d, z4, sa)
        da += total[2][:, None, None] * eye - 2.0 * np.einsum("ip,pkm->ikm", z3, s)
        return _chain(state, dd, aa, da, by_a)

    def _between_cameras(
        self, rays: _Rays, state: NetworkState, u: Floats, lam: Floats, norm: Floats
    ) -> Floats:
        """Curvature of the norm of the inverse, which couples all cameras of a point."""
        n, p = rays.z.shape
        coupled = np.zeros((6 * n, 6 * n))
        for first in range(0, p, _CHUNK):
            part = slice(first, first + _CHUNK)
            change = _normal_changes(rays.part(part), state, u[part])
            _add_coupling(coupled, change, lam[part], norm[part])
        out = np.zeros((n, PER_CAMERA, n, PER_CAMERA))
        out[:, :6, :, :6] = coupled.reshape(n, 6, n, 6)
        return out.reshape(n * PER_CAMERA, n * PER_CAMERA)


def _add_coupling(coupled: Floats, change: Floats, lam: Floats, norm: Floats) -> None:
    """Add the second derivative of the norm of the inverse for some points to ``coupled``.

    With X a change of N in the eigenbasis of Q (eigenvalues l), the second derivative of
    ``|Q|`` is ``sum_km l_k l_m (l_k**2 + l_k l_m + l_m**2) X_km**2 / |Q|`` less
    ``(sum_k l_k**3 X_kk)**2 / |Q|**3``.
    """
    six_n, p = len(coupled), len(lam)
    weights = np.empty((6, p))
    for row, (k, m) in enumerate(_PAIRS):
        lk, lm = lam[:, k], lam[:, m]
        twice = 1.0 if k == m else 2.0
        weights[row] = np.sqrt(twice * lk * lm * (lk**2 + lk * lm + lm**2) / norm)
    flat = np.einsum("vikp,pk->vip", change[:, :, :3], lam**3 / norm[:, None] ** 1.5)
    change *= weights
    tall = change.reshape(six_n, 6 * p)
    flat = flat.reshape(six_n, p)
    order = np.arange(six_n).reshape(6, -1).T.ravel()
    coupled += (tall @ tall.T - flat @ flat.T)[np.ix_(order, order)]


def _weighted(factor: Floats, vector: Floats) -> Floats:
    """Sums over the points of ``factor`` (n, p) times ``vector`` (3, n, p), (n, 3)."""
    return np.asarray(np.matmul(vector.transpose(1, 0, 2), factor[:, :, None])[:, :, 0])


def _normal_changes(rays: _Rays, state: NetworkState, u: Floats) -> Floats:
    """Derivatives of each ray's N by its camera's six pose unknowns in the eigenbasis of Q.

    (6 unknowns, n, 6 entries, p). ``u`` (p, 3, 3) holds the eigenvectors as columns.
    """
    n, p = rays.z.shape
    inv = 1.0 / rays.z
    z3 = rays.weight * inv**3
    z4 = z3 * inv
    turn = u.transpose(2, 1, 0)
    d = np.stack([sum(turn[m, k] * rays.d[k] for k in range(3)) for m in range(3)])
    a = np.matmul(state.axis, turn)
    out = np.empty((6, n, 6, p))
    for v in range(6):
        if v < 3:
            slope = state.rotation_1[:, v, 2, :]
            e = np.matmul(slope, turn)
            dz = sum(rays.d[k] * slope[:, k, None] for k in range(3))
            own, along = d, 4.0 * rays.rr * z4 * inv * dz
            pull = rays.rr * z4
        else:
            e = np.broadcast_to(-u[:, v - 3, :].T[:, None, :], (3, n, p))
            dz = np.broadcast_to(-state.axis[:, v - 3][:, None], (n, p))
            own = a
            along = 4.0 * rays.rr * z4 * inv * dz + 2.0 * z4 * rays.d[v - 3]
            pull = None
        mix, lead = 3.0 * z4 * dz, -2.0 * z3 * dz
        for row, (k, m) in enumerate(_PAIRS):
            entry = mix * (d[k] * a[m] + a[k] * d[m]) - along * a[k] * a[m]
            entry -= z3 * (e[k] * own[m] + own[k] * e[m])
            if pull is not None:
                entry += pull * (e[k] * a[m] + a[k] * e[m])
            if k == m:
                entry += lead
            out[v, :, row] = entry
    return out


def _chain(state: NetworkState, dd: Floats, aa: Floats, da: Floats, by_a: Floats) -> Floats:
    """From second derivatives by d and a to those by the angles and the centre, (n, 6, 6)."""
    slope = state.rotation_1[:, :, 2, :]
    out = np.empty((len(dd), 6, 6))
    out[:, :3, :3] = np.einsum("iak,ikm,ibm->iab", slope, aa, slope)
    out[:, :3, :3] += np.einsum("iabk,ik->iab", state.rotation_2[:, :, :, 2, :], by_a)
    out[:, 3:, 3:] = dd
    out[:, 3:, :3] = -np.einsum("ikm,iam->ika", da, slope)
    out[:, :3, 3:] = out[:, 3:, :3].transpose(0, 2, 1)
    return out
