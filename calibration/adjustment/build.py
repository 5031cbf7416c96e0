"""From observations and start values to a network and the state it starts from."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calibration.adjustment.camera import CalibratedCamera
from calibration.adjustment.finite import finite_rows
from calibration.adjustment.initialisation.carrierposes import Placing
from calibration.adjustment.initialisation.resection import RigidTransform
from calibration.adjustment.initialisation.views import Placements, spread_rank
from calibration.adjustment.model import ObservationIndex
from calibration.adjustment.network import Lengths, Network, Priors
from calibration.adjustment.options import CalibrationOptions
from calibration.adjustment.state import State, camera_arrays
from calibration.observations import Observations
from common.errors import InputError
from geometry.arrays import Bools, Floats, Ints

LOOSE_ROTATION_RAD = 1.0
"""Turns of a bar about itself are kept near their start by this; nothing else could."""


@dataclass(frozen=True, eq=False)
class Start:
    """A network, its start, and which rows of the observations it uses, in its order."""

    network: Network
    state: State
    rows: Ints
    placements: Placements
    scale: str


def camera_poses(cameras: tuple[CalibratedCamera, ...]) -> dict[int, RigidTransform]:
    """World to camera of given cameras."""
    return {
        k: RigidTransform(
            c.pose.rotation_rig_to_camera,
            -c.pose.rotation_rig_to_camera @ c.pose.position_rig_mm,
        )
        for k, c in enumerate(cameras)
    }


def usable_rows(observations: Observations, placements: Placements, placing: Placing) -> Bools:
    """Rows that can be adjusted: their carrier has a place and their target coordinates."""
    placed = np.array([p is not None for p in placing.placed])
    known = finite_rows(placing.target_mm)
    sigma = np.concatenate([c.sigma_mm for c in observations.targets.carriers])
    open_target = np.isinf(sigma).any(axis=1)
    rows = placed[placements.of_row] & known[observations.target]
    # A target of unknown place needs two rays; of a fixed carrier, from two cameras.
    pairs = np.stack([observations.target, observations.camera, placements.of_row], axis=1)
    rays = np.bincount(np.unique(pairs[rows], axis=0)[:, 0], minlength=len(known))
    rows &= ~open_target[observations.target] | (rays[observations.target] >= 2)
    counts = np.bincount(placements.of_row[rows], minlength=len(placed))
    return np.asarray(rows & (counts[placements.of_row] >= 3))


def build(
    observations: Observations,
    cameras: tuple[CalibratedCamera, ...],
    placements: Placements,
    placing: Placing,
    options: CalibrationOptions,
) -> Start:
    """The network of all usable rows, sorted by camera, and the state to start from."""
    usable = np.flatnonzero(usable_rows(observations, placements, placing))
    rows = usable[np.argsort(observations.camera[usable], kind="stable")]
    observed = ObservationIndex(
        observations.camera[rows], placements.of_row[rows], observations.target[rows]
    )
    state = _state(cameras, placing)
    seen = np.bincount(observed.target, minlength=len(state.target)) > 0
    pose_sigma = _pose_sigma(observations, placements, placing, observed)
    lengths = _lengths(observations, seen)
    scale = _scale_source(observations, lengths, options)
    network = Network(
        observed,
        observations.pixel[rows],
        observations.sigma_px[rows],
        _priors(observations, cameras, state, seen, options),
        pose_sigma,
        lengths,
        datum=options.reference_poses is None,
        datum_scale=scale == "start",
        camera_names=observations.cameras,
    )
    return Start(network, state, rows, placements, scale)


def _state(cameras: tuple[CalibratedCamera, ...], placing: Placing) -> State:
    nowhere = RigidTransform(np.eye(3), np.zeros(3))
    placed = [p or nowhere for p in placing.placed]
    return State(
        *camera_arrays(cameras),
        np.stack([p.translation_mm for p in placed]),
        np.stack([p.rotation for p in placed]),
        np.nan_to_num(placing.target_mm),
    )


def _priors(
    observations: Observations,
    cameras: tuple[CalibratedCamera, ...],
    state: State,
    seen: Bools,
    options: CalibrationOptions,
) -> Priors:
    sigma = np.concatenate([c.sigma_mm for c in observations.targets.carriers])
    nominal = np.concatenate([c.nominal_mm for c in observations.targets.carriers])
    # Nothing observes an unseen target of unknown place; held, it stays out of everything.
    sigma = np.where(np.isinf(sigma) & ~seen[:, None], 0.0, sigma)
    nominal = np.where(np.isinf(sigma) | ~np.isfinite(nominal), state.target, nominal)
    interior_sigma = np.stack(
        [options.model_of(c.name).sigmas(c.interior, c.image_size_px) for c in cameras]
    )
    exterior = np.full((len(cameras), 6), np.inf)
    known = options.reference_poses
    centre, rotation = state.centre, state.rotation
    if known is not None:
        exterior[:, :3] = known.position_sigma_mm
        exterior[:, 3:] = np.radians(known.rotation_sigma_deg)
        given = {c.name: c for c in options.start}
        _, centre, rotation = camera_arrays(tuple(given[c.name] for c in cameras))
    return Priors(state.interior, interior_sigma, centre, rotation, exterior, nominal, sigma)


def _pose_sigma(
    observations: Observations, placements: Placements, placing: Placing, observed: ObservationIndex
) -> Floats:
    """Sigmas (k, 6) of the places: held, free, or with turns that nothing observes tied."""
    carrier_of = observations.targets.carrier_of
    out = np.full((len(placing.placed), 6), np.inf)
    out[np.setdiff1d(np.arange(len(out)), observed.pose)] = 0.0
    for k, carrier in enumerate(observations.targets.carriers):
        places = np.intersect1d(np.flatnonzero(placements.carrier == k), observed.pose)
        own = (carrier_of == k) & finite_rows(placing.target_mm)
        if spread_rank(placing.target_mm[own]) < 2:
            out[places, 3:] = LOOSE_ROTATION_RAD
        if len(places) and np.isinf(carrier.sigma_mm).any(axis=1).all():
            # A carrier of which nothing is certain takes its frame from one of its places.
            held = [p for p in places if placing.held[p]]
            out[held[0] if held else places[0]] = 0.0
    return out


def _lengths(observations: Observations, seen: Bools) -> Lengths:
    """The measured distances of which both ends were seen."""
    index = {name: k for k, name in enumerate(observations.targets.ids)}
    known = [
        (index[d.first], index[d.second], d.length_mm, d.sigma_mm)
        for d in observations.targets.distances
        if seen[index[d.first]] and seen[index[d.second]]
    ]
    table = np.array(known, dtype=np.float64).reshape(-1, 4)
    return Lengths(
        table[:, 0].astype(np.int64), table[:, 1].astype(np.int64), table[:, 2], table[:, 3]
    )


def _scale_source(observations: Observations, lengths: Lengths, options: CalibrationOptions) -> str:
    """Where the size of everything comes from."""
    nominal = any(finite_rows(c.sigma_mm).sum() >= 2 for c in observations.targets.carriers)
    if len(lengths.length_mm) and nominal:
        return "distances and nominal coordinates"
    if len(lengths.length_mm):
        return "distances"
    if nominal:
        return "nominal coordinates"
    if options.reference_poses is not None:
        return "reference poses"
    if options.start:
        return "start"
    raise InputError(
        "calibration-scale",
        "nothing tells the size: no measured distance, no nominal coordinates, no start cameras",
        "add a scale bar with its length, or a plate with known coordinates",
    )


def some_rows(network: Network, keep: Bools) -> Network:
    """The network with some of its image points (n,) only."""
    observed = network.observed
    return replace(
        network,
        observed=ObservationIndex(
            observed.camera[keep], observed.pose[keep], observed.target[keep]
        ),
        pixel=network.pixel[keep],
        sigma_px=network.sigma_px[keep],
    )
