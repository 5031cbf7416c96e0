"""What can be printed and stood up: plates, markers, ring targets, scale bars.

A kind knows how its targets look and where they are on their carrier. All lengths are as they
should be; a sheet that came out of the printer at another scale says so in its ``ruler``.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from calibration.observations import Carrier, Distance, TargetSet
from calibration.targets.boards import MOST_SQUARES, AprilGrid, Chessboard, DotGrid
from calibration.targets.ringcodes import RingCodeFamily
from calibration.targets.rulers import Ruler, require
from geometry.arrays import Floats

UNKNOWN_MM = (float("nan"),) * 3
RING_INNER, RING_OUTER, RING_QUIET = 2.0, 3.0, 4.0
"""Radii of the code ring and of the clear space round it, in radii of the dot."""

DOT_RADIUS_MODULES, DOT_CLEAR_MODULES = 0.28, 0.44
"""The dot in a marker's middle and the disc that clears it, in modules: small enough that the
four modules it touches still read right."""


MOST_BACK_MM = 50.0


@dataclass(frozen=True)
class CharucoPlate:
    """A ChArUco plate: ``columns`` x ``rows`` squares, markers in the white ones.

    ``legacy``: the pattern of OpenCV before 4.6, which begins with a white square when the rows
    are even in number. ``inverted``: black and white exchanged. Its targets are the inner
    corners, numbered row by row as OpenCV does, in a frame with x right, y down, z into the
    plate, origin in the outer corner of the first square. ``sigma_mm`` (x, y, z). ``back_mm``: the
    thickness of a plate that shows the same corners on its back, in a mirror, as prints on film
    do; they are targets of their own, numbered alike.
    """

    name: str
    columns: int
    rows: int
    square_mm: float
    marker_mm: float
    dictionary: str
    first_marker: int = 0
    legacy: bool = False
    inverted: bool = False
    fixed: bool = False
    sigma_mm: tuple[float, float, float] = (0.02, 0.02, 0.1)
    ruler: Ruler | None = None
    back_mm: float | None = None

    def __post_init__(self) -> None:
        require(
            self.back_mm is None or 0.0 <= self.back_mm <= MOST_BACK_MM,
            "plate-back",
            f"plate {self.name!r} is {self.back_mm} mm thick",
            f"give back_mm, from its front to its back, as 0 to {MOST_BACK_MM:g} mm",
        )
        require(
            min(self.columns, self.rows) >= 3 and max(self.columns, self.rows) <= MOST_SQUARES,
            "plate-squares",
            f"plate {self.name!r} has {self.columns} x {self.rows} squares",
            f"give 3 to {MOST_SQUARES} squares each way",
        )
        require(
            np.isfinite(self.square_mm) and 0.0 < self.marker_mm < self.square_mm,
            "plate-size",
            f"plate {self.name!r} has markers of {self.marker_mm:g} mm in squares of "
            f"{self.square_mm:g} mm",
            "give millimetres, markers smaller than squares",
        )
        require(
            self.first_marker >= 0,
            "plate-markers",
            f"plate {self.name!r} begins with marker {self.first_marker}",
            "begin with 0 or more",
        )
        object.__setattr__(self, "dictionary", self.dictionary.upper())

    @property
    def scale(self) -> float:
        """Printed over drawn size."""
        return 1.0 if self.ruler is None else self.ruler.scale

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width and height of the pattern as drawn."""
        return self.columns * self.square_mm, self.rows * self.square_mm

    def is_white(self, column: int, row: int) -> bool:
        """Whether a square holds a marker."""
        shift = self.rows % 2 == 0 and self.legacy
        return (column + row + shift) % 2 == 1

    @property
    def marker_squares(self) -> tuple[tuple[int, int], ...]:
        """Column and row of each marker's square, in the order of their numbers."""
        return tuple(
            (c, r) for r in range(self.rows) for c in range(self.columns) if self.is_white(c, r)
        )

    @property
    def corner_grid_mm(self) -> Floats:
        """Inner corners (m, 2) as drawn."""
        x, y = np.meshgrid(np.arange(1, self.columns), np.arange(1, self.rows))
        return np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float64) * self.square_mm

    @property
    def ids(self) -> tuple[str, ...]:
        """Names of the corners."""
        return (*self.front_ids, *self.back_ids)

    @property
    def front_ids(self) -> tuple[str, ...]:
        """Names of the corners on the front."""
        count = (self.columns - 1) * (self.rows - 1)
        return tuple(f"{self.name}-{k:03d}" for k in range(count))

    @property
    def back_ids(self) -> tuple[str, ...]:
        """Names of the corners on the back, none when it shows none."""
        if self.back_mm is None:
            return ()
        return tuple(f"{name}-back" for name in self.front_ids)

    def carrier(self) -> Carrier:
        """The plate as calibration sees it, at its printed size."""
        grid = self.corner_grid_mm * self.scale
        sides = (0.0,) if self.back_mm is None else (0.0, self.back_mm)
        nominal = np.concatenate([np.insert(grid, 2, depth, axis=1) for depth in sides])
        sigma = np.broadcast_to(self.sigma_mm, nominal.shape)
        return Carrier(self.name, self.ids, nominal, sigma, self.fixed, len(sides) > 1)


