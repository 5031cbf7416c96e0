"""Pictures of the pages for the README: ``python -m service.reference.pictures docs/pictures``.

Runs the commands of the README in a new folder and photographs what they leave, which takes a
quarter of an hour; ``--walked FOLDER`` takes a folder in which they were run. Beside the pictures
``pictures.json`` says what they were made from, so that a test can tell when they are stale.
Needs Debian's chromium.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from html import unescape
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from PIL import Image

from calibration.report.pages import STYLE
from service.reference.walk import Step, steps_of, walked

if TYPE_CHECKING:
    from playwright.sync_api import Browser

README = Path(__file__).resolve().parents[2] / "README.md"
RECORD = "pictures.json"
FLAGS = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
WAIT_MS = 300_000.0
PHOTOGRAPH_PX = 900


@dataclass(frozen=True)
class Shot:
    """A picture: what it shows of what the README's commands leave.

    ``source`` is a page, of which the top is taken at ``size_px``, or with ``element`` that element
    of it; or a photograph, found by a pattern.
    """

    name: str
    source: str
    size_px: tuple[int, int] = (1180, 900)
    element: str = ""


SHOTS = (
    Shot("rig.png", "demo/report.html", (1180, 900), "#rig-3d"),
    Shot("plan.png", "my-plan/plan.html", (1180, 1000)),
    Shot("captured.jpg", "sessions/first/images/*/cam04/*.jpg"),
    Shot("calibration.png", "my-calibration/report.html", (1024, 1300)),
    Shot("check.png", "check-wednesday/report.html", (1024, 760)),
)


def steps_to(shot: Shot, steps: tuple[Step, ...]) -> tuple[Step, ...]:
    """The steps up to the one that makes what is shown."""
    folder = "/".join(shot.source.split("/")[: 2 if shot.source.startswith("sessions") else 1])
    makes = re.compile(rf"--(?:out|session) {re.escape(folder)}(?:\s|$)")
    last = next(k for k, step in enumerate(steps) if makes.search(step.line))
    return steps[: last + 1]


def looks(shot: Shot) -> str:
    """Styles and scripts of what is shown: they decide how it looks."""
    if not shot.source.endswith(".html"):
        return ""
    if shot.source.startswith(("my-calibration", "check")):
        return STYLE
    own = [("rig.build.page", "plan.css"), ("rig.build.page", "plan.js")]
    if shot.source.startswith("demo"):
        own = [("rig.report", "page.js")]
    parts = [("common.page", "style.css"), *own]
    return "".join(files(p).joinpath(name).read_text(encoding="utf-8") for p, name in parts)


def inputs_digest(shot: Shot, steps: tuple[Step, ...]) -> str:
    """A digest of what a picture is made from: commands, styles and scripts."""
    lines = "\n".join(step.line for step in steps_to(shot, steps))
    return hashlib.sha256(f"{shot}\n{lines}\n{looks(shot)}".encode()).hexdigest()


def headings_of(page: Path) -> list[str]:
    """Headings of a page without their figures, which differ from run to run."""
    text = page.read_text(encoding="utf-8").partition("\n<script>")[0]
    found = re.findall(r"<(h[123])\b[^>]*>(.*?)</\1>", text, re.DOTALL)
    plain = (unescape(re.sub(r"<[^>]+>|\d[\d:.TZ+-]*", "", words)) for _, words in found)
    return [" ".join(words.split()) for words in plain]


def record_of(walk: Path, steps: tuple[Step, ...]) -> dict[str, dict[str, object]]:
    """What ``pictures.json`` holds: by picture its inputs' digest and its page's headings."""
    return {
        shot.name: {
            "inputs": inputs_digest(shot, steps),
            "headings": headings_of(walk / shot.source) if shot.source.endswith("html") else [],
        }
        for shot in SHOTS
    }


def write_pictures(walk: Path, out: Path) -> Iterator[Path]:
    """Photograph what stands in a folder in which the README's commands were run."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=list(FLAGS)
        )
        for shot in SHOTS:
            path = out / shot.name
            if shot.source.endswith(".html"):
                _page(browser, walk / shot.source, shot, path)
            else:
                _photograph(next(iter(sorted(walk.glob(shot.source)))), path)
            yield path
        browser.close()
    record = json.dumps(record_of(walk, steps_of(README)), indent=1)
    (out / RECORD).write_text(record + "\n", encoding="utf-8")


def _page(browser: Browser, source: Path, shot: Shot, path: Path) -> None:
    width, height = shot.size_px
    page = browser.new_page(viewport={"width": width, "height": height}, color_scheme="light")
    page.set_default_timeout(WAIT_MS)
    page.goto(source.resolve().as_uri(), wait_until="commit")
    if "data-view" in source.read_text(encoding="utf-8"):
        page.wait_for_selector("body[data-ready]")
    page.wait_for_load_state("load")
    if shot.element:
        page.locator(shot.element).screenshot(path=path)
    else:
        page.screenshot(path=path)
    page.close()


def _photograph(source: Path, path: Path) -> None:
    with Image.open(source) as picture:
        picture.thumbnail((PHOTOGRAPH_PX, PHOTOGRAPH_PX))
        picture.convert("RGB").save(path, quality=85)


def main(out: Path, walk: Path | None) -> None:
    """Walk unless that was done, then write all pictures."""
    with tempfile.TemporaryDirectory() as folder:
        if walk is None:
            walk = Path(folder)
            for step in walked(steps_of(README), walk):
                sys.stdout.write(f"{step.line}\n")
        for path in write_pictures(walk, out):
            sys.stdout.write(f"{path}\n")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--walked", type=Path, help="a folder in which the commands were run")
    asked = parser.parse_args()
    main(asked.out, asked.walked)
