"""How long all files of a plan take: ``python benchmarks/plan_files.py PLAN.json ...``."""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

from rig.build.folder.planfolder import write_plan
from rig.build.mounts.planfile import read_plan


def main(paths: list[str]) -> None:
    """Write each plan's folder to a temporary place and print a row of a table."""
    print("| Plan | Cameras | Files | MB | Wall s | CPU s |\n|---|---|---|---|---|---|")
    for name in paths:
        plan = read_plan(Path(name))
        with tempfile.TemporaryDirectory() as folder:
            wall, cpu = time.perf_counter(), time.process_time()
            files = write_plan(plan, Path(folder) / "plan")
            wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
            size = sum(path.stat().st_size for path in files.values()) / 1e6
        row = (plan.name, len(plan.mounts), len(files), f"{size:.0f}", f"{wall:.1f}", f"{cpu:.1f}")
        print(f"| {' | '.join(map(str, row))} |")


if __name__ == "__main__":
    main(sys.argv[1:])
