"""Mount plans of the 4- to 9-camera face designs on a frame, a plate and an arc; a hundred cameras.

    python -m benchmarks.plans --designs FOLDER [--scan HEAD.glb]
        [--counts 4 5] [--out docs/explanation/mount-plans.md]

FOLDER keeps the designs as faces-4.json to faces-9.json; those that are missing are designed
first as ``benchmarks.faces`` does and written there. Run with OMP_NUM_THREADS=1: the seconds are
the processor's, of one core.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from common.errors import RigwrightError
from geometry.camera import RigCamera
from geometry.frames import Pose
from geometry.head import synthetic_head
from geometry.preparation import PreparedSubject, prepare_subject
from geometry.reading import read_scan
from rig.build.mounts.making import make_plan
from rig.build.mounts.plan import MountPlan
from rig.build.mounts.systemfile import system_from_mapping
from rig.design.designfile import design_document, read_design
from rig.specification.examples import example_rig
from rig.specification.spec import RigSpec
from solver.design import design
from solver.limits import BaseHeight, Coverage, CoverageTier, Limits
from solver.problem import camera_at

COUNTS = (4, 5, 6, 7, 8, 9)
KINDS = ("t-slot", "plate", "arc")
HEADER = (
    "| cameras | mount | clashes | all limits | median sigma, um: designed | rounded one by one "
    "| built | loss of sigma | loss of coverage | limits broken by rounding one by one | yield "
    "| seconds |\n|---|---|---|---|---|---|---|---|---|---|---|---|"
)


def designed(
    folder: Path, count: int, spec: RigSpec, prepared: PreparedSubject, starts: int
) -> tuple[RigCamera, ...]:
    """The cameras of a design, from the folder or made and kept there."""
    path = folder / f"faces-{count}.json"
    if not path.exists():
        found = design(
            prepared.subject, spec.camera, spec.limits, count=count, seed=spec.seed, starts=starts
        )
        document = design_document(found, spec=spec.with_count(count))
        folder.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(document, allow_nan=False))
    return read_design(path).cameras


def line(count: int, kind: str, plan: MountPlan, seconds: float) -> str:
    """One line of the table."""
    price = plan.price
    um = [1e3 * f.sigma_median_mm for f in (price.designed, price.rounded, price.built)]
    held = "yes" if price.built.feasible else "no: " + ", ".join(price.built.broken[:3])
    return (
        f"| {count} | {kind} | {len(plan.clashes)} | {held} | {um[0]:.1f} | {um[1]:.1f} "
        f"| {um[2]:.1f} | {price.sigma_loss:.1%} | {price.coverage_loss:.3%} "
        f"| {len(price.rounded.broken)} | {plan.yield_share:.0%} of {plan.yield_trials} "
        f"| {seconds:.0f} |"
    )


def planned(
    count: int,
    kind: str,
    cameras: tuple[RigCamera, ...],
    prepared: PreparedSubject,
    limits: Limits,
) -> str:
    """The line of one plan, or of the error that says why there is none."""
    began = time.process_time()
    try:
        plan = make_plan(cameras, prepared.subject, limits, system_from_mapping({"kind": kind}))
    except RigwrightError as error:
        return f"| {count} | {kind} | {error} | | | | | | | | | |"
    for clash in plan.clashes[:5]:
        print("   ", clash)
    return line(count, kind, plan, time.process_time() - began)


def dome(spec: RigSpec, prepared: PreparedSubject) -> tuple[tuple[RigCamera, ...], Limits]:
    """A hundred cameras in rows about the face, and limits that fit them."""
    target = prepared.subject.design_points.centroid_mm
    cameras = []
    for row, elevation in enumerate(np.radians(np.linspace(-40.0, 40.0, 10))):
        for column, azimuth in enumerate(np.radians(np.linspace(-58.0, 58.0, 10))):
            way = np.array(
                [
                    np.sin(azimuth) * np.cos(elevation),
                    -np.cos(azimuth) * np.cos(elevation),
                    np.sin(elevation),
                ]
            )
            pose = Pose.looking_at(target + 1300.0 * way, target)
            points = prepared.subject.check_points.points_mm
            cameras.append(camera_at(spec.camera, f"cam{10 * row + column + 1:03d}", pose, points))
    coverage = Coverage((CoverageTier(2, 0.99),))
    limits = replace(spec.limits, base_height=BaseHeight(), coverage=coverage)
    return tuple(cameras), limits


def main() -> None:
    """Plan everything and print or write the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--designs", type=Path, required=True, help="folder that keeps the designs")
    parser.add_argument("--scan", type=Path, help="a head scan; the bundled head without it")
    parser.add_argument("--starts", type=int, default=6, help="of designs that are missing")
    parser.add_argument("--counts", type=int, nargs="*", default=COUNTS, help="of cameras")
    parser.add_argument("--without-dome", action="store_true", help="leave out the hundred cameras")
    parser.add_argument("--out", type=Path, help="write the table to this file")
    chosen = parser.parse_args()
    spec = example_rig("face")
    scan = synthetic_head() if chosen.scan is None else read_scan(chosen.scan, spec.scan_options)
    prepared = prepare_subject(scan, replace(spec.subject_options, seed=spec.seed))
    table = [HEADER]
    for kind in KINDS:
        for count in chosen.counts:
            cameras = designed(chosen.designs, count, spec, prepared, chosen.starts)
            table.append(planned(count, kind, cameras, prepared, spec.limits))
            print(table[-1], flush=True)
    if not chosen.without_dome:
        cameras, limits = dome(spec, prepared)
        table.append(planned(len(cameras), "t-slot", cameras, prepared, limits))
        print(table[-1], flush=True)
    if chosen.out:
        name = "the bundled head" if chosen.scan is None else chosen.scan.name
        chosen.out.write_text(
            INTRODUCTION.format(name=name, starts=chosen.starts) + "\n".join(table) + "\n"
        )


INTRODUCTION = """# Mount plans of the face designs

Head: {name}. Limits as in `face-designs.md`, designs by the strategy `exchange` from {starts}
starts; every system with its defaults (`kind` alone): a ball head set in whole degrees, slides in
whole millimetres, frames on levelling feet, with the back-stays, larger profiles and ties that
they need.
Written by
`python -m benchmarks.plans --designs FOLDER --scan HEAD --out docs/explanation/mount-plans.md`.

*Rounded one by one* is what a builder gets who rounds the design's figures; *built* is what the
plan says to set. *Loss of coverage* is the share of the region that lost its second view.
*Yield* is the share of trial rigs, every setting off by up to half a step (a plate: 0.2 mm and
0.1 degrees), that kept all limits. Seconds are the processor's on one core of a machine that was
busy with other work. The hundred cameras stand in ten rows about the face, with limits on frame,
focus, centring, incidence, coverage, bodies and sight lines.

Tripods are left out: these designs put cameras over one another, where the legs of several
tripods would have to stand in one place. A plan on tripods names the clashes.

"""


if __name__ == "__main__":
    main()
