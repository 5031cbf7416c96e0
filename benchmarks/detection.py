"""How exactly and how fast targets are found, beside plain OpenCV on the same pictures.

    python -m benchmarks.detection [--out docs/how-to/targets.md]

Rendered pictures of 1200 x 900 pixels: blur 0.5 to 1.5 px (sigma, the pixel's own comes on top),
noise of 2 grey levels of 255, black at 30 and white at 220, tilt 0 to 60 degrees, with and without
radial distortion (k1 = -0.2 at a focal length of 1600 px). Roll and sub-pixel place are drawn anew
for each picture. Errors are along one axis, found less true. One core.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

os.environ.update(
    dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
)

import numpy as np
from held_patterns import placed_carrier, true_pixels
from plain_opencv import plain_markers
from scipy.spatial.transform import Rotation

from calibration.detection import opencv
from calibration.detection.finding import find_targets
from calibration.targets.kinds import (
    CarrierKind,
    CharucoPlate,
    MarkerCarrier,
    RingCarrier,
    TargetPlace,
    TargetPlan,
)
from calibration.targets.rendering import photographed, render
from calibration.targets.ringcodes import RingCodeFamily
from geometry.arrays import Floats
from geometry.camera import Body, Camera

BLURS_PX, TILTS_DEG, DISTORTIONS = (0.5, 1.0, 1.5), (0.0, 40.0, 60.0), (0.0, -0.2)
NOISE, BLACK, WHITE = 2.0, 30.0, 220.0
LIMITS_PX = {"ChArUco corners": 0.025}
CENTRE_LIMIT_PX, BIAS_LIMIT_PX, TIME_LIMIT = 0.02, 0.005, 1.2
START, END = "<!-- accuracy -->", "<!-- end of accuracy -->"
_REPEATS = 7


@dataclass(frozen=True, eq=False)
class Shot:
    """One picture and the errors (n, 2) of both ways in it; ``count`` targets are in it."""

    kind: str
    blur_px: float
    tilt_deg: float
    count: int
    own: Floats
    plain: Floats


def camera(size: tuple[int, int], focal_px: float, k1: float) -> Camera:
    """A camera whose pictures are of ``size``."""
    terms = np.array([k1, 0.0, 0.0, 0.0, 0.0])
    body = Body(np.full(3, 50.0), np.zeros(3))
    return Camera("c", size, 0.005, focal_px * 0.005, 8.0, 0.01, 100.0, body, distortion=terms)


def grid(first: int, step_mm: float) -> tuple[TargetPlace, ...]:
    """Sixteen targets in rows of four."""
    sigma = (0.0, 0.0, 0.0)
    return tuple(
        TargetPlace(first + k, (k % 4 * step_mm, k // 4 * step_mm, 0.0), sigma) for k in range(16)
    )


def kinds() -> dict[str, CarrierKind]:
    """What is measured."""
    return {
        "ChArUco corners": CharucoPlate("plate", 8, 6, 20.0, 15.0, "DICT_5X5_100"),
        "marker centres (dot)": MarkerCarrier("m", "DICT_4X4_50", 20.0, grid(0, 27.0), dot=True),
        "ring centres, 12 bit": RingCarrier("r", 2.5, grid(1, 21.0)),
        "ring centres, 14 bit": RingCarrier("s", 2.5, grid(1, 21.0), RingCodeFamily(14)),
    }


def plain(kind: CarrierKind, picture: np.ndarray, truth: dict[str, Floats]) -> Floats:
    """Errors of what OpenCV gives by itself: corners, crossing diagonals, or blob centroids."""
    if isinstance(kind, CharucoPlate):
        squares = kind.columns, kind.rows
        numbers, places = opencv.plain_charuco(
            picture, squares, kind.square_mm, kind.marker_mm, kind.dictionary
        )
        return np.array(
            [p - truth[kind.ids[n]] for n, p in zip(numbers, places, strict=True)]
        ).reshape(-1, 2)
    if isinstance(kind, MarkerCarrier):
        markers = plain_markers(picture, kind.dictionary)
        pairs = zip(markers.ids.tolist(), markers.corners_px, strict=True)
        return np.array(
            [crossing(c) - truth[kind.id_of(n)] for n, c in pairs if kind.id_of(n) in truth]
        ).reshape(-1, 2)
    _, _, centroids = opencv.components(picture, 101, 8.0, dark=True)
    true = np.array(list(truth.values()))
    away = centroids[:, None] - true[None]
    nearest = np.argmin(np.linalg.norm(away, axis=2), axis=0)
    off = centroids[nearest] - true
    return np.asarray(off[np.linalg.norm(off, axis=1) < 2.0])


def crossing(corners: Floats) -> Floats:
    """Where the diagonals of four corners cross."""
    a, b = corners[2] - corners[0], corners[3] - corners[1]
    t = np.linalg.solve(np.stack([a, -b], axis=1), corners[1] - corners[0])
    return np.asarray(corners[0] + t[0] * a)


def shots() -> Iterator[Shot]:
    """All pictures, measured both ways."""
    rng = np.random.default_rng(7)
    for name, kind in kinds().items():
        nominal = kind.carrier().nominal_mm
        middle = (nominal.min(axis=0) + nominal.max(axis=0)) / 2.0
        for blur in BLURS_PX:
            for tilt in TILTS_DEG:
                for k1 in DISTORTIONS:
                    view = camera((1200, 900), 1600.0, k1)
                    roll = rng.uniform(-20.0, 20.0)
                    turn = Rotation.from_euler("zyx", [roll, 5.0, tilt], degrees=True).as_matrix()
                    at = np.array([*rng.uniform(-0.5, 0.5, 2), 330.0]) - turn @ middle
                    grey = render(view, placed_carrier(kind, turn, at), blur, BLACK, WHITE, 150.0)
                    picture = photographed(grey, NOISE, int(rng.integers(2**31)))
                    truth = true_pixels(kind, view, turn, at)
                    found = find_targets(picture, TargetPlan("set", (kind,)), explain=False)
                    own = [found.pixel[k] - truth[i] for k, i in enumerate(found.ids)]
                    yield Shot(
                        name,
                        blur,
                        tilt,
                        len(truth),
                        np.reshape(own, (-1, 2)),
                        plain(kind, picture, truth),
                    )


def rms(errors: Floats) -> float:
    """Root mean square along one axis."""
    return float(np.sqrt((errors**2).mean())) if len(errors) else float("nan")


def bias(errors: Floats) -> float:
    """The larger of the two mean errors."""
    return float(np.abs(errors.mean(axis=0)).max()) if len(errors) else float("nan")


def accuracy_table(measured: list[Shot]) -> list[str]:
    """Markdown: all pictures of a kind together, then the worst condition of each."""
    rows = [
        "| target | found | rms px | bias px | worst condition: rms px | bias px | limits "
        "| OpenCV: found | rms px | bias px |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name in kinds():
        mine = [s for s in measured if s.kind == name]
        own, other = (np.concatenate([getattr(s, k) for s in mine]) for k in ("own", "plain"))
        count = sum(s.count for s in mine)
        cells = {
            (b, t): np.concatenate([s.own for s in mine if (s.blur_px, s.tilt_deg) == (b, t)])
            for b in BLURS_PX
            for t in TILTS_DEG
        }
        (blur, tilt), worst = max(cells.items(), key=lambda item: rms(item[1]))
        rows.append(
            f"| {name} | {len(own)} of {count} | {rms(own):.4f} | {bias(own):.4f} "
            f"| {rms(worst):.4f} (blur {blur:g}, tilt {tilt:g} deg) "
            f"| {max(map(bias, cells.values())):.4f} "
            f"| {LIMITS_PX.get(name, CENTRE_LIMIT_PX):g}, {BIAS_LIMIT_PX:g} "
            f"| {len(other)} | {rms(other):.4f} | {bias(other):.4f} |"
        )
    return rows


def speed_table() -> list[str]:
    """Markdown: seconds of CPU for a plate in a picture of 24 megapixels."""
    plate = CharucoPlate("plate", 14, 10, 20.0, 15.0, "DICT_5X5_250")
    view = camera((6000, 4000), 13333.0, 0.0)
    turn = Rotation.from_euler("zyx", [5.0, 10.0, 15.0], degrees=True).as_matrix()
    at = np.array([0.0, 0.0, 720.0]) - turn @ np.array([140.0, 100.0, 0.0])
    grey = render(view, placed_carrier(plate, turn, at), 0.8, BLACK, WHITE)
    picture, truth = photographed(grey, NOISE, 1), true_pixels(plate, view, turn, at)
    plan, squares = TargetPlan("set", (plate,)), (plate.columns, plate.rows)
    own_s, plain_s = [], []
    for _ in range(_REPEATS):
        start = time.process_time()
        numbers, places = opencv.plain_charuco(picture, squares, 20.0, 15.0, plate.dictionary)
        middle = time.process_time()
        found = find_targets(picture, plan)
        own_s.append(time.process_time() - middle)
        plain_s.append(middle - start)
    own = np.array([found.pixel[k] - truth[i] for k, i in enumerate(found.ids)])
    other = np.array([p - truth[plate.ids[n]] for n, p in zip(numbers, places, strict=True)])
    a, b = float(np.median(own_s)), float(np.median(plain_s))
    return [
        "| 24 megapixels, 14 x 10 squares | corners | rms px | s | of OpenCV's time | limit |",
        "|---|---|---|---|---|---|",
        f"| this package | {len(own)} | {rms(own):.4f} | {a:.2f} | {a / b:.2f} | {TIME_LIMIT:g} |",
        f"| plain OpenCV | {len(other)} | {rms(other):.4f} | {b:.2f} | 1 | |",
    ]


def write_between_marks(path: Path, lines: list[str]) -> None:
    """Put lines between the marks of a page."""
    text = path.read_text("utf-8")
    head, rest = text.split(START, 1)
    tail = rest.split(END, 1)[1]
    path.write_text("\n".join([head + START, "", *lines, "", END]) + tail, "utf-8")


def main() -> None:
    """Measure, print, and write into a page when one is given."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0] if __doc__ else "")
    parser.add_argument("--out", type=Path, help="page with marks to write the tables between")
    arguments = parser.parse_args()
    measured = []
    for shot in shots():
        measured.append(shot)
        print(
            f"{shot.kind:22} blur {shot.blur_px:3.1f} tilt {shot.tilt_deg:2.0f}: "
            f"{len(shot.own)}/{shot.count} {rms(shot.own):.4f} | {rms(shot.plain):.4f}",
            flush=True,
        )
    lines = [f"OpenCV {opencv.version()}.", "", *accuracy_table(measured), "", *speed_table()]
    print("\n".join(lines))
    if arguments.out:
        write_between_marks(arguments.out, lines)


if __name__ == "__main__":
    main()
