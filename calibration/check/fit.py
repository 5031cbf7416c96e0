"""An epoch fitted to the reference: places of carriers, likely errors of the reference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.adjustment.model import project
from calibration.adjustment.state import State
from calibration.check.epoch import Epoch
from calibration.check.linear import Linear, moved, sight_of
from geometry.arrays import Floats

TOLERANCE = 1e-4
"""Stop when a step would lower chi-square by less: a hundredth of a sigma at most."""

FAR_PX = 0.5
"""A state this far from where the model was made needs a new model."""

NEAR_PX = 0.02
"""Once models are made anew, they are until the state moves less than this from its own."""

MOST_STEPS = 12
MOST_MODELS = 8


@dataclass(frozen=True, eq=False)
class Fit:
    """``unknowns`` (u,), weighted residuals ``v`` (n, 2), ``score`` (base,) of what is left.

    ``chi2`` is the weighted square sum of residuals and of the reference's errors.
    """

    linear: Linear
    state: State
    unknowns: Floats
    v: Floats
    chi2: float

    @property
    def score(self) -> Floats:
        """``design^T v``: what further parameters would like to change."""
        return np.asarray(self.linear.design.T @ self.v.ravel())


def residuals(epoch: Epoch, state: State) -> Floats:
    """Weighted residuals (n, 2); points behind a camera count as a thousand sigmas off."""
    pixel, depth = project(state, sight_of(epoch))
    v = (epoch.pixel - pixel) / epoch.sigma_px
    return np.where(depth[:, None] > 0.0, v, 1e3)


def fit(epoch: Epoch, state: State, linear: Linear | None = None) -> Fit:
    """The best places and reference errors for an epoch, from a state near it.

    With ``linear`` the model is taken as it is as long as the state stays near.
    """
    model = linear or Linear(epoch, state)
    return _settled(epoch, state, np.zeros(model.unknowns.shape[1]), model)


def refit(epoch: Epoch, last: Fit, more: Floats, near: bool) -> Fit:
    """A fit with further directions ``more`` (base, e) free, from where the last one ended.

    ``near``: whether the last one's equations will do.
    """
    freed = np.concatenate([last.linear.freed, more], axis=1)
    model = Linear(epoch, last.state, freed, like=last.linear if near else None)
    unknowns = np.concatenate([last.unknowns, np.zeros(more.shape[1])])
    return _settled(epoch, last.state, unknowns, model)


def again(epoch: Epoch, last: Fit) -> Fit:
    """The fit with the same freedom to other rows of the same epoch."""
    model = Linear(epoch, last.state, last.linear.freed)
    # The state has moved with the unknowns: starting them at zero would forgive what they cost.
    return _settled(epoch, last.state, last.unknowns, model)


def _settled(epoch: Epoch, state: State, unknowns: Floats, model: Linear) -> Fit:
    """New models about new states until the state stays near its model."""
    done, enough_px = _with_model(epoch, state, unknowns, model), FAR_PX
    for _ in range(MOST_MODELS):
        if _change_px(epoch, state, done.state) < enough_px:
            break
        state, enough_px = done.state, NEAR_PX
        done = _with_model(epoch, state, done.unknowns, Linear(epoch, state, model.freed))
    return done


def _change_px(epoch: Epoch, before: State, after: State) -> float:
    observed = sight_of(epoch)
    residual = project(after, observed)[0] - project(before, observed)[0]
    return float(np.sqrt(np.mean(residual * residual)))


def _with_model(epoch: Epoch, state: State, unknowns: Floats, model: Linear) -> Fit:
    """Gauss-Newton with the normal equations of one state: near it they hardly change."""
    v = residuals(epoch, state)
    cost = _cost(v, unknowns, model)
    for _ in range(MOST_STEPS):
        right = model.unknowns.T @ (model.design.T @ v.ravel()) - model.pull * unknowns
        step = model.solve(np.asarray(right))
        if float(right @ step) < TOLERANCE:
            break
        tried = moved(state, np.asarray(model.unknowns @ step), model.columns)
        tried_v = residuals(epoch, tried)
        tried_cost = _cost(tried_v, unknowns + step, model)
        if not tried_cost < cost:
            break
        state, v, cost, unknowns = tried, tried_v, tried_cost, unknowns + step
    return Fit(model, state, unknowns, v, cost)


def _cost(v: Floats, unknowns: Floats, model: Linear) -> float:
    return float(np.sum(v * v) + np.sum(model.pull * unknowns**2))
