"""How good calibration, check and their stated uncertainties are, by simulation.

    python -m benchmarks.calibration [--draws 1000] [--trials 1000] [--out FILE.md]

One core, fixed seeds. About an hour with the numbers given; a tenth of them takes six minutes.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

os.environ.update(
    dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
)

import numpy as np

from benchmarks import drift
from benchmarks.draws import Draws, draw
from calibration.adjustment.levenberg import LossOptions
from calibration.adjustment.options import FIXED, CalibrationOptions, InteriorModel
from calibration.adjustment.stages import adjust_in_stages
from calibration.adjustment.start.finding import find_start
from calibration.adjustment.start.resection import Placed
from calibration.observations import TargetSet
from calibration.synthetic import Scene, bars, face_rig, stand, turned
from geometry.arrays import Floats

NULL_FACTOR = 5
REPEATS = 7


@dataclass(frozen=True)
class Speed:
    """Best of several runs, seconds."""

    unknowns: int
    residuals: int
    iterations: int
    adjust_s: float
    covariance_s: float


def speed() -> Speed:
    """9 cameras x 300 targets of unknown place: f, cx, cy, k1, k2 and poses free."""
    carrier, points = stand(300, 11)
    rig = face_rig(9)
    places = ((Placed(np.eye(3), np.zeros(3)),),)
    inside = 0.75 * points
    targets = TargetSet("300", (carrier,), bars(carrier, inside))
    scene = Scene(rig, targets, inside, places)
    rng = np.random.default_rng(12)
    rough = tuple(turned(c, 3.0 * rng.normal(size=3), 3e-3 * rng.normal(size=3)) for c in rig)
    model = InteriorModel(p1=FIXED, p2=FIXED, k3=FIXED)
    start = find_start(scene.observe(0.1, 13), CalibrationOptions(start=rough, model=model))
    adjusting, inverting = [], []
    for _ in range(REPEATS):
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
    )


def table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    """A table in Markdown."""
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def speed_text(found: Speed) -> str:
    """The speed as a table."""
    rows = [
        ("adjustment", f"{found.adjust_s:.3f}", "0.25"),
        ("full covariance of all unknowns", f"{found.covariance_s:.3f}", "0.15"),
    ]
    return (
        "## Speed\n\n"
        "9 cameras x 300 targets of unknown place, six distances, a start 3 mm and 3 mrad off:\n"
        f"{found.residuals} residuals, {found.unknowns} unknowns, {found.iterations} steps. One "
        f"core, best of {REPEATS}.\n\n" + table(("what", "s", "asked, s"), rows)
    )


ABOUT_DRAWS = """
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
        f"## Calibration: 7 cameras, 50 mm, 1 m, {sigma_px} px, {count} draws\n"
        + ABOUT_DRAWS
        + table(("what", "found", "asked"), rows)
        + "\nMost of what is above the floor is scale: six distances with 3 um each leave 4 ppm.\n"
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


@dataclass(frozen=True)
class Row:
    """One disturbance: what it is, and how it is made."""

    words: str
    disturb: drift.Disturb
    asked: str


ONE = "95 %, named 98 %"
ROWS = (
    Row("one camera turned 10 urad, random axis across its view", drift.camera_turned(10.0), ONE),
    Row("one camera moved 20 um, random direction in space", drift.camera_shifted(20.0), ONE),
    Row("two cameras, each turned 10 urad or moved 20 um", drift.two_cameras(10.0, 20.0), "95 %"),
    Row("focus changed: f by 0.1 %, axis by 1 px", drift.focus(1e-3), "95 %"),
    Row("plate bent by 0.1 mm at its corners", drift.bent(0.1), "95 %"),
    Row("ids of two targets swapped", drift.ids_swapped, "95 %"),
    Row("plate printed at 97 %", drift.printed(0.97), "95 %"),
    Row("one camera 2 ms late, plate moved at 100 mm/s", drift.late(2.0, 100.0), "95 %"),
    Row("two cameras' images swapped", drift.cameras_swapped, ""),
    Row("one ring target knocked by 0.1 mm", drift.target_moved(100.0), ""),
)
FEW = ROWS[:3]