@dataclass(frozen=True)
class TargetPlace:
    """One target of a carrier: its number and where it is (NaN: not known).

    ``sigma_mm`` is 0 for exact, infinite for not known at all.
    """

    number: int
    position_mm: tuple[float, float, float] = UNKNOWN_MM
    sigma_mm: tuple[float, float, float] = (float("inf"),) * 3


@dataclass(frozen=True)
class MarkerCarrier:
    """Square markers on something rigid. ``size_mm`` is the side of the black square.

    ``dot``: with a dot in the middle, which is then what is measured. ``corners``: the four
    corners of each marker are the targets (named ``-0`` to ``-3``, clockwise from the first)
    instead of its middle; places are still those of the middles, and the markers lie in planes
    of constant z with x to the right and y down.
    """

    name: str
    dictionary: str
    size_mm: float
    places: tuple[TargetPlace, ...]
    dot: bool = False
    corners: bool = False
    inverted: bool = False
    fixed: bool = False
    ruler: Ruler | None = None

    def __post_init__(self) -> None:
        _check_places(self.name, self.places)
        require(
            np.isfinite(self.size_mm) and self.size_mm > 0.0 and not (self.dot and self.corners),
            "markers",
            f"markers {self.name!r} have no size, or both dots and corners as targets",
            "give size_mm in millimetres, and dots or corners",
        )
        object.__setattr__(self, "dictionary", self.dictionary.upper())

    @property
    def scale(self) -> float:
        """Printed over drawn size."""
        return 1.0 if self.ruler is None else self.ruler.scale

    def id_of(self, number: int) -> str:
        """Name of the target in the middle of marker ``number``."""
        return f"{self.dictionary.removeprefix('DICT_').lower()}-{number:03d}"

    @property
    def ids(self) -> tuple[str, ...]:
        """Names of the targets."""
        middles = [self.id_of(p.number) for p in self.places]
        if not self.corners:
            return tuple(middles)
        return tuple(f"{m}-{k}" for m in middles for k in range(4))

    def carrier(self) -> Carrier:
        """The markers as calibration sees them."""
        nominal, sigma = _nominal(self.places, self.scale)
        if self.corners:
            half = self.size_mm * self.scale / 2.0
            offsets = half * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
            nominal = (nominal[:, None] + offsets).reshape(-1, 3)
            sigma = np.repeat(sigma, 4, axis=0)
        return Carrier(self.name, self.ids, nominal, sigma, self.fixed)


