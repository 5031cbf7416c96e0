"""The commands and snippets of the pages: known to the program, and those of the README run."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import typer

from service.cli import app
from service.reference.pictures import RECORD, SHOTS, headings_of
from service.reference.walk import FENCE, Step, steps_of, walked

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    ROOT / "README.md",
    *sorted((ROOT / "docs").rglob("*.md")),
    *sorted((ROOT / "examples").rglob("*.md")),
]
INLINE = re.compile(r"(?<!`)`(rigwright [^`\n]+)`(?!`)")
PICTURES = ROOT / "docs" / "pictures" / RECORD
STALE = "run python -m service.reference.pictures docs/pictures"
KINDS = {"sh", "python", "toml", "json", "text", "http", "yaml", "xml", "csv"}


@dataclass(frozen=True)
class Command:
    """A command as it is printed."""

    page: str
    line: str

    @property
    def words(self) -> list[str]:
        """What the shell makes of it, as far as it is of rigwright."""
        words = shlex.split(self.line, comments=True)
        ends = [k for k, word in enumerate(words) if word in ("|", "&", "&&", ";", ">", "…", "...")]
        return words[1 : min(ends, default=len(words))]


def commands() -> Iterator[Command]:
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        name = str(page.relative_to(ROOT))
        for _, block in FENCE.findall(text):
            for line in block.replace("\\\n", " ").splitlines():
                if line.startswith("rigwright "):
                    yield Command(name, line)
        for line in INLINE.findall(FENCE.sub("", text)):
            yield Command(name, line)


COMMANDS = list(commands())


def options_of(words: list[str]) -> tuple[set[str], list[str]]:
    """The options of the command that words name, and the rest of the words."""
    found: Any = typer.main.get_command(app)
    while (below := getattr(found, "commands", None)) and words and not words[0].startswith("-"):
        assert words[0] in below, f"there is no command {words[0]}"
        found, words = below[words[0]], words[1:]
    names = {name for p in found.params for name in (*p.opts, *p.secondary_opts)}
    return names | {"--help"}, words


def test_there_are_commands_on_the_pages() -> None:
    assert len(COMMANDS) > 25


@pytest.mark.parametrize("command", COMMANDS, ids=lambda c: f"{c.page}: {c.line}")
def test_every_command_on_a_page_exists_with_its_options(command: Command) -> None:
    known, rest = options_of(command.words)
    for word in rest:
        if word.startswith("--"):
            assert word.partition("=")[0] in known, word


def test_every_block_says_what_it_is() -> None:
    for page in PAGES:
        for kind, block in FENCE.findall(page.read_text(encoding="utf-8")):
            assert kind in KINDS, f"{page.relative_to(ROOT)}: {block[:40]!r}"


FIRST_STEPS = ("design", "build", "capture", "calibrate", "check", "accept")
WALKED = [ROOT / "README.md", *(ROOT / "docs" / "first-steps" / f"{n}.md" for n in FIRST_STEPS)]


def steps() -> tuple[Step, ...]:
    """The README's commands, then those of the first steps; what was done is not done again."""
    return tuple(dict.fromkeys(step for page in WALKED for step in steps_of(page)))


def programs() -> Path:
    """Where the ``rigwright`` that is to be tried stands."""
    return Path(os.environ.get("RIGWRIGHT_BIN") or Path(sys.executable).parent)


def test_the_first_steps_have_a_page_for_each_job() -> None:
    for page in WALKED[1:]:
        assert steps_of(page), page.name
    # Every command of the README's first hour belongs to one of the jobs, bar looking at figures.
    jobs = {step.line for page in WALKED[1:] for step in steps_of(page)}
    others = [s.line for s in steps_of(WALKED[0]) if s.line not in jobs]
    assert others == ["rigwright catalogue canon", EXPORT]


EXPORT = "rigwright export my-rig --format colmap-text --out my-colmap"


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_the_first_hour_runs_as_printed(tmp_path: Path) -> None:
    assert len(steps()) >= 20
    assert len(list(walked(steps(), tmp_path, programs()))) == len(steps())
    demo = {path.name for path in (tmp_path / "demo").iterdir()}
    assert demo > {"design.json", "report.html", "head.ply", "face.toml", "station.toml"}
    for shot, told in json.loads(PICTURES.read_text(encoding="utf-8")).items():
        source = next(s.source for s in SHOTS if s.name == shot)
        made = headings_of(tmp_path / source) if source.endswith("html") else []
        assert made == told["headings"], f"{shot} shows another page: {STALE}"
    for kind, page, block in snippets():
        done = subprocess.run(
            [programs() / "python", "-c", block],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{page} ({kind})\n{done.stderr[-2000:]}"


def snippets() -> list[tuple[str, str, str]]:
    """The Python of the pages: kind, page, text."""
    return [
        (kind, str(page.relative_to(ROOT)), block)
        for page in PAGES
        for kind, block in FENCE.findall(page.read_text(encoding="utf-8"))
        if kind == "python"
    ]


def test_the_readme_says_what_git_ignores() -> None:
    lines = " ".join(step.line for step in steps())
    outputs = re.findall(r"--(?:out|session|history) (\S+)", lines)
    assert len(outputs) > 10
    names = [f"{name}/x" for name in outputs]
    done = subprocess.run(
        ["git", "check-ignore", "--no-index", *names],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode == 128:
        pytest.skip("not a git checkout")
    assert done.stdout.split() == names
