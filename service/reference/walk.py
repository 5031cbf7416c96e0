"""The README as a path: its commands in order, and what they leave in a folder."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from common.errors import InternalError

FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.DOTALL | re.MULTILINE)
EXIT_CODE = re.compile(r"\s+# exit code (\d+)$")
TOLD = 2000


@dataclass(frozen=True)
class Step:
    """One line for the shell, and the exit code that it should have."""

    line: str
    exit_code: int


def steps_of(page: Path) -> tuple[Step, ...]:
    """The commands in the ``sh`` blocks of a page, in order."""
    steps = []
    for kind, block in FENCE.findall(page.read_text(encoding="utf-8")):
        for line in block.replace("\\\n", " ").splitlines() if kind == "sh" else ():
            told = EXIT_CODE.search(line)
            steps.append(Step(line, int(told[1]) if told else 0))
    return tuple(steps)


def walked(steps: tuple[Step, ...], folder: Path, programs: Path | None = None) -> Iterator[Step]:
    """Each step as soon as it is done in the folder; ``programs`` holds the command ``rigwright``.

    Raises :class:`InternalError` where one ends with another exit code than is printed.
    """
    programs = programs or Path(sys.executable).parent
    env = {**os.environ, "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}"}
    for step in steps:
        done = subprocess.run(  # noqa: S603 - commands of our own page
            ["/bin/bash", "-c", step.line],
            cwd=folder,
            env=env,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode != step.exit_code:
            raise InternalError(
                "walk",
                f"{step.line} ended with {done.returncode}: {done.stdout[-TOLD:]} "
                f"{done.stderr[-TOLD:]}",
                "mend the command or the page",
            )
        yield step
