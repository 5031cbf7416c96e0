"""What calibration is made of: targets on rigid carriers, and where cameras saw them.

A carrier is something rigid with targets on it: a ChArUco plate that is held in front of the
cameras in many places, a scale bar, or the stand of ring targets round the subject that never
moves. A frame is one instant at which all cameras took a picture. Carriers that are ``fixed``
stand at one place in all frames; the others have a pose of their own in each frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats, Ints, frozen


def _require(condition: bool, detail: str, problem: str, remedy: str) -> None:
    if not condition:
        raise InputError(detail, problem, remedy)


@dataclass(frozen=True, eq=False)
class Carrier:
    """A rigid thing with targets on it.

    ``ids`` (m,) names its targets, unique within a target set. ``nominal_mm`` (m, 3) where they
    are in the carrier's own frame; ``sigma_mm`` (m, 3) how well that is known: 0 is exact,
    infinite is not at all (then the nominal value is only a start, and may be NaN). ``two_sided``:
    it shows targets to either side, so cameras may see it from behind.
    """

    name: str
    ids: tuple[str, ...]
    nominal_mm: Floats
    sigma_mm: Floats
    fixed: bool = False
    two_sided: bool = False

    def __post_init__(self) -> None:
        shape = (len(self.ids), 3)
        nominal, sigma = frozen(self.nominal_mm), frozen(self.sigma_mm)
        _require(
            len(self.ids) > 0 and len(set(self.ids)) == len(self.ids),
            "carrier-ids",
            f"carrier {self.name!r} has no targets, or two of one id",
            "give each target its own id",
        )
        _require(
            nominal.shape == shape and sigma.shape == shape and bool((sigma >= 0.0).all()),
            "carrier-shape",
            f"carrier {self.name!r} does not have three coordinates and sigmas for each target",
            "give nominal_mm and sigma_mm as (targets, 3), sigmas of zero or more",
        )
        _require(
            bool((np.isfinite(nominal) | np.isinf(sigma)).all()),
            "carrier-coordinates",
            f"carrier {self.name!r} has coordinates that are not finite",
            "measure them, or mark them as unknown with an infinite sigma",
        )
        object.__setattr__(self, "nominal_mm", nominal)
        object.__setattr__(self, "sigma_mm", sigma)


@dataclass(frozen=True)
class Distance:
    """A measured distance of two targets of one carrier, such as a scale bar's."""

    first: str
    second: str
    length_mm: float
    sigma_mm: float

    def __post_init__(self) -> None:
        _require(
            self.first != self.second
            and np.isfinite(self.length_mm)
            and self.length_mm > 0.0
            and self.sigma_mm > 0.0,
            "distance",
            f"the distance {self.first}-{self.second} of {self.length_mm:g} mm cannot be",
            "give two targets, a positive length and a positive sigma",
        )


@dataclass(frozen=True, eq=False)
class TargetSet:
    """All carriers that a calibration or a check uses, and the distances measured on them."""

    name: str
    carriers: tuple[Carrier, ...]
    distances: tuple[Distance, ...] = ()

    def __post_init__(self) -> None:
        ids = [i for carrier in self.carriers for i in carrier.ids]
        _require(
            len(ids) > 0,
            "targets-ids",
            f"target set {self.name!r} has no targets",
            "add a plate, markers or ring targets",
        )
        _require(
            len(set(ids)) == len(ids),
            "targets-ids",
            f"two targets of target set {self.name!r} have one id",
            "give each target its own id",
        )
        unknown = [d for d in self.distances if not {d.first, d.second} <= set(ids)]
        _require(
            not unknown,
            "targets-distance",
            f"target set {self.name!r} has a distance between targets that it has not",
            "name targets of the set",
        )

    @property
    def ids(self) -> tuple[str, ...]:
        """Names of all targets, carrier by carrier: the order of :attr:`Observations.target`."""
        return tuple(i for carrier in self.carriers for i in carrier.ids)

    @property
    def carrier_of(self) -> Ints:
        """Index of the carrier of each target, (targets,)."""
        counts = [len(carrier.ids) for carrier in self.carriers]
        return np.repeat(np.arange(len(counts)), counts)


@dataclass(frozen=True, eq=False)
class Observations:
    """Where targets were seen, one row per target and picture.

    ``camera``, ``frame``, ``target`` (n,) index ``cameras``, ``frames`` and ``targets.ids``;
    ``pixel`` (n, 2) with pixel centres at integers, ``sigma_px`` (n, 2) as stated by whoever
    measured it. ``image_size_px`` (cameras, 2) width and height. ``blur_px`` (n,) sigma of the
    blur of each target's edges, NaN where it is not known.
    """

    targets: TargetSet
    cameras: tuple[str, ...]
    image_size_px: Ints
    frames: tuple[str, ...]
    camera: Ints
    frame: Ints
    target: Ints
    pixel: Floats
    sigma_px: Floats
    blur_px: Floats = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        count = len(self.pixel)
        indices: Sequence[tuple[Ints, int]] = (
            (self.camera, len(self.cameras)),
            (self.frame, len(self.frames)),
            (self.target, len(self.targets.ids)),
        )
        for index, size in indices:
            _require(
                index.shape == (count,)
                and (count == 0 or (int(index.min()) >= 0 and int(index.max()) < size)),
                "observations",
                "observations name a camera, frame or target that is not in their lists",
                "report this fault",
            )
        _require(
            self.pixel.shape == (count, 2)
            and self.sigma_px.shape == (count, 2)
            and bool(np.isfinite(self.pixel).all())
            and bool((self.sigma_px > 0.0).all()),
            "observations",
            "observations need two finite pixels and positive sigmas each",
            "report this fault",
        )
        blur = self.blur_px if len(self.blur_px) == count else np.full(count, np.nan)
        object.__setattr__(self, "pixel", frozen(self.pixel))
        object.__setattr__(self, "sigma_px", frozen(self.sigma_px))
        object.__setattr__(self, "blur_px", frozen(blur))

    def subset(self, rows: Ints) -> Observations:
        """Some of the rows, cameras, frames and targets kept."""
        return Observations(
            self.targets,
            self.cameras,
            self.image_size_px,
            self.frames,
            self.camera[rows],
            self.frame[rows],
            self.target[rows],
            self.pixel[rows],
            self.sigma_px[rows],
            self.blur_px[rows],
        )

    def camera_blur_px(self) -> Floats:
        """Median blur of each camera's targets (cameras,); NaN where it is not known."""
        out = np.full(len(self.cameras), np.nan)
        known = np.isfinite(self.blur_px)
        for k in np.unique(self.camera[known]):
            out[k] = np.median(self.blur_px[known & (self.camera == k)])
        return out
