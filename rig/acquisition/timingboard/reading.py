"""The LED timing board: what it is, and the picture of one read back into an instant.

A counter of ``bits`` bits advances every ``tick_us``. Two rows of LEDs show it in Gray code: the
upper row its bits, the lower row their opposites, so that each pair tells its own full brightness.
A camera adds up light over its exposure; how long each LED was lit during it says when the
exposure was, much finer than a tick. Four ArUco markers tell where the LEDs are.

Board frame: millimetres from the middle, x to the right, y down, as one looks at the board.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from common.errors import InputError
from geometry.arrays import Floats, frozen
from rig.acquisition.timingboard.graytime import solve_interval
from rig.acquisition.timingboard.soundness import Lamps, require_consistent, require_sound

if TYPE_CHECKING:
    import cv2

    from rig.acquisition.cameras.base import Image

_LEAST_MARKERS = 3
_INNER = 0.55
"""Share of an LED's radius that is read: blur and halo stay outside."""

_RING = (1.35, 1.75)
"""Radii, in LED radii, between which the dark board round an LED is read."""

_SATURATED = 0.985
_FAINT = 0.02
_FLOOR = 0.004
"""Standard deviation of a pair's share that no averaging removes: flare, rise times, coding."""

_LEAST_RADIUS_PX = 2.0
_REMEDY = "let the board face the camera, sharp, at least 300 pixels wide, markers uncovered"


@dataclass(frozen=True)
class TimingBoard:
    """A timing board as it was built. Lengths in millimetres.

    LED k of the upper row is lit while bit k of the counter's Gray code is 1, the one below it
    while it is 0. Bit 0 is leftmost. ``pitch_mm`` from LED to LED, ``row_gap_mm`` from row to row,
    ``marker_mm`` the side of a marker's black square. ``marker_ids`` of ``dictionary`` (a name of
    OpenCV's): top left, top right, bottom right, bottom left. ``tick_us`` is the time of a count.
    """

    bits: int = 16
    tick_us: float = 100.0
    pitch_mm: float = 7.0
    row_gap_mm: float = 10.0
    led_diameter_mm: float = 3.0
    marker_mm: float = 20.0
    dictionary: str = "DICT_4X4_50"
    marker_ids: tuple[int, int, int, int] = (40, 41, 42, 43)

    def __post_init__(self) -> None:
        lengths = (self.pitch_mm, self.row_gap_mm, self.led_diameter_mm, self.marker_mm)
        sound = (
            4 <= self.bits <= 32
            and all(0.0 < v < 1e4 for v in (*lengths, self.tick_us))
            and 2.0 * self.led_diameter_mm <= min(self.pitch_mm, self.row_gap_mm)
            and len(set(self.marker_ids)) == 4
            and self._quiet_mm >= self.marker_mm / 12.0
        )
        if not sound:
            raise InputError(
                "timing-board",
                "the description of the timing board makes no board",
                "give 4 to 32 bits, positive lengths, LEDs at least two diameters apart, four "
                "different markers at least six LED diameters large",
            )

    @property
    def _quiet_mm(self) -> float:
        """White between the strip of LEDs and the markers, beside them or above them.

        A detector wants half a module of a marker, a twelfth of its side, to see it apart.
        """
        beside = 0.25 * self.marker_mm - self.led_diameter_mm
        above = 0.25 * self.marker_mm - 0.5 * self.row_gap_mm - 2.0 * self.led_diameter_mm
        return max(beside, above)

    @property
    def range_us(self) -> float:
        """Time after which the counter begins again."""
        return self.tick_us * 2.0**self.bits

    @property
    def led_span_mm(self) -> float:
        """From the first to the last LED of a row."""
        return (self.bits - 1) * self.pitch_mm

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width and height of the board with its white border."""
        width = self.led_span_mm + 2.0 * self.led_diameter_mm + 3.0 * self.marker_mm
        return width, 3.0 * self.marker_mm

    @property
    def strip_mm(self) -> tuple[float, float]:
        """Width and height of the black strip in the middle that holds the LEDs."""
        return (
            self.led_span_mm + 4.0 * self.led_diameter_mm,
            self.row_gap_mm + 4.0 * self.led_diameter_mm,
        )

    @property
    def leds_mm(self) -> Floats:
        """Middles of the LEDs, (2, bits, 2): upper row, lower row."""
        x = (np.arange(self.bits) - (self.bits - 1) / 2.0) * self.pitch_mm
        rows = [np.stack([x, np.full(self.bits, y)], axis=1) for y in (-0.5, 0.5)]
        return np.asarray(np.array(rows) * np.array([1.0, self.row_gap_mm]))

    @property
    def marker_corners_mm(self) -> Floats:
        """Corners of the four markers, (4, 4, 2), each from its top left clockwise."""
        width, height = self.size_mm
        x, y = width / 2.0 - 0.75 * self.marker_mm, height / 2.0 - 0.75 * self.marker_mm
        middles = np.array([[-x, -y], [x, -y], [x, y], [-x, y]])
        square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        return frozen(middles[:, None] + 0.5 * self.marker_mm * square)

    def face(self, px_per_mm: float) -> NDArray[np.uint8]:
        """The printed board without its LEDs, grey 0 to 255, to print or to render."""
        import cv2

        width, height = (round(v * px_per_mm) for v in self.size_mm)
        picture = np.full((height, width), 255, dtype=np.uint8)
        middle = np.array([width, height]) / 2.0
        half = np.array(self.strip_mm) * px_per_mm / 2.0
        left, top = np.round(middle - half).astype(int)
        right, bottom = np.round(middle + half).astype(int)
        picture[top:bottom, left:right] = 10
        side = round(self.marker_mm * px_per_mm)
        for number, corners in zip(self.marker_ids, self.marker_corners_mm, strict=True):
            x, y = np.round(middle + corners[0] * px_per_mm).astype(int)
            picture[y : y + side, x : x + side] = cv2.aruco.generateImageMarker(
                aruco_dictionary(self.dictionary), number, side
            )
        return picture


@dataclass(frozen=True)
class BoardReading:
    """What a picture of the board says.

    ``mid_us``: the counter's time at the middle of the exposure, from 0 to the board's range;
    ``exposure_us``: its length; both with their standard deviations. ``residual`` is the rms by
    which the LEDs' shares miss what that exposure would give, ``shares`` (bits,) the shares.
    """

    mid_us: float
    exposure_us: float
    mid_sigma_us: float
    exposure_sigma_us: float
    residual: float
    shares: Floats


def aruco_dictionary(name: str) -> cv2.aruco.Dictionary:
    """OpenCV's dictionary of that name. Raises :class:`InputError` for an unknown one."""
    import cv2

    number = getattr(cv2.aruco, name, None)
    if not (name.startswith("DICT_") and isinstance(number, int)):
        problem = f"a dictionary of markers {name!r} is not known"
        raise InputError("marker-dictionary", problem, "give an OpenCV name such as DICT_4X4_50")
    return cv2.aruco.getPredefinedDictionary(number)