def drift_text(trials: int, sigma_px: float, told: Callable[[str], None]) -> str:
    """All disturbances, with a usual check and with a quick one."""
    usual = drift.Bench.of(sigma_px)
    parts = [
        f"## Check: {trials} trials in each row, {sigma_px} px",
        "",
        "Every trial draws a reference from its covariance (so that its own uncertainty is in the",
        "test), disturbs the rig, observes it and runs the check as shipped, gross faults first.",
        "Reported: the light is not green. Own verdict: the right kind is among the findings. Named:",
        "about exactly the right camera or target. Alone: and nothing else was found.",
        "",
        f"Usual check: 60 ring targets and the plate in {drift.CHECK_FRAMES} frames "
        f"({len(usual.epoch.pixel)} image points).",
        "",
        *_table(usual, ROWS, trials, told),
        "",
        *_false_alarms(usual, NULL_FACTOR * trials, told),
        "",
    ]
    quick = drift.Bench.of(sigma_px, rings=40, check_frames=0)
    parts += [
        f"Quick check: one picture of 40 ring targets ({len(quick.epoch.pixel)} image points).",
        "",
        *_table(quick, FEW, trials, told),
        "",
        *_false_alarms(quick, NULL_FACTOR * trials, told),
        "",
        *_sensitivities(usual, quick),
    ]
    return "\n".join(parts) + "\n"


def _table(
    bench: drift.Bench, rows: tuple[Row, ...], trials: int, told: Callable[[str], None]
) -> list[str]:
    out = [
        "| what happened | reported | own verdict | named | alone | asked |",
        "|---|---|---|---|---|---|",
    ]
    for number, row in enumerate(rows):
        told(row.words)
        t = drift.run(bench, row.disturb, trials, number)
        shares = " | ".join(f"{v / t.trials:.1%}" for v in (t.alarmed, t.kind, t.named, t.alone))
        out.append(f"| {row.words} | {shares} | {row.asked} |")
    return out


def _false_alarms(bench: drift.Bench, trials: int, told: Callable[[str], None]) -> list[str]:
    told("nothing")
    found = drift.run(bench, drift.nothing, trials, 99)
    return [
        f"Nothing happened but a shift and turn of the whole rig: {found.alarmed} false alarms in "
        f"{trials} checks (asked: at most 0.1 %, which is {trials / 1000:.0f})."
    ]


def _sensitivities(usual: drift.Bench, quick: drift.Bench) -> list[str]:
    out = [
        "What the checks could have seen (Baarda, delta0 = 4.13), median over the cameras; 1.6 times",
        "as much is reported in 95 of 100 checks:",
        "",
        "| check | turn across the view | roll | shift across | along | hidden at the subject |",
        "|---|---|---|---|---|---|",
    ]
    for name, bench in (("usual", usual), ("quick", quick)):
        result = bench.trial(bench.scene, np.random.default_rng(1))
        sees = [c.sensitivity for c in result.cameras if c.sensitivity is not None]
        turn = np.median([max(s.turn_urad[:2]) for s in sees])
        roll = np.median([s.turn_urad[2] for s in sees])
        across = np.median([max(s.shift_um[:2]) for s in sees])
        along = np.median([s.shift_um[2] for s in sees])
        hidden = np.median([1e3 * s.hidden_mm for s in sees])
        out.append(
            f"| {name} | {turn:.1f} urad | {roll:.0f} urad | {across:.1f} um | {along:.0f} um | "
            f"{hidden:.2f} um |"
        )
    return out


def main() -> None:
    """Run all and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=1000)
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    begin = time.perf_counter()

    def told(words: str) -> None:
        print(f"{time.perf_counter() - begin:7.0f} s  {words}", flush=True)

    head = (
        "# Accuracy of calibration and check\n\n"
        "Command: `python -m benchmarks.calibration --out docs/calibration-accuracy.md`. Simulated "
        "observations\n(projected, normal noise), fixed seeds, one core. What a lens does that the "
        "model does not know is\nnot in it. The method is in `docs/calibration.md`.\n"
    )
    told("speed")
    parts = [head, speed_text(speed())]
    told("calibrations")
    parts.append(draws_text(draw(given.draws, 0.05), 0.05))
    parts.append(drift_text(given.trials, 0.1, told))
    text = "\n".join(parts)
    print(text)
    if given.out is not None:
        given.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
