"""The curl lines of the pages: what they post, the service takes."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from starlette.datastructures import Headers

from service.api.gate import wrong_type

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
LINE = re.compile(r"(?:^|`)(curl (?:\\\n|[^`\n])*)", re.MULTILINE)
BODY = ("-d", "--data", "--data-binary", "--data-raw", "--json", "-F", "--form")
FORM = "application/x-www-form-urlencoded"
"""What curl says of a body of which it is told nothing."""


def posts() -> list[tuple[str, str]]:
    """Page and line of every curl that posts."""
    lines = [
        (str(page.relative_to(ROOT)), line.replace("\\\n", " "))
        for page in PAGES
        for line in LINE.findall(page.read_text(encoding="utf-8"))
    ]
    return [(page, line) for page, line in lines if {*BODY, "POST"} & set(words_of(line))]


def words_of(line: str) -> list[str]:
    # Python between apostrophes may go on in the next line; what is of curl stands before it.
    try:
        return shlex.split(line)
    except ValueError:
        return line.split()


def headers_of(words: list[str]) -> Headers:
    given = [
        words[k + 1].partition(":") for k, word in enumerate(words) if word in ("-H", "--header")
    ]
    told = {name.strip().lower(): value.strip() for name, _, value in given}
    return Headers({"content-type": FORM, **told} if set(BODY) & set(words) else told)


def test_there_are_posts_on_the_pages() -> None:
    pages = {page for page, _ in posts()}
    assert len(posts()) >= 9
    assert {"docs/first-steps/serve.md", "docs/how-to/api.md"} <= pages


@pytest.mark.parametrize(("page", "line"), posts())
def test_what_a_page_posts_is_taken(page: str, line: str) -> None:
    words = words_of(line)
    address = next(word for word in words if word.startswith("http"))
    assert wrong_type("POST", urlsplit(address).path, headers_of(words)) is None, page
