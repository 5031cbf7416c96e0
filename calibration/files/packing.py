"""Arrays of numbers as text: bit for bit, and small."""

from __future__ import annotations

import base64
import binascii
import zlib

import numpy as np

from calibration.adjustment.camera import INTERIOR, PER_CAMERA
from calibration.adjustment.covariance import Covariance
from common.errors import InputError
from common.files.strict import StrictModel
from geometry.arrays import Floats

LARGEST_ROWS = 20_000

FIRST_COUNT = 15
"""Parameters of a camera in files of before there were rational and fisheye lenses."""

FIRST_INTERIOR = 9


class PackedCovariance(StrictModel):
    """A covariance: counts, target indices, and packed arrays.

    ``core`` is the lower triangle of a symmetric matrix, row by row; ``effect`` and ``own`` are
    as in :class:`Covariance`. Packed: little-endian doubles, deflated, base64. ``per_camera`` is
    the number of each camera's parameters: :data:`FIRST_COUNT` where a file does not tell.
    """

    camera_count: int
    pose_count: int
    kept: list[int]
    eliminated: list[int]
    core: str
    effect: str
    own: str
    per_camera: int = FIRST_COUNT


def pack(values: Floats) -> str:
    """An array as text."""
    return base64.b64encode(zlib.compress(values.astype("<f8").tobytes(), 6)).decode("ascii")


def unpack(text: str, count: int, source: str) -> Floats:
    """``count`` numbers from text; raises :class:`InputError` when there are not as many."""
    problem = InputError(
        "covariance",
        f"{source}: its covariance is damaged",
        "give the file as it was written, or calibrate anew",
    )
    try:
        # One byte more than fits shows a text that would unfold without end.
        data = zlib.decompressobj().decompress(base64.b64decode(text, validate=True), 8 * count + 1)
    except (zlib.error, binascii.Error) as error:
        raise problem from error
    if len(data) != 8 * count:
        raise problem
    values = np.frombuffer(data, "<f8").astype(np.float64)
    if not np.isfinite(values).all():
        raise problem
    return values


def compact(covariance: Covariance) -> Covariance:
    """The same covariance of cameras and targets in whichever form is smaller.

    Either as it is, with the carriers' places as go-betweens, or as one matrix of cameras and
    targets. Both give the same numbers to rounding.
    """
    size = PER_CAMERA * covariance.camera_count + 3 * covariance.target_count
    rank = len(covariance.core)
    if rank * (rank + 1) // 2 + covariance.effect.size < size * (size + 1) // 2:
        core = covariance.core
        return Covariance(
            covariance.camera_count,
            covariance.pose_count,
            covariance.kept,
            covariance.eliminated,
            0.5 * (core + core.T),
            covariance.effect,
            covariance.own,
        )
    joint = covariance.joint()
    none = np.zeros((0, 3, 3))
    targets = np.arange(covariance.target_count)
    return Covariance(
        covariance.camera_count,
        0,
        targets,
        targets[:0],
        0.5 * (joint + joint.T),
        np.zeros((0, size)),
        none,
    )


def packed(covariance: Covariance) -> dict[str, object]:
    """A compact covariance as the file has it."""
    core = covariance.core
    return {
        "camera_count": covariance.camera_count,
        "pose_count": covariance.pose_count,
        "kept": covariance.kept.tolist(),
        "eliminated": covariance.eliminated.tolist(),
        "core": pack(core[np.tril_indices(len(core))]),
        "effect": pack(covariance.effect),
        "own": pack(covariance.own),
        "per_camera": PER_CAMERA,
    }


def unpacked(model: PackedCovariance, cameras: int, targets: int, source: str) -> Covariance:
    """The covariance of a file with so many cameras and targets."""
    kept, eliminated = np.array(model.kept, np.int64), np.array(model.eliminated, np.int64)
    rank = model.per_camera * cameras + 6 * model.pose_count + 3 * len(kept)
    listed = np.sort(np.concatenate([kept, eliminated]))
    if (
        model.camera_count != cameras
        or model.pose_count < 0
        or model.per_camera not in (FIRST_COUNT, PER_CAMERA)
        or rank > LARGEST_ROWS
        or not np.array_equal(listed, np.arange(targets))
    ):
        raise InputError(
            "covariance",
            f"{source}: its covariance is not that of its cameras and targets",
            "give the file as it was written, or calibrate anew",
        )
    core = np.zeros((rank, rank))
    core[np.tril_indices(rank)] = unpack(model.core, rank * (rank + 1) // 2, source)
    core = core + np.tril(core, -1).T
    effect = unpack(model.effect, 3 * len(eliminated) * rank, source)
    effect = effect.reshape(3 * len(eliminated), rank)
    if model.per_camera == FIRST_COUNT:
        core, effect = _widened(core, effect, cameras)
    own = unpack(model.own, 9 * len(eliminated), source)
    return Covariance(
        cameras,
        model.pose_count,
        kept,
        eliminated,
        core,
        effect,
        own.reshape(-1, 3, 3),
    )


def _widened(core: Floats, effect: Floats, cameras: int) -> tuple[Floats, Floats]:
    """Core (r, r) and effect (e, r) with the parameters that cameras had not at first."""
    own = np.r_[0:FIRST_INTERIOR, INTERIOR:PER_CAMERA]
    first = (PER_CAMERA * np.arange(cameras)[:, None] + own).ravel()
    rest = np.arange(len(core) - len(first)) + PER_CAMERA * cameras
    places, size = np.concatenate([first, rest]), PER_CAMERA * cameras + len(rest)
    wide, wide_effect = np.zeros((size, size)), np.zeros((len(effect), size))
    wide[np.ix_(places, places)], wide_effect[:, places] = core, effect
    return wide, wide_effect
