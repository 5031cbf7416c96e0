"""Designs that a matcher can hold together: 4 to 9 cameras, pictures level or portrait.

    python -m benchmarks.matchable [--scan HEAD.glb] [--starts 4] [--counts 5 7]
        [--out FILE.md]

Without a scan the bundled head is used. The limits are those of the example face rig with
``roll = "level-or-portrait"`` and ``[matching] required = true``, beside those without both.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

from geometry.head import synthetic_head
from geometry.preparation import prepare_subject
from geometry.reading import read_scan
from geometry.subject import Subject
from rig.specification.examples import example_rig
from rig.specification.spec import RigSpec
from solver.design import design
from solver.limits import Limits, Roll
from solver.strategy import Strategy

COUNTS = (4, 5, 6, 7, 8, 9)

HEAD = (
    "| cameras | limits | all hold | mean norm of Q, 1e-3 mm2 | median sigma, um | p95, um "
    "| in a pair | in two pairs | groups | processor, s |"
)


def line(kind: str, subject: Subject, spec: RigSpec, limits: Limits, starts: int) -> str:
    """One design as a line of the table."""
    began = time.process_time()
    found = design(
        subject, spec.camera, limits, count=spec.count, seed=spec.seed, starts=starts,
        strategy=Strategy.EXCHANGE,
    )  # fmt: skip
    spent, quality, pairs = time.process_time() - began, found.quality, found.quality.matchable
    broken = sorted({r.family for r in quality.violated})
    sizes = " + ".join(str(len(group)) for group in pairs.groups)
    return (
        f"| {spec.count} | {kind} | {'yes' if quality.feasible else 'no: ' + ', '.join(broken)} "
        f"| {1e3 * quality.cost_mm2:.3f} | {1e3 * quality.sigma_median_mm:.1f} "
        f"| {1e3 * quality.sigma_p95_mm:.1f} | {pairs.share(1):.2%} | {pairs.share(2):.2%} "
        f"| {sizes} | {spent:.0f} |"
    )


def main() -> None:
    """Run all counts and print or write the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--scan", type=Path, help="a head scan; the bundled head without it")
    parser.add_argument("--starts", type=int, default=4)
    parser.add_argument("--counts", type=int, nargs="+", default=COUNTS, metavar="N")
    parser.add_argument("--out", type=Path, help="write the table to this file")
    chosen = parser.parse_args()
    spec = example_rig("face")
    scan = synthetic_head() if chosen.scan is None else read_scan(chosen.scan, spec.scan_options)
    subject = prepare_subject(scan, replace(spec.subject_options, seed=spec.seed)).subject
    matching = replace(spec.limits.matching, required=True)
    asked = replace(spec.limits, roll=Roll.LEVEL_OR_PORTRAIT, matching=matching)
    table = [HEAD, "|---|---|---|---|---|---|---|---|---|---|"]
    for count in chosen.counts:
        for kind, limits in (("matchable, straight", asked), ("as the example", spec.limits)):
            table.append(line(kind, subject, spec.with_count(count), limits, chosen.starts))
            print(table[-1], flush=True)
    if chosen.out:
        name = "the bundled head" if chosen.scan is None else chosen.scan.name
        words = (
            "# Designs that a matcher can hold together\n\n"
            f"Head: {name}. Strategy `exchange`, {chosen.starts} starts, one process. *Matchable, "
            'straight*: the limits of the example face rig with `roll = "level-or-portrait"` and '
            "`[matching] required = true`, so that 99.5 % of what can be matched is in a pair of "
            "cameras that can match it, and all cameras are one group. *As the example*: without "
            "both, for the price. Shares are of the points that any two cameras could match.\n\n"
        )
        given = "" if chosen.scan is None else " --scan HEAD"
        command = f"python -m benchmarks.matchable{given} --out {chosen.out}"
        chosen.out.write_text(
            f"{words}{chr(10).join(table)}\n\nMade by `{command}`.\n", encoding="utf-8"
        )


if __name__ == "__main__":
    main()