def read_board(
    picture: Image,
    board: TimingBoard,
    *,
    linear: bool | None = None,
    exposure_us: float | None = None,
) -> BoardReading:
    """Read the board in a picture (H, W) or (H, W, 3) RGB, 8 or 16 bits.

    ``linear`` says whether the values are proportional to light; without it 16-bit pictures
    are, and 8-bit ones follow the sRGB curve. ``exposure_us``, where known, is believed to 10 %
    and helps when the exposure is long. Raises :class:`InputError`: ``board-not-seen``,
    ``board-too-small``, ``board-saturated``, ``board-dark``, ``board-unclear``.
    """
    light = linear_light(picture, picture.dtype == np.uint16 if linear is None else linear)
    image_from_board = _locate(picture, board)
    shares, sigmas = _shares(light, board, image_from_board)
    nominal = None if exposure_us is None else exposure_us / board.tick_us
    found = solve_interval(shares, sigmas, nominal)
    require_consistent(found, shares, sigmas, nominal)
    tick = board.tick_us
    return BoardReading(
        found.middle_ticks * tick % board.range_us,
        found.length_ticks * tick,
        found.middle_sigma_ticks * tick,
        found.length_sigma_ticks * tick,
        found.residual,
        shares,
    )


def linear_light(picture: Image, linear: bool) -> NDArray[np.float32]:
    """Grey values proportional to light, 0 to 1, (H, W), of a picture."""
    top = float(np.iinfo(picture.dtype).max)
    codes = np.arange(int(top) + 1, dtype=np.float64) / top
    if not linear:
        codes = np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)
    light = codes.astype(np.float32)[picture]
    # An LED of one colour fills one channel only, so the fullest channel is the one to read.
    return light if light.ndim == 2 else np.ascontiguousarray(light.max(axis=2))


