"""Do the tests bite? Small faults are planted in named modules one by one, and the tests run.

    python -m benchmarks.mutation                         the modules of TARGETS
    python -m benchmarks.mutation solver/nlp/penalty.py tests/solver/nlp

mutmut plants the faults, in a copy of the project, and runs only the tests that reach the function
it changed. Properties and decorated functions are not mutated, nor are constants of modules.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import tomlkit

ROOT = Path(__file__).resolve().parents[1]
TARGETS = {
    "solver/coverage": ("tests/solver/coverage",),
    "rig/build/mounts/tolerancing.py": ("tests/rig/build/mounts",),
}
"""Modules or packages, and the quick tests that have to notice faults in them."""

LEAST_SHARE = 0.80
SURVIVED = (0, 5, 33, None)
"""Exit codes of tests that noticed nothing: passed, none collected, no test reaches it, not run."""

COPIED = ("common", "geometry", "solver", "rig", "calibration", "evaluation", "service")


@dataclass(frozen=True)
class Survivors:
    """Faults planted in one module, how many were noticed, and the names of the others."""

    planted: int
    killed: int
    alive: tuple[str, ...]

    @property
    def share(self) -> float:
        """Share of the planted faults that the tests noticed."""
        return self.killed / self.planted if self.planted else 1.0


def mutate(target: str, tests: tuple[str, ...], children: int) -> Survivors:
    """Plant faults in ``target`` (a file or a folder) and run ``tests`` against each."""
    with tempfile.TemporaryDirectory(prefix="mutation-") as folder:
        copy = Path(folder)
        _copy_project(copy, target, tests)
        # Made before Python starts, which forgets folders of its path that it did not find.
        (copy / "mutants").mkdir()
        environment = os.environ | {"PYTHONPATH": str(copy / "mutants")}
        command = [sys.executable, "-m", "mutmut", "run", "--max-children", str(children)]
        done = subprocess.run(  # noqa: S603 - our own interpreter
            command, cwd=copy, env=environment, capture_output=True, text=True, check=False
        )
        found = _read(copy / "mutants" / target)
        if found.planted == 0:
            raise SystemExit(done.stdout[-4000:] + done.stderr[-4000:])
        return found


def _copy_project(copy: Path, target: str, tests: tuple[str, ...]) -> None:
    for name in (*COPIED, "benchmarks", "tests"):
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    project = tomlkit.parse(text)
    top = target.split("/", 1)[0]
    pattern = target if target.endswith(".py") else f"{target}/*"
    project["tool"]["mutmut"] = {
        "source_paths": [top],
        "only_mutate": [pattern],
        "also_copy": [n for n in (*COPIED, "benchmarks") if n != top and (copy / n).is_dir()],
        "pytest_add_cli_args_test_selection": list(tests),
        "pytest_add_cli_args": ["-m", "not slow", "-p", "no:cacheprovider"],
        "use_git_change_detection": False,
        "track_dependencies": False,
    }
    (copy / "pyproject.toml").write_text(tomlkit.dumps(project), encoding="utf-8")


def _read(where: Path) -> Survivors:
    """Exit codes of the tests per fault, which mutmut keeps beside each module that it changed."""
    files = [where.with_name(where.name + ".meta")]
    if where.is_dir():
        files = sorted(where.rglob("*.py.meta"))
    codes: dict[str, int | None] = {}
    for file in files:
        if file.exists():
            codes |= json.loads(file.read_text(encoding="utf-8"))["exit_code_by_key"]
    alive = tuple(sorted(name for name, code in codes.items() if code in SURVIVED))
    return Survivors(len(codes), len(codes) - len(alive), alive)


def main() -> None:
    """Print what survived, and fail where too much did."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("target", nargs="?")
    options.add_argument("tests", nargs="*")
    options.add_argument("--children", type=int, default=1, help="processes side by side")
    chosen = options.parse_args()
    targets = {chosen.target: tuple(chosen.tests)} if chosen.target else TARGETS
    poor = False
    for target, tests in targets.items():
        found = mutate(target, tests or TARGETS[target], chosen.children)
        print(f"{target}: {found.killed} of {found.planted} faults noticed, {found.share:.1%}")
        for name in found.alive:
            print(f"  survived: {name}")
        poor |= found.share < LEAST_SHARE
    sys.exit(poor)


if __name__ == "__main__":
    main()
