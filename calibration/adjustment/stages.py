"""From a far start to the solution in two stages: first places alone, then lenses, too.

Through a long lens a shift of the principal point and a turn of the camera look alike. Set free at
once and far from the solution, the principal points run hundreds of pixels off, and the way back
is a narrow bent valley of a hundred steps.
"""

from __future__ import annotations

from dataclasses import replace

from calibration.adjustment.levenberg import LossOptions, Solution, adjust
from calibration.adjustment.network import Network
from calibration.adjustment.state import State
from common.progress import CancelToken, ProgressCallback, ignore_progress
from geometry.camera import INTERIOR_NAMES

UNKNOWN_LENSES = ("f", "k1")
"""What the first stage frees of lenses of which nothing is known."""

NEAR_DAMPING = 1e-8


def adjust_in_stages(
    network: Network,
    start: State,
    loss: LossOptions,
    known_lenses: bool,
    progress: ProgressCallback = ignore_progress,
    cancel: CancelToken | None = None,
) -> Solution:
    """The solution of ``network``.

    ``known_lenses``: whether the start's lenses are near the truth.
    """
    rough = replace(loss, tolerance=1.0, max_iterations=min(50, loss.max_iterations))
    first = adjust(_stiff(network, known_lenses), start, rough, cancel=cancel)
    near = replace(loss, damping=NEAR_DAMPING)
    last = adjust(network, first.state, near, progress, cancel)
    return replace(last, iterations=first.iterations + last.iterations)


def _stiff(network: Network, known_lenses: bool) -> Network:
    """With lenses held, or but for their focal lengths and first distortion terms."""
    sigma = network.priors.interior_sigma.copy()
    free = () if known_lenses else UNKNOWN_LENSES
    sigma[:, [k for k, name in enumerate(INTERIOR_NAMES) if name not in free]] = 0.0
    return replace(network, priors=replace(network.priors, interior_sigma=sigma))