@dataclass(frozen=True)
class RingCarrier:
    """Ring-coded targets on something rigid: a stand round the face, or a scale bar.

    ``dot_radius_mm`` is that of the dot; the code ring reaches from 2 to 3 radii. ``inverted``:
    white on black. ``bar``: they stand in one line on a bar, at places along x.
    """

    name: str
    dot_radius_mm: float
    places: tuple[TargetPlace, ...]
    family: RingCodeFamily = field(default_factory=RingCodeFamily)
    inverted: bool = False
    fixed: bool = False
    bar: bool = False
    ruler: Ruler | None = None

    def __post_init__(self) -> None:
        _check_places(self.name, self.places)
        require(
            np.isfinite(self.dot_radius_mm) and self.dot_radius_mm > 0.0,
            "rings",
            f"the ring targets of {self.name!r} have dots of radius {self.dot_radius_mm:g} mm",
            "give dot_radius_mm in millimetres",
        )
        for place in self.places:
            self.family.word(place.number)
        line = np.array([p.position_mm for p in self.places])
        require(
            not self.bar or (len(line) >= 2 and bool(np.isfinite(line).all())),
            "bar",
            f"the scale bar {self.name!r} has fewer than two targets, or one without a place",
            "give each target of a bar its place along x",
        )

    @property
    def scale(self) -> float:
        """Printed over drawn size. Only a bar is one sheet; targets of a stand are placed."""
        return self.ruler.scale if self.ruler is not None and self.bar else 1.0

    def id_of(self, number: int) -> str:
        """Name of ring target ``number``."""
        return f"ring{self.family.bits}-{number:03d}"

    @property
    def ids(self) -> tuple[str, ...]:
        """Names of the targets."""
        return tuple(self.id_of(p.number) for p in self.places)

    def carrier(self) -> Carrier:
        """The targets as calibration sees them."""
        return Carrier(self.name, self.ids, *_nominal(self.places, self.scale), self.fixed)


CarrierKind = CharucoPlate | Chessboard | AprilGrid | DotGrid | MarkerCarrier | RingCarrier


def _check_places(name: str, places: tuple[TargetPlace, ...]) -> None:
    numbers = [p.number for p in places]
    require(
        len(numbers) > 0 and len(set(numbers)) == len(numbers) and min(numbers) >= 0,
        "carrier-numbers",
        f"carrier {name!r} has no targets, or two of one number",
        "give each target a number of its own, 0 or more",
    )


def _nominal(places: tuple[TargetPlace, ...], scale: float) -> tuple[Floats, Floats]:
    return np.array([p.position_mm for p in places]) * scale, np.array([p.sigma_mm for p in places])


@dataclass(frozen=True)
class TargetPlan:
    """A target set with what it looks like: all that printing and detection need."""

    name: str
    carriers: tuple[CarrierKind, ...]
    distances: tuple[Distance, ...] = ()

    def __post_init__(self) -> None:
        names = [c.name for c in self.carriers]
        require(
            len(set(names)) == len(names),
            "carrier-names",
            f"two carriers of target set {self.name!r} have one name",
            "give each carrier its own name",
        )
        families: dict[int, RingCodeFamily] = {}
        for carrier in self.carriers:
            if isinstance(carrier, RingCarrier):
                other = families.setdefault(carrier.family.bits, carrier.family)
                require(
                    other == carrier.family,
                    "ring-families",
                    f"carrier {carrier.name!r} uses another family of {other.bits}-bit codes",
                    "use one family for all targets of as many bits",
                )
        self._check_marker_numbers()
        self.target_set()

    def _check_marker_numbers(self) -> None:
        used: set[tuple[str, int]] = set()
        for carrier in self.carriers:
            mine = marker_numbers(carrier)
            clash = used & mine
            require(
                not clash,
                "marker-clash",
                f"carrier {carrier.name!r} shows marker {min(clash, default=('', 0))[1]} of "
                "another carrier",
                "begin its markers at another number or use another dictionary",
            )
            used |= mine

    def target_set(self) -> TargetSet:
        """The targets as calibration sees them, at their printed sizes."""
        carriers = tuple(c.carrier() for c in self.carriers)
        return TargetSet(self.name, carriers, self.distances)


def marker_numbers(carrier: CarrierKind) -> set[tuple[str, int]]:
    """Dictionary and number of every square marker a carrier shows."""
    if isinstance(carrier, CharucoPlate):
        first, count = carrier.first_marker, len(carrier.marker_squares)
        return {(carrier.dictionary, first + k) for k in range(count)}
    if isinstance(carrier, AprilGrid):
        numbers = range(carrier.first_tag, carrier.first_tag + carrier.columns * carrier.rows)
        return {(carrier.dictionary, number) for number in numbers}
    if isinstance(carrier, MarkerCarrier):
        return {(carrier.dictionary, p.number) for p in carrier.places}
    return set()
