"""What comes of a reconstruction when something is wrong with the pictures, as a table.

``python -m benchmarks.reconstruction_faults --design DESIGN.json`` photographs a head with the
cameras of a design at half their size, spoils pictures in one way after the other, and runs the
whole chain each time. A fault should be named, or the figures hold. ``--only NAME`` picks rows.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from benchmarks.pages import table
from benchmarks.reconstruction import arguments, halved, head_of
from common.errors import RigwrightError
from evaluation.comparison.distances import Reference
from evaluation.reconstruction.reconstructing import (
    Reconstruction,
    ReconstructionOptions,
    reconstruct,
)
from evaluation.reconstruction.views import Coded, view_of
from evaluation.trial.trying import judged
from geometry.camera import RigCamera
from rig.design.designfile import read_design
from rig.simulation.settings import MotionSettings, SceneSettings
from rig.simulation.studio import Shot, Studio

EXPOSURE_US = 4000.0
RADIUS_MM = 95.0
SPOILT = 2
"""Number of the camera that is moved, blurred, missing or dark."""
OPTIONS = ReconstructionOptions(stride_px=4)

Images = list[Coded | None]


@dataclass(frozen=True)
class Bench:
    """The rig at half size, the studio, and a good capture."""

    cameras: tuple[RigCamera, ...]
    studio: Studio
    good: tuple[Coded, ...]

    def shot(self, number: int, **what: object) -> Coded:
        """Camera ``number``'s picture, otherwise than in the good capture."""
        seconds = float(str(what.pop("after_s", 0.0)))
        plain = Shot(
            self.cameras[number].name,
            EXPOSURE_US,
            seed=(1, number, round(seconds)),
            # The head rests in the middle of the exposure.
            start_s=seconds - 0.5e-6 * EXPOSURE_US,
        )
        return np.asarray(self.studio.photograph(replace(plain, **what)))

    def with_one(self, image: Coded | None) -> Images:
        """The good capture with another picture of the spoilt camera."""
        out: Images = list(self.good)
        out[SPOILT] = image
        return out


def _blurred(bench: Bench, sigma_px: float) -> Images:
    image = bench.good[SPOILT]
    return bench.with_one(np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px), dtype=image.dtype))


def _mixed(bench: Bench, numbers: Sequence[int]) -> Images:
    """Pictures of another capture, before which the head moved by 3 mm and 1 degree."""
    out: Images = list(bench.good)
    for number in numbers:
        out[number] = bench.shot(number, after_s=1.0)
    return out


def _noise(shape: tuple[int, ...], seed: int = 0) -> Coded:
    return np.random.default_rng(seed).integers(0, 255, shape, dtype=np.uint8)


FAULTS: dict[str, Callable[[Bench], Images]] = {
    "nothing wrong": lambda b: list(b.good),
    "one camera moved 0.2 mm sideways": lambda b: b.with_one(
        b.shot(SPOILT, moved_mm=(0.2, 0.0, 0.0))
    ),
    "one camera moved 0.2 mm upwards": lambda b: b.with_one(
        b.shot(SPOILT, moved_mm=(0.0, 0.2, 0.0))
    ),
    "one blurred by 1 px": lambda b: _blurred(b, 1.0),
    "one blurred by 2 px": lambda b: _blurred(b, 2.0),
    "one missing": lambda b: b.with_one(None),
    "one two stops darker": lambda b: b.with_one(b.shot(SPOILT, exposure_us=EXPOSURE_US / 4.0)),
    "one of another capture": lambda b: _mixed(b, [SPOILT]),
    "three of another capture": lambda b: _mixed(b, [1, 3, 5]),
    "one black": lambda b: b.with_one(np.zeros_like(b.good[SPOILT])),
    "one of something else": lambda b: b.with_one(_noise(b.good[SPOILT].shape)),
    "one of the wrong size": lambda b: b.with_one(b.good[SPOILT][:-2]),
    "all black": lambda b: [np.zeros_like(image) for image in b.good],
    "all of something else": lambda b: [_noise(image.shape, k) for k, image in enumerate(b.good)],
    "two exchanged": lambda b: [b.good[k] for k in (1, 0, *range(2, len(b.good)))],
}


def main() -> None:
    """Photograph, spoil, reconstruct, print."""
    parser = arguments(__doc__)
    parser.add_argument("--only", action="append", default=[])
    chosen = parser.parse_args()
    bench, truth = _bench(chosen)
    rows = [
        _row(name, bench, truth, make)
        for name, make in FAULTS.items()
        if not chosen.only or any(word in name for word in chosen.only)
    ]
    head = ("what is wrong", "what is said", "points", "rms mm", "median mm", "within 1 mm")
    print(table(head, rows))


def _bench(chosen: argparse.Namespace) -> tuple[Bench, Reference]:
    motion = MotionSettings((3.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    cameras = tuple(halved(c) for c in read_design(chosen.design).cameras)
    studio = Studio(cameras, SceneSettings(head=head_of(chosen), motion=motion))
    empty = Bench(cameras, studio, ())
    good = tuple(empty.shot(number) for number in range(len(cameras)))
    surface = studio.surface
    if surface is None:
        raise SystemExit("the scene has no head")
    return replace(empty, good=good), Reference(surface.vertices_mm, surface.faces)


def _row(
    name: str, bench: Bench, truth: Reference, make: Callable[[Bench], Images]
) -> tuple[str, ...]:
    try:
        done = _reconstructed(bench, make(bench))
        trial = judged(done, truth, bench.cameras, RADIUS_MM)
    except RigwrightError as error:
        return (name, f"refused: {error.problem}", "", "", "", "")
    figures = trial.comparison.figures
    said = "; ".join(f"{d.camera} {d.kind}" for d in done.doubts) or "nothing"
    within = dict(figures.reached_percent)[1.0]
    return (
        name, said, f"{figures.points:,}", f"{figures.rms_mm:.3f}",
        f"{figures.median_absolute_mm:.3f}", f"{within:.1f} %",
    )  # fmt: skip


def _reconstructed(bench: Bench, images: Images) -> Reconstruction:
    pairs = zip(images, bench.cameras, strict=True)
    views = [view_of(image, camera) for image, camera in pairs if image is not None]
    return reconstruct(views, options=OPTIONS)


if __name__ == "__main__":
    main()
