"""Seven simulated cameras, their pictures, the cloud, and its distance to the very head.

``python -m benchmarks.reconstruction --design DESIGN.json --head HEAD.glb --texture MAP.jpg``
takes the cameras of ``--design DESIGN.json``; without a head the bundled one is photographed. With
``--calibrated`` poses and lenses are not known but found from twelve captures of targets that the
same simulated cameras took, and the cloud is put onto the head by best fit (rigid, no scale).
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.calibrated_cameras import calibrated
from evaluation.comparison.alignment import best_fit
from evaluation.comparison.distances import Reference
from evaluation.reconstruction.reconstructing import Reconstruction, reconstruct
from evaluation.reconstruction.views import Coded, view_of
from evaluation.reconstruction.volume import common_volume
from evaluation.trial.trying import judged
from geometry.camera import RigCamera
from rig.design.designfile import read_design
from rig.simulation.settings import HeadSettings, SceneSettings
from rig.simulation.studio import Shot, Studio

EXPOSURE_US = 4000.0
RADIUS_MM = 95.0
CAPTURES = 12


def main() -> None:
    """Photograph, reconstruct, compare, print."""
    chosen = _arguments()
    cameras = read_design(chosen.design).cameras
    head = HeadSettings(
        scan=chosen.head,
        texture=chosen.texture,
        displacement=chosen.displacement,
        flip_texture=chosen.head is not None,
        subdivisions=2 if chosen.head is not None else 1,
    )
    studio = Studio(cameras, SceneSettings(head=head))
    images = _images(studio)
    if chosen.calibrated:
        cameras = _calibrated(cameras, images)
    views = [view_of(image, camera) for image, camera in zip(images, cameras, strict=True)]
    begin, cpu = time.perf_counter(), time.process_time()
    done = reconstruct(views)
    wall, busy = time.perf_counter() - begin, time.process_time() - cpu
    surface = studio.surface
    if surface is None:
        raise SystemExit("the scene has no head")
    truth = Reference(surface.vertices_mm, surface.faces)
    if chosen.calibrated:
        done = _fitted(done, truth)
    trial = judged(done, truth, tuple(studio.cameras.values()), RADIUS_MM)
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


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--design", type=Path, required=True)
    parser.add_argument("--head", type=Path)
    parser.add_argument("--texture", type=Path)
    parser.add_argument("--displacement", type=Path)
    parser.add_argument("--calibrated", action="store_true")
    return parser.parse_args()


def _images(studio: Studio) -> list[Coded]:
    return [
        np.asarray(studio.photograph(Shot(camera.name, EXPOSURE_US, seed=(1, number))))
        for number, camera in enumerate(studio.cameras.values())
    ]


def _calibrated(cameras: Sequence[RigCamera], images: Sequence[Coded]) -> tuple[RigCamera, ...]:
    """The cameras as a calibration finds them, and what it says of itself printed."""
    centre = common_volume([view_of(i, c) for i, c in zip(images, cameras, strict=True)])
    found, told = calibrated(cameras, centre.centre_rig_mm, CAPTURES, EXPOSURE_US)
    apart = [
        np.linalg.norm(a.pose.position_rig_mm - b.pose.position_rig_mm)
        for a, b in zip(found, cameras, strict=True)
    ]
    print(
        f"calibrated from {CAPTURES} captures; centres off by up to {max(apart):.3f} mm, ", end=""
    )
    print(f"residuals {told.quality.rms_px:.3f} px rms\n")
    return found


def _fitted(done: Reconstruction, truth: Reference) -> Reconstruction:
    """The cloud put onto the head: a calibration's frame is its own."""
    cloud = done.cloud
    nose = truth.vertices_mm[np.argmin(truth.vertices_mm[:, 1])]
    near = np.linalg.norm(cloud.points_mm - nose, axis=1) <= RADIUS_MM
    fit = best_fit(cloud.points_mm[near], truth)
    off_deg = np.degrees(np.arccos(np.clip((np.trace(fit.rotation) - 1.0) / 2.0, -1.0, 1.0)))
    moved = fit.apply(cloud.points_mm)
    way = np.linalg.norm(moved[near] - cloud.points_mm[near], axis=1).mean()
    print(f"best fit: turned by {off_deg:.4f} degrees, points moved by {way:.3f} mm on average\n")
    turned = cloud.normals @ fit.rotation.T
    return replace(done, cloud=replace(cloud, points_mm=moved, normals=turned))


if __name__ == "__main__":
    main()
