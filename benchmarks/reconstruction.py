"""Simulated cameras, their pictures, the cloud, and its distance to the very head.

``python -m benchmarks.reconstruction --design DESIGN.json --head HEAD.glb --texture MAP.jpg``
takes the cameras of ``--design DESIGN.json``; without a head the bundled one is photographed. With
``--calibrated`` there is a second column: the same pictures with poses and lenses that are not
known but found from captures of targets that the same simulated cameras took; that cloud is put
onto the head by best fit (rigid, no scale). With ``--blender PROGRAM`` (Blender, or a Python with
its module ``bpy``) there is a column for pictures of the same rig that Blender rendered, with
``--samples`` rays a pixel. With ``--strip`` there is a column for as many of the same cameras side
by side, in the conventional strip that suits the head best. ``--half`` halves the pictures,
``--stride`` is the pixels between points. ``--kept FOLDER`` keeps pictures there, and takes those
that are there already: of the same design, head and studio only.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.calibrated_cameras import calibrated, photographed, taken
from benchmarks.pages import table
from benchmarks.strips import strip_beside
from evaluation.comparison.alignment import best_fit
from evaluation.comparison.distances import Reference
from evaluation.reconstruction.reconstructing import (
    Reconstruction,
    ReconstructionOptions,
    reconstruct,
)
from evaluation.reconstruction.views import Coded, view_of
from evaluation.reconstruction.volume import common_volume
from evaluation.trial.trying import judged
from geometry.camera import RigCamera
from rig.design.designfile import read_design
from rig.simulation.blender.photographing import BlenderPhotographer
from rig.simulation.settings import HeadSettings, SceneSettings
from rig.simulation.studio import Shot, Studio

EXPOSURE_US = 4000.0
RADIUS_MM = 95.0


def main() -> None:
    """Photograph, reconstruct, compare, print."""
    chosen = _chosen()
    designed: tuple[RigCamera, ...] = read_design(chosen.design).cameras
    cameras = sized(designed, half=chosen.half)
    studio = Studio(cameras, SceneSettings(head=head_of(chosen)))
    images = photographs(studio, chosen.kept)
    if studio.surface is None:
        raise SystemExit("the scene has no head")
    truth = Reference(studio.surface.vertices_mm, studio.surface.faces)
    options = ReconstructionOptions(stride_px=chosen.stride)
    known = figures_of(images, cameras, cameras, truth, options)
    columns = {"known cameras": known}
    if chosen.calibrated:
        found = _calibrated(cameras, images, chosen.captures, chosen.kept)
        columns["calibrated"] = figures_of(images, found, cameras, truth, options, fit=True)
    if chosen.strip:
        strip = sized(strip_beside(designed, chosen.head), half=chosen.half)
        # The cameras of both are called alike.
        kept = None if chosen.kept is None else chosen.kept / "strip"
        side_by_side = photographs(Studio(strip, studio.scene), kept)
        columns["strip"] = figures_of(side_by_side, strip, strip, truth, options)
    if chosen.blender is not None:
        blender = BlenderPhotographer(chosen.blender, chosen.samples)
        other = rendered_by_blender(studio, blender, chosen.kept)
        columns["by Blender"] = figures_of(other, cameras, cameras, truth, options)
    _print(columns)


def _print(columns: Mapping[str, Mapping[str, str]]) -> None:
    names = next(iter(columns.values()))
    rows = [(name, *(column[name] for column in columns.values())) for name in names]
    print(table(("figure", *columns), rows))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"\npeak memory, photographing included: {peak:.0f} MiB")


def _chosen() -> argparse.Namespace:
    parser = sized_arguments(__doc__)
    parser.add_argument("--calibrated", action="store_true")
    parser.add_argument("--captures", type=int, default=12)
    parser.add_argument("--strip", action="store_true")
    parser.add_argument("--blender", metavar="PROGRAM")
    parser.add_argument("--samples", type=int, default=BlenderPhotographer().samples)
    return parser.parse_args()


def photographs(studio: Studio, kept: Path | None) -> list[Coded]:
    """The head as each camera of a studio shows it."""
    return [
        photographed(studio, Shot(name, EXPOSURE_US, seed=(1, number)), kept)
        for number, name in enumerate(studio.cameras)
    ]


def rendered_by_blender(
    studio: Studio, blender: BlenderPhotographer, kept: Path | None
) -> list[Coded]:
    """The head as Blender shows it to each camera."""
    found: list[Coded] = []
    for number, name in enumerate(studio.cameras):
        shot = Shot(name, EXPOSURE_US, seed=(1, number))
        width, height = studio.cameras[name].camera.image_size_px
        file = f"{name}-blender-{blender.samples}-{width}x{height}.npy"
        found.append(taken(kept, file, partial(_rendered, blender, studio, shot)))
    return found


def _rendered(blender: BlenderPhotographer, studio: Studio, shot: Shot) -> NDArray[np.uint8]:
    return np.asarray(blender(studio, [shot])[0], dtype=np.uint8)


def figures_of(
    images: Sequence[Coded],
    cameras: Sequence[RigCamera],
    true: Sequence[RigCamera],
    truth: Reference,
    options: ReconstructionOptions,
    *,
    fit: bool = False,
) -> dict[str, str]:
    """The figures of one reconstruction by their names.

    ``cameras`` as the matcher has them, ``true`` as they photographed. ``fit``: the cloud is put
    onto the head, for cameras whose frame is their own.
    """
    views = [view_of(image, camera) for image, camera in zip(images, cameras, strict=True)]
    begin, cpu = time.perf_counter(), time.process_time()
    done = reconstruct(views, options=options)
    wall, busy = time.perf_counter() - begin, time.process_time() - cpu
    if fit:
        done = _fitted(done, truth)
    trial = judged(done, truth, true, RADIUS_MM)
    found = trial.comparison.figures
    return {
        "points": f"{found.points:,}",
        "bias": f"{found.bias_mm:+.4f} mm",
        "rms": f"{found.rms_mm:.4f} mm",
        "median of the absolute error": f"{found.median_absolute_mm:.4f} mm",
        **{f"{share:g} % within": f"{value:.3f} mm" for share, value in found.percentiles_mm},
        **{
            f"of what two cameras see, within {reach:g} mm of a point": f"{value:.1f} %"
            for reach, value in found.reached_percent
        },
        "of all within 95 mm seen by two cameras": f"{trial.seen_percent:.1f} %",
        "of all within 95 mm, within 0.2 mm of a point": (
            f"{trial.seen_percent * dict(found.reached_percent)[0.2] / 100.0:.1f} %"
        ),
        **{
            f"predicted to measured scatter, {part.name}": f"{part.ratio:.2f}"
            for part in trial.regions
        },
        "cameras that are doubted": ", ".join(d.camera for d in done.doubts) or "none",
        "pictures to points": f"{wall:.0f} s, {busy:.0f} s of processor time",
    }


def head_of(chosen: argparse.Namespace) -> HeadSettings:
    """The head of the arguments, the bundled one where none is given."""
    return HeadSettings(
        scan=chosen.head,
        texture=chosen.texture,
        displacement=chosen.displacement,
        flip_texture=chosen.head is not None,
        subdivisions=2 if chosen.head is not None else 1,
    )


def sized(cameras: Sequence[RigCamera], *, half: bool) -> tuple[RigCamera, ...]:
    """The cameras as they are, or all of them halved."""
    return tuple(halved(camera) if half else camera for camera in cameras)


def halved(camera: RigCamera) -> RigCamera:
    """The same camera with half as many pixels each way."""
    kind = camera.camera
    w, h = kind.image_size_px
    small = replace(
        kind,
        image_size_px=(w // 2, h // 2),
        pixel_pitch_mm=2.0 * kind.pixel_pitch_mm,
        principal_point_px=(kind.principal_point_px - 0.5) / 2.0,
    )
    return replace(camera, camera=small)


def arguments(description: str | None) -> argparse.ArgumentParser:
    """Takes a design, and the head that its cameras photograph."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--design", type=Path, required=True)
    parser.add_argument("--head", type=Path)
    parser.add_argument("--texture", type=Path)
    parser.add_argument("--displacement", type=Path)
    return parser


def sized_arguments(description: str | None) -> argparse.ArgumentParser:
    """Takes the size of the pictures too, and where they are kept."""
    parser = arguments(description)
    parser.add_argument("--half", action="store_true")
    parser.add_argument("--kept", type=Path)
    parser.add_argument("--stride", type=int, default=ReconstructionOptions().stride_px)
    return parser


def _calibrated(
    cameras: Sequence[RigCamera], images: Sequence[Coded], captures: int, kept: Path | None
) -> tuple[RigCamera, ...]:
    """The cameras as a calibration finds them, and what it says of itself printed."""
    centre = common_volume([view_of(i, c) for i, c in zip(images, cameras, strict=True)])
    found, told = calibrated(cameras, centre.centre_rig_mm, captures, EXPOSURE_US, kept)
    apart = [
        np.linalg.norm(a.pose.position_rig_mm - b.pose.position_rig_mm)
        for a, b in zip(found, cameras, strict=True)
    ]
    print(
        f"calibrated from {captures} captures; centres off by up to {max(apart):.3f} mm, residuals "
        f"{told.quality.rms_px:.3f} px rms, {told.quality.rejected} points rejected\n"
    )
    print("".join(f"{words}\n" for words in told.quality.warnings))
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
