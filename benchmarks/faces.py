"""Designs for 4 to 9 cameras on a head, beside their start and the best strip.

    python -m benchmarks.faces [--scan HEAD.glb] [--starts 8] [--strategy k-means] [--counts 5 7]
        [--out docs/explanation/face-designs.md]

Without a scan the bundled head is used. The limits are those of the example face rig.
"""

from __future__ import annotations

import argparse
import os
from dataclasses import replace
from pathlib import Path

from geometry.head import synthetic_head
from geometry.preparation import prepare_subject
from geometry.reading import read_scan
from rig.design.layout import make_layout
from rig.specification.examples import example_rig
from solver.beginnings import best_strip
from solver.design import design
from solver.quality import evaluate
from solver.result import Design, Quality
from solver.strategy import Strategy

COUNTS = (4, 5, 6, 7, 8, 9)


def line(kind: str, count: int, quality: Quality, extra: str) -> str:
    """One line of the table."""
    share = {c.views: c.share for c in quality.coverage}
    broken = sorted({r.family for r in quality.violated})
    return (
        f"| {count} | {kind} | {'yes' if quality.feasible else 'no: ' + ', '.join(broken)} "
        f"| {1e3 * quality.cost_mm2:.3f} | {1e3 * quality.sigma_median_mm:.1f} "
        f"| {1e3 * quality.sigma_p95_mm:.1f} | {share.get(2, 0.0):.2%} | {share.get(3, 0.0):.2%} "
        f"| {quality.in_frame_share:.2%} | {quality.in_focus_share:.2%} | {extra} |"
    )


def rows(found: Design, strip: Quality, clashes: int) -> list[str]:
    """The design, its start, and the strip."""
    count = len(found.cameras)
    solver = found.solver
    note = f"{clashes} clashes, {solver.status.value}, KKT {solver.kkt_error:.0e}"
    return [
        line("design", count, found.quality, note),
        line("start", count, found.start_quality, solver.starts[0].kind if solver.starts else ""),
        line("strip", count, strip, "best of 11 spans"),
    ]


def main() -> None:
    """Run all counts and print or write the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--scan", type=Path, help="a head scan; the bundled head without it")
    parser.add_argument("--starts", type=int, default=8)
    parser.add_argument("--strategy", type=Strategy, choices=Strategy, default=Strategy.EXCHANGE)
    parser.add_argument("--counts", type=int, nargs="+", default=COUNTS, metavar="N")
    parser.add_argument("--out", type=Path, help="write the table to this file")
    chosen = parser.parse_args()
    spec = example_rig("face")
    scan = synthetic_head() if chosen.scan is None else read_scan(chosen.scan, spec.scan_options)
    prepared = prepare_subject(scan, replace(spec.subject_options, seed=spec.seed))
    table = [
        "| cameras | what | all limits | mean norm of Q, 1e-3 mm2 | median sigma, um | p95, um "
        "| 2+ views | 3+ views | in frame | in focus | notes |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    for count in chosen.counts:
        found = design(
            prepared.subject, spec.camera, spec.limits, count=count, seed=spec.seed,
            starts=chosen.starts, workers=os.cpu_count() or 1, strategy=chosen.strategy,
        )  # fmt: skip
        names = tuple(c.name for c in found.cameras)
        strip = best_strip(prepared.subject, spec.camera, spec.limits, names)
        layout = make_layout(found.cameras, prepared.subject, spec.limits)
        clashes = len(layout.collisions)
        table += rows(found, evaluate(prepared.subject, strip, spec.limits), clashes)
        print("\n".join(table[-3:]), flush=True)
    if chosen.out:
        name = "the bundled head" if chosen.scan is None else chosen.scan.name
        head = (
            "# Designs for 4 to 9 cameras\n\n"
            f"Head: {name}. Limits: `rig/specification/data/face.toml`, {chosen.starts} starts, "
            f"strategy {chosen.strategy}. "
            f"{len(prepared.subject.check_points)} check points.\n"
            f"Written by `python -m benchmarks.faces --scan HEAD --strategy {chosen.strategy} "
            f"--starts {chosen.starts} --out docs/explanation/face-designs.md`.\n"
            "Sigma is the longest semi-axis of a point's error ellipsoid at half a pixel of "
            "image noise.\n\n"
        )  # fmt: skip
        chosen.out.write_text(head + "\n".join(table) + "\n")


if __name__ == "__main__":
    main()
