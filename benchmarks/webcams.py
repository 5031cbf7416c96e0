"""Four webcams, synchronised by software, and a ChArUco plate: others' videos, others' solution.

``python -m benchmarks.webcams`` finds the plate in every frame, calibrates from nothing and
prints the residuals and the errors of lengths. The published tool reaches 1.27 px with every
frame and 1.13 px without the worst 2.5 %, and a length error of 1.03 mm, 0.53 % of the plate's
diagonal. No frame is picked by hand; views that were taken late are found and left out.
"""

from __future__ import annotations

import argparse
import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from plain_opencv import video_frames

from calibration.adjustment import Calibration, calibrate
from calibration.adjustment.forward import intersected
from calibration.detection.pictures import TakenPicture, detect_pictures
from calibration.observations import Observations
from calibration.targets.kinds import CharucoPlate, TargetPlan
from geometry.arrays import Bools, Floats

FOLDER = Path("data/calibration/caliscope/charuco_calibration/calibration/extrinsic")
ROOT = Path(__file__).resolve().parents[1]
PLATE = CharucoPlate(
    "board", 4, 5, 54.0, 40.5, "DICT_4X4_1000", inverted=True, sigma_mm=(0.2, 0.2, 0.2)
)
"""Printed by others on paper, its flatness unknown: a fifth of a millimetre."""


@dataclass(frozen=True, eq=False)
class Session:
    """What came of it. ``rms_px`` counts both coordinates of a point, as the published tool."""

    calibration: Calibration
    observations: Observations
    rms_px: float
    rejected_share: float
    length_errors_mm: Floats
    length_share: float


def session_folder() -> Path | None:
    """The videos, in a folder ``shared`` beside the checkout; None when they are not there."""
    found = (up / "shared" / FOLDER for up in ROOT.parents)
    return next((folder for folder in found if folder.is_dir()), None)


def pictures(folder: Path) -> list[TakenPicture]:
    """Every frame of every video, by the instant that the time stamps give it."""
    with (folder / "timestamps.csv").open(encoding="utf-8") as file:
        first = min(int(row["frame_index"]) for row in csv.DictReader(file))
    return [
        TakenPicture(f"cam_{camera}", str(first + number), grey)
        for camera in range(4)
        for number, grey in enumerate(video_frames(folder / f"cam_{camera}.mp4"))
    ]


def run(folder: Path) -> Session:
    """Detect, calibrate from nothing, measure the plate."""
    seen = detect_pictures(pictures(folder), TargetPlan("session", (PLATE,))).observations
    found = calibrate(seen)
    used = np.ones(len(seen.pixel), bool)
    if found.residuals is not None:
        used[found.residuals.rejected] = False
    errors = length_errors_mm(found, seen, used)
    corners = PLATE.corner_grid_mm
    diagonal = float(np.linalg.norm(corners[-1] - corners[0]))
    return Session(
        found,
        seen,
        float(np.sqrt(2.0) * found.quality.rms_px),
        1.0 - float(used.mean()),
        errors,
        float(np.sqrt(np.mean(errors**2))) / diagonal,
    )


def length_errors_mm(found: Calibration, seen: Observations, used: Bools) -> Floats:
    """Errors of all distances between corners that were intersected in one frame."""
    rows = np.flatnonzero(used)
    corners = PLATE.corner_grid_mm
    count = len(corners)
    points = intersected(
        found.cameras,
        seen.camera[rows],
        seen.frame[rows] * count + seen.target[rows],
        seen.pixel[rows],
        seen.sigma_px[rows],
        len(seen.frames) * count,
    ).position_rig_mm.reshape(-1, count, 3)
    a, b = np.triu_indices(count, 1)
    measured = np.linalg.norm(points[:, a] - points[:, b], axis=2)
    errors = measured - np.linalg.norm(corners[a] - corners[b], axis=1)
    return np.asarray(errors[np.isfinite(errors)])


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, help="the videos; looked for beside the checkout")
    folder = parser.parse_args().folder or session_folder()
    if folder is None:
        raise SystemExit("the four-webcam session is not here; give --folder")
    came = run(folder)
    quality = came.calibration.quality
    print(f"corners found: {len(came.observations.pixel)}")
    print(
        f"converged: {quality.converged}; left out: {100.0 * came.rejected_share:.1f} %, among "
        f"them {len(quality.late_views)} late views"
    )
    print(f"residuals: {came.rms_px:.2f} px rms (published 1.13 to 1.27)")
    errors = came.length_errors_mm
    print(
        f"lengths: {len(errors)}, {np.sqrt(np.mean(errors**2)):.2f} mm rms, "
        f"{100.0 * came.length_share:.2f} % of the diagonal (published 0.53 %)"
    )


if __name__ == "__main__":
    main()
