"""Every link of the pages leads somewhere, and every page can be reached."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted(
    path
    for place in (
        ".",
        "docs",
        "examples",
        "rig/firmware",
        "tests/simulators",
        "solver",
        "benchmarks",
    )
    for path in (ROOT / place).glob("*.md" if place == "." else "**/*.md")
    if "node_modules" not in path.parts
)
LINK = re.compile(r"\]\(([^)\s]+)\)")
CODE = re.compile(r"^```.*?^```|`[^`\n]*`", re.DOTALL | re.MULTILINE)


IN_A_SESSION = {"rig/rig_config.json"}
"""Files that stand in a session, whose folder ``rig`` is not ours."""


def links(page: Path) -> Iterator[tuple[str, Path, str]]:
    """Each link of a page into the project: as written, its file, its anchor."""
    for link in LINK.findall(CODE.sub("", page.read_text(encoding="utf-8"))):
        if not re.match(r"[a-z]+:", link):
            path, _, anchor = link.partition("#")
            yield link, (page.parent / path).resolve() if path else page, anchor


def anchors(page: Path) -> set[str]:
    """The anchors that headings of a page get where Markdown is shown."""
    heads = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_somewhere(page: Path) -> None:
    for link, path, anchor in links(page):
        assert path.exists(), link
        assert path.is_relative_to(ROOT), link
        assert not anchor or anchor in anchors(path), link


def test_every_page_of_the_docs_can_be_reached_from_their_index() -> None:
    index = ROOT / "docs" / "README.md"
    seen, left = {index}, [index]
    while left:
        for _, path, _ in links(left.pop()):
            new = set(path.glob("*.md")) if path.is_dir() else {path}
            left += [page for page in new - seen if page.suffix == ".md"]
            seen |= new
    assert sorted(set((ROOT / "docs").rglob("*.md")) - seen) == []


def test_pages_name_files_that_exist() -> None:
    tops = "common|geometry|solver|rig|calibration|evaluation|service|benchmarks|tests|examples"
    told = re.compile(rf"`((?:{tops})/[\w/.-]*)`")
    named = [(page, name) for page in PAGES for name in told.findall(page.read_text("utf-8"))]
    assert len(named) > 40
    for page, name in named:
        if name in IN_A_SESSION:
            continue
        place = ROOT / name
        there = place.exists() or place.with_suffix(".py").exists()
        assert there, f"{page.relative_to(ROOT)} names {name}"


def test_code_names_pages_that_exist() -> None:
    told = re.compile(r"docs/[\w./-]*\w\.(?:md|json|svg|png|jpg)\b")
    named = [
        (path, page)
        for place in ("common", "geometry", "solver", "rig", "calibration", "service", "benchmarks")
        for kind in ("*.py", "*.toml", "*.c", "*.h", "*.md")
        for path in (ROOT / place).rglob(kind)
        for page in told.findall(path.read_text(encoding="utf-8"))
    ]
    assert len(named) > 20
    for path, page in named:
        assert (ROOT / page).exists(), f"{path.relative_to(ROOT)} names {page}"
