"""Faults so large that no linear test applies: swapped cameras, swapped ids, another size."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from calibration.check.agreement import OFF_SIGMAS, agreeing
from calibration.check.alike import alike, turned_back
from calibration.check.consensus import Consensus, by_camera, consensus, misfit_px
from calibration.check.epoch import Epoch
from calibration.check.folders import folders_by_resection
from calibration.check.pictures import strange_pictures
from calibration.check.placing import placed_by_pairs
from calibration.check.verdicts import Finding
from common.errors import InputError
from geometry.arrays import Bools, Floats, Ints

BAD_PX = 8.0
"""Half of a camera's points farther off than this: its images are not those of its reference."""

CAP_PX = 100.0
GAIN = 0.5
SCALE_SHARE = 0.003
"""Sizes off by more than this are put right before anything else is looked at."""

UNITS_RATIO = 1.5
NEAR_SHARE = 0.25
"""A target sits in another's place when it is this near, as a share of their distance."""


@dataclass(frozen=True, eq=False)
class Corrected:
    """An epoch with gross faults put right, and which they were.

    ``suspects``: cameras that are far off although the others agree; ``cameras``: cycles of
    swapped ones; ``ids``: pairs (taken for, really) of target indices;
    ``scales``: carrier and scale of those printed in another size; ``pictures``: findings about
    cameras whose pictures are turned or of other frames, and were left out.
    """

    epoch: Epoch
    start: Consensus
    suspects: tuple[int, ...]
    cameras: tuple[tuple[int, ...], ...]
    ids: tuple[tuple[int, int], ...]
    scales: tuple[tuple[int, float], ...]
    pictures: tuple[Finding, ...] = ()


def corrected_epoch(epoch: Epoch) -> Corrected:
    """Gross faults found and undone.

    Raises :class:`InputError` when the targets are not in the reference's unit.
    """
    righted = turned_back(epoch, consensus(epoch))
    epoch, start = righted.epoch, righted.start
    if _is_off(epoch, start) and alike(epoch, start.state):
        seen = tuple(int(k) for k in np.unique(epoch.camera))
        return Corrected(epoch, start, seen, (), (), (), righted.findings)
    assigned = _assignment(epoch, start)
    cameras = _cycles(assigned)
    if cameras:
        epoch = _reassigned(epoch, assigned)
        start = consensus(epoch)
    epoch, start, strange = _without_strange(epoch, start)
    # A camera that is far off would bend the sizes of everything.
    scales = _scales(epoch, agreeing(epoch, start)[0])
    for carrier, scale in scales:
        epoch = _resized(epoch, carrier, scale)
    start = consensus(epoch) if scales else start
    ids = _swapped_ids(epoch, start)
    if ids:
        epoch = _relabelled(epoch, ids)
        start = consensus(epoch)
    start, suspects = agreeing(epoch, start)
    return Corrected(epoch, start, suspects, cameras, ids, scales, (*righted.findings, *strange))


def _without_strange(
    epoch: Epoch, start: Consensus
) -> tuple[Epoch, Consensus, tuple[Finding, ...]]:
    """Without pictures that are not what they are taken for: one may hide another."""
    told: tuple[Finding, ...] = ()
    for _ in epoch.camera_names:
        strange, keep = strange_pictures(epoch, agreeing(epoch, start)[0])
        if not strange and (placed := placed_by_pairs(epoch, start)) is not start:
            strange, keep = strange_pictures(epoch, placed)
        if not strange:
            break
        told += strange
        epoch = epoch.with_rows(keep)
        start = consensus(epoch)
    return epoch, start, told


def _is_off(epoch: Epoch, start: Consensus) -> bool:
    """Whether cameras or sizes are so far off that no linear test applies."""
    limit = OFF_SIGMAS * float(np.median(epoch.sigma_px))
    far = by_camera(epoch, misfit_px(epoch, start.state)) > limit
    return bool(far.any() or (np.abs(start.scale - 1.0) > SCALE_SHARE).any())


def _assignment(epoch: Epoch, start: Consensus) -> Ints:
    """Which reference camera took each camera's images: swaps that make far better sense."""
    count = len(epoch.camera_names)
    assigned = np.arange(count)
    cost, bad = _judged(epoch, start)
    if 2 * bad.sum() > count > 2:
        # Folders in quite another order: pair by pair that would not be found.
        resected = folders_by_resection(epoch)
        guesses = [assigned[::-1], np.roll(assigned, 1), np.roll(assigned, -1)]
        for tried in guesses if resected is None else [resected, *guesses]:
            other, other_bad = _judged(epoch, consensus(epoch, tried))
            if other < GAIN * cost:
                cost, bad, assigned = other, other_bad, tried.copy()
    while bad.sum() >= 2:
        best = None
        for a, b in itertools.combinations(np.flatnonzero(bad), 2):
            tried = assigned.copy()
            tried[[a, b]] = tried[[b, a]]
            other, other_bad = _judged(epoch, consensus(epoch, tried))
            if best is None or other < best[0]:
                best = other, other_bad, tried
        if best is None or best[0] > GAIN * cost:
            break
        cost, bad, assigned = best
    return assigned


