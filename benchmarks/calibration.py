"""How good calibrations and their stated uncertainties are, by simulation, and how fast.

    python -m benchmarks.calibration [--draws 1000] [--processes 1]
        [--write docs/explanation/calibration.md]

Fixed seeds. A thousand draws take ten minutes of one core; ``--draws 0`` measures speed alone.
"""

from __future__ import annotations

import argparse
import os
import time
from dataclasses import dataclass
from pathlib import Path

os.environ.update(
    dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
)

import numpy as np
from synthetic_scenes import Scene, bars, face_rig, stand, turned

from benchmarks.draws import Draws, drawn
from benchmarks.pages import table, write_between
from calibration.adjustment.initialisation.finding import find_start
from calibration.adjustment.initialisation.resection import RigidTransform
from calibration.adjustment.levenberg import LossOptions
from calibration.adjustment.options import FIXED, CalibrationOptions, InteriorModel
from calibration.adjustment.stages import adjust_in_stages
from calibration.observations import TargetSet
from geometry.arrays import Floats

SIGMA_PX = 0.05
REPEATS = 9
REFERENCE_SIZE = 1500


@dataclass(frozen=True)
class Speed:
    """Best of several runs, seconds."""

    unknowns: int
    residuals: int
    iterations: int
    adjust_s: float
    covariance_s: float
    reference_s: float


def speed() -> Speed:
    """9 cameras x 300 targets of unknown place: f, cx, cy, k1, k2 and poses free."""
    carrier, points = stand(300, 11)
    rig = face_rig(9)
    places = ((RigidTransform(np.eye(3), np.zeros(3)),),)
    inside = 0.75 * points
    targets = TargetSet("300", (carrier,), bars(carrier, inside))
    scene = Scene(rig, targets, inside, places)
    rng = np.random.default_rng(12)
    rough = tuple(turned(c, 3.0 * rng.normal(size=3), 3e-3 * rng.normal(size=3)) for c in rig)
    model = InteriorModel(p1=FIXED, p2=FIXED, k3=FIXED)
    start = find_start(scene.observe(0.1, 13), CalibrationOptions(start=rough, model=model))
    square = rng.normal(size=(REFERENCE_SIZE, REFERENCE_SIZE))
    adjusting, inverting, reference = [], [], []
    for _ in range(REPEATS):
        reference.append(_inversion_s(square))
        begin = time.perf_counter()
        solution = adjust_in_stages(start.network, start.state, LossOptions(), known_lenses=True)
        middle = time.perf_counter()
        solution.reduction.covariance().joint()
        adjusting.append(middle - begin)
        inverting.append(time.perf_counter() - middle)
    network = start.network
    return Speed(
        network.unknown_count,
        2 * len(network.pixel),
        solution.iterations,
        min(adjusting),
        min(inverting),
        min(reference),
    )


def _inversion_s(square: Floats) -> float:
    """Seconds of a workload that says how fast this machine is: one dense inverse."""
    begin = time.perf_counter()
    np.linalg.inv(square)
    return time.perf_counter() - begin


def speed_text(found: Speed) -> str:
    """The speed as a table."""
    rows = [
        ("adjustment", found.adjust_s, "0.25"),
        ("full covariance of all unknowns", found.covariance_s, "0.15"),
        (f"for scale: one inverse, {REFERENCE_SIZE} x {REFERENCE_SIZE}", found.reference_s, ""),
    ]
    return (
        "9 cameras x 300 targets of unknown place, six distances, a start 3 mm and 3 mrad off:\n"
        f"{found.residuals} residuals, {found.unknowns} unknowns, {found.iterations} steps. One "
        f"core, best of {REPEATS}.\n\n"
        + table(
            ("what", "s", "of the inverse", "asked, s"),
            [(w, f"{s:.3f}", f"{s / found.reference_s:.2f}", asked) for w, s, asked in rows],
        )
    )


ABOUT_DRAWS = """\
24 MP with 3.75 um pixels (75 um at the subject). Calibrated with 60 ring targets of unknown place,
a plate of 8 x 6 corners (20 um) in 12 places and six distances known to 3 um. In each draw plate,
distances and noise are drawn anew. Free: f, cx, cy, k1, k2, p1, p2 and the pose of each camera.

"""


def draws_text(found: Draws, sigma_px: float) -> str:
    """Calibrations against their truths."""
    count = len(found.error)
    coverage, ratio = found.coverage, found.eigenvalue_ratio()
    ours, floor = rms(found.length_um), rms(found.floor_um)
    most, least = mean_max(found.length_um), mean_max(found.floor_um)
    worst, best = float(np.abs(found.length_um).max()), float(np.abs(found.floor_um).max())
    scale, true_scale = scales_ppm(found.length_um), scales_ppm(found.floor_um)
    # The largest and smallest of some 90 shares lie 2.8 of their sigmas off by chance alone.
    chance = 2.8 * np.sqrt(0.0475 / count)
    spread = 2.8 / np.sqrt(2.0 * count)
    rows = [
        (
            f"stated 95 % intervals that hold the truth, mean over {coverage.size} parameters",
            f"{coverage.mean():.2%}",
            "95 +- 1 %",
        ),
        (
            f"the same, extreme parameters (chance alone: 95 +- {chance:.1%})",
            f"{coverage.min():.1%} .. {coverage.max():.1%}",
            "",
        ),
        (
            f"sampled over predicted sigma along the {ratio.size} principal axes of the covariance "
            f"(chance alone: 1 +- {spread:.2f})",
            f"{ratio.min():.3f} .. {ratio.max():.3f}",
            "0.9 .. 1.1",
        ),
        ("camera centres, rms over the Cramer-Rao bound", f"{found.centre_ratio:.3f}", "1.2"),
        ("length error rms, 35 lengths to 330 mm on seven lines", f"{ours:.2f} um", ""),
        ("the same with the true cameras (the floor)", f"{floor:.2f} um", ""),
        ("ratio", f"{ours / floor:.3f}", "1.2"),
        ("largest of 35, mean over draws: calibrated", f"{most:.2f} um", ""),
        ("the same with the true cameras", f"{least:.2f} um", ""),
        ("ratio", f"{most / least:.3f}", "1.2"),
        ("largest of all: calibrated, true cameras", f"{worst:.1f} um, {best:.1f} um", ""),
        ("scale rms: calibrated, true cameras", f"{scale:.1f} ppm, {true_scale:.1f} ppm", ""),
    ]
    return (
        f"7 cameras, 50 mm, 1 m, {sigma_px} px, {count} draws.\n"
        + ABOUT_DRAWS
        + table(("what", "found", "asked"), rows)
    )


def rms(values: Floats) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def mean_max(values: Floats) -> float:
    """Mean over draws of the largest amount."""
    return float(np.abs(values).max(axis=1).mean())


def scales_ppm(errors_um: Floats) -> float:
    """Rms over draws of the best common scale of 35 lengths, ppm."""
    lengths = np.tile([60.0, 120.0, 190.0, 260.0, 330.0], 7)
    return rms(1e3 * (errors_um @ lengths) / (lengths @ lengths))


def main() -> None:
    """Measure, and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=1000)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--write", type=Path, help="page whose tables are replaced")
    given = parser.parse_args()
    texts = {"speed": speed_text(speed())}
    print(texts["speed"], flush=True)
    if given.draws:
        texts["draws"] = draws_text(drawn(given.draws, SIGMA_PX, given.processes), SIGMA_PX)
        print(texts["draws"])
    if given.write is not None:
        for mark, text in texts.items():
            write_between(given.write, mark, text)


if __name__ == "__main__":
    main()
