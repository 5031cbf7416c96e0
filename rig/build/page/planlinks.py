"""The files that lie beside a plan's page, as a section of links."""

from __future__ import annotations

from collections.abc import Mapping
from urllib.parse import quote

from common.page.html import element, esc, section, table

SHOWN = (".pdf", ".csv", ".txt", ".glb", ".3mf")
ONE_CAMERA = "settings/sheet-"
WORDS = (
    "They lie in the folder of this page. Drawings are there as SVG and DXF too, lists as JSON, "
    "printed parts as STL, and the sheet of each camera by itself; manifest.json names all."
)


def shown_files(files: Mapping[str, str]) -> dict[str, str]:
    """Of all files those that a reader opens, each in one format, the steps first."""
    shown = {
        name: words
        for name, words in files.items()
        if name.endswith(SHOWN) and not name.startswith(ONE_CAMERA)
    }
    return dict(sorted(shown.items(), key=lambda item: not item[0].endswith(".txt")))


def files_section(files: Mapping[str, str]) -> str:
    """Links to the files by their path from the page; empty where there are none."""
    shown = shown_files(files)
    if not shown:
        return ""
    rows = [
        (element("a", esc(name), href=quote(name)), esc(words)) for name, words in shown.items()
    ]
    return section("files", "Files", WORDS, table(("File", "What it holds"), rows))