def _judged(epoch: Epoch, found: Consensus) -> tuple[float, Bools]:
    """How badly the cameras fit in all, and which do not fit."""
    residual = by_camera(epoch, misfit_px(epoch, found.state))
    bad = residual > BAD_PX
    # Swapped cameras spoil each other and may spoil the others: with few cameras try all.
    if bad.any() and len(residual) <= 4:
        bad = np.ones_like(bad)
    return float(np.minimum(residual, CAP_PX).sum()), bad


def _cycles(assigned: Ints) -> tuple[tuple[int, ...], ...]:
    out, seen = [], set()
    for first in range(len(assigned)):
        cycle, k = [], first
        while k not in seen and assigned[k] != k:
            seen.add(k)
            cycle.append(k)
            k = int(assigned[k])
        if cycle:
            out.append(tuple(cycle))
    return tuple(out)


def _reassigned(epoch: Epoch, assigned: Ints) -> Epoch:
    """Rows go to the reference camera that really took them."""
    camera = assigned[epoch.camera]
    pairs = np.stack([camera, epoch.place], axis=1)
    views, view = np.unique(pairs, axis=0, return_inverse=True)
    return replace(
        epoch,
        camera=camera,
        view=view.reshape(-1).astype(np.int64),
        view_camera=views[:, 0],
        view_place=views[:, 1],
    )


def _scales(epoch: Epoch, found: Consensus) -> tuple[tuple[int, float], ...]:
    out = []
    for carrier in np.unique(epoch.place_carrier):
        own = found.scale[epoch.place_carrier == carrier]
        own = own[np.isfinite(own)]
        if len(own) == 0:
            continue
        scale = float(np.median(own))
        name = epoch.carrier_names[int(carrier)]
        if not 1.0 / UNITS_RATIO < scale < UNITS_RATIO:
            raise InputError(
                "check-units",
                f"carrier {name!r} is {scale:.3g} times as large as in the reference",
                "use the target set of the reference; its coordinates are in millimetres",
            )
        if abs(scale - 1.0) > SCALE_SHARE:
            out.append((int(carrier), scale))
    return tuple(out)


def _resized(epoch: Epoch, carrier: int, scale: float) -> Epoch:
    target = epoch.reference.target.copy()
    own = epoch.target_carrier == carrier
    middle = target[own].mean(axis=0)
    target[own] = middle + scale * (target[own] - middle)
    return replace(epoch, reference=replace(epoch.reference, target=target))


def _swapped_ids(epoch: Epoch, found: Consensus) -> tuple[tuple[int, int], ...]:
    out: list[tuple[int, int]] = []
    for carrier in np.unique(epoch.target_carrier):
        own = np.flatnonzero(epoch.target_carrier == carrier)
        if len(own) < 3:
            continue
        seen = _in_carrier(epoch, found, int(carrier))[own]
        nominal = epoch.reference.target[own]
        apart = np.linalg.norm(nominal[:, None] - nominal[None], axis=2)
        np.fill_diagonal(apart, np.inf)
        spacing = apart.min(axis=1)
        residual = np.linalg.norm(seen - nominal, axis=1)
        strange = np.flatnonzero(residual > NEAR_SHARE * spacing)
        if len(strange) < 2 or len(strange) > len(own) // 2 + 1:
            continue
        out += _matched(seen, nominal, spacing, strange, own)
    return tuple(out)


def _matched(
    seen: Floats, nominal: Floats, spacing: Floats, strange: Ints, own: Ints
) -> list[tuple[int, int]]:
    """Strange targets that sit where others of them belong, as closed cycles only."""
    away = np.linalg.norm(seen[strange][:, None] - nominal[strange][None], axis=2)
    rows, places = linear_sum_assignment(away)
    near = away[rows, places] < NEAR_SHARE * spacing[strange[places]]
    goes = {
        int(strange[r]): int(strange[p]) for r, p, n in zip(rows, places, near, strict=True) if n
    }
    goes = {a: b for a, b in goes.items() if a != b}
    # A chain that does not close is a target that moved, not one that was taken for another.
    while set(goes) != set(goes.values()):
        goes = {a: b for a, b in goes.items() if a in goes.values() and b in goes}
    return [(int(own[a]), int(own[b])) for a, b in sorted(goes.items())]


def _in_carrier(epoch: Epoch, found: Consensus, carrier: int) -> Floats:
    """Intersected targets (m, 3) in the carrier's frame, median over its places."""
    stack = []
    for place in np.flatnonzero(epoch.place_carrier == carrier):
        view = int(np.flatnonzero(epoch.view_place == place)[0])
        arm = found.found_mm[place] - found.state.position[view]
        stack.append(arm @ found.state.attitude[view])
    values = np.stack(stack)
    out = np.full(values.shape[1:], np.nan)
    some = np.isfinite(values).all(axis=2).any(axis=0)
    out[some] = np.nanmedian(values[:, some], axis=0)
    # Targets that could not be intersected are taken to be where they belong.
    return np.where(np.isfinite(out), out, epoch.reference.target)


def _relabelled(epoch: Epoch, ids: tuple[tuple[int, int], ...]) -> Epoch:
    target = epoch.target.copy()
    for named, really in ids:
        target[epoch.target == named] = really
    return replace(epoch, target=target)
