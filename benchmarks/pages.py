"""Tables of measured figures, written between marks of a page."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def write_between(path: Path, mark: str, text: str) -> None:
    """Replace what stands between ``<!-- mark -->`` and ``<!-- end of mark -->`` in a page."""
    page = path.read_text(encoding="utf-8")
    marked = re.compile(rf"(<!-- {mark} -->\n).*?(<!-- end of {mark} -->)", re.DOTALL)
    page, found = marked.subn(lambda marks: f"{marks[1]}{text.rstrip()}\n{marks[2]}", page)
    if not found:
        raise SystemExit(f"{path} has no <!-- {mark} --> and <!-- end of {mark} -->")
    path.write_text(page, encoding="utf-8")