def _locate(picture: Image, board: TimingBoard) -> Floats:
    """The homography (3, 3) from board millimetres to pixels."""
    import cv2

    grey = picture if picture.ndim == 2 else picture.max(axis=2)
    if grey.dtype != np.uint8:
        grey = (grey >> 8).astype(np.uint8)
    settings = cv2.aruco.DetectorParameters()
    settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    detector = cv2.aruco.ArucoDetector(aruco_dictionary(board.dictionary), settings)
    corners, numbers, _ = detector.detectMarkers(grey)
    found = dict(
        zip(np.ravel(numbers).tolist() if numbers is not None else [], corners, strict=True)
    )
    known = [k for k, number in enumerate(board.marker_ids) if number in found]
    if len(known) < _LEAST_MARKERS:
        problem = f"{len(known)} of the timing board's 4 markers are seen"
        raise InputError("board-not-seen", problem, _REMEDY)
    there = np.concatenate([board.marker_corners_mm[k] for k in known])
    here = np.concatenate([found[board.marker_ids[k]].reshape(4, 2) for k in known])
    matrix, _ = cv2.findHomography(there, here.astype(np.float64), 0)
    if matrix is None or not np.isfinite(matrix).all():
        raise InputError("board-not-seen", "the timing board's markers make no plane", _REMEDY)
    return np.asarray(matrix, dtype=np.float64)


def _to_image(matrix: Floats, points_mm: Floats) -> Floats:
    homogeneous = np.concatenate([points_mm, np.ones((*points_mm.shape[:-1], 1))], axis=-1)
    mapped = homogeneous @ matrix.T
    return np.asarray(mapped[..., :2] / mapped[..., 2:])


def _shares(
    light: NDArray[np.float32], board: TimingBoard, matrix: Floats
) -> tuple[Floats, Floats]:
    """Share of the exposure for which each bit was 1, (bits,), and its standard deviation."""
    radius = board.led_diameter_mm / 2.0
    middles = board.leds_mm.reshape(-1, 2)
    scale = np.linalg.norm(
        _to_image(matrix, middles + np.array([radius, 0.0])) - _to_image(matrix, middles), axis=1
    )
    if scale.min() < _LEAST_RADIUS_PX:
        problem = f"the timing board's LEDs are {2.0 * scale.min():.1f} pixels wide"
        raise InputError("board-too-small", problem, "bring it nearer: 4 pixels and more")
    back = np.asarray(np.linalg.inv(matrix))
    level, error, around = np.array(
        [_level(light, (matrix, back), middle, radius) for middle in middles]
    ).T.reshape(3, 2, board.bits)
    full = level.sum(axis=0)
    if full.min() < _FAINT:
        problem = "LEDs of the timing board are dark in both rows"
        raise InputError("board-dark", problem, "switch it on, expose longer, check its LEDs")
    doubt = require_sound(Lamps(level, error, around))
    share = level[0] / full
    # Of a / (a + b) with errors of its own of a and b.
    sigma = np.hypot((1.0 - share) * error[0], share * error[1]) / full
    return share, np.sqrt(sigma**2 + _FLOOR**2 + doubt**2)


def _level(
    light: NDArray[np.float32], matrices: tuple[Floats, Floats], middle: Floats, radius: float
) -> tuple[float, float, float]:
    """Light of one LED above the board round it, its mean's standard error, and the board's."""
    reach = _RING[1] * radius
    corner = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    box = _to_image(matrices[0], middle + reach * corner)
    low = np.floor(box.min(axis=0)).astype(int)
    high = np.ceil(box.max(axis=0)).astype(int) + 1
    height, width = light.shape
    if (low < 0).any() or high[0] > width or high[1] > height:
        raise InputError("board-not-seen", "the timing board is cut by the frame", _REMEDY)
    y, x = np.mgrid[low[1] : high[1], low[0] : high[0]]
    back = _to_image(matrices[1], np.stack([x, y], axis=-1).astype(np.float64))
    distance = np.linalg.norm(back - middle, axis=-1) / radius
    patch = light[low[1] : high[1], low[0] : high[0]]
    inner = patch[distance < _INNER]
    ring = patch[(distance > _RING[0]) & (distance < _RING[1])]
    if len(inner) == 0 or len(ring) == 0:
        raise InputError("board-too-small", "the timing board is too small to read", _REMEDY)
    if np.median(inner) > _SATURATED:
        problem = "LEDs of the timing board are overexposed"
        raise InputError("board-saturated", problem, "dim the LEDs or expose less")
    error = np.hypot(inner.std() / np.sqrt(len(inner)), ring.std() / np.sqrt(len(ring)))
    return float(inner.mean() - np.median(ring)), float(error), float(np.median(ring))
