"""Seven simulated cameras, their pictures, the cloud, and its distance to the very head.

``python -m benchmarks.reconstruction --design DESIGN.json --head HEAD.glb --texture MAP.jpg``
takes the cameras of ``--design DESIGN.json``; without a head the bundled one is photographed.
"""

from __future__ import annotations

import argparse
import resource
import time
from pathlib import Path

import numpy as np

from evaluation.comparison.distances import Reference
from evaluation.reconstruction.reconstructing import reconstruct
from evaluation.reconstruction.views import View, view_of
from evaluation.trial.trying import judged
from rig.design.designfile import read_design
from rig.simulation.settings import HeadSettings, SceneSettings
from rig.simulation.studio import Shot, Studio

EXPOSURE_US = 4000.0
RADIUS_MM = 95.0


def main() -> None:
    """Photograph, reconstruct, compare, print."""
    chosen = arguments(__doc__).parse_args()
    cameras = read_design(chosen.design).cameras
    head = HeadSettings(
        scan=chosen.head,
        texture=chosen.texture,
        displacement=chosen.displacement,
        flip_texture=chosen.head is not None,
        subdivisions=2 if chosen.head is not None else 1,
    )
    studio = Studio(cameras, SceneSettings(head=head))
    views = _views(studio)
    begin, cpu = time.perf_counter(), time.process_time()
    done = reconstruct(views)
    wall, busy = time.perf_counter() - begin, time.process_time() - cpu
    surface = studio.surface
    if surface is None:
        raise SystemExit("the scene has no head")
    truth = Reference(surface.vertices_mm, surface.faces)
    trial = judged(done, truth, cameras, RADIUS_MM)
    found = trial.comparison.figures
    print("| figure | value |\n| --- | --- |")
    print(f"| points | {found.points:,} |")
    print(f"| bias | {found.bias_mm:+.4f} mm |")
    print(f"| rms | {found.rms_mm:.4f} mm |")
    print(f"| median of the absolute error | {found.median_absolute_mm:.4f} mm |")
    for share, value in found.percentiles_mm:
        print(f"| {share:g} % within | {value:.3f} mm |")
    for reach, value in found.reached_percent:
        print(f"| surface within {reach:g} mm of a point | {value:.1f} % |")
    print(f"| of the surface seen by two cameras | {trial.seen_percent:.1f} % |")
    for part in trial.regions:
        print(f"| predicted to measured scatter, {part.name} | {part.ratio:.2f} |")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"| pictures to points | {wall:.0f} s, {busy:.0f} s of processor time |")
    print(f"| peak memory, photographing included | {peak:.0f} MiB |")


def arguments(description: str | None) -> argparse.ArgumentParser:
    """Takes a design, and the head that its cameras photograph."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--design", type=Path, required=True)
    parser.add_argument("--head", type=Path)
    parser.add_argument("--texture", type=Path)
    parser.add_argument("--displacement", type=Path)
    return parser


def _views(studio: Studio) -> list[View]:
    views = []
    for number, camera in enumerate(studio.cameras.values()):
        image = studio.photograph(Shot(camera.name, EXPOSURE_US, seed=(1, number)))
        views.append(view_of(np.asarray(image), camera))
    return views


if __name__ == "__main__":
    main()
