"""A browser at the page of a service that really runs, and all that it said and asked for."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

ROOT = Path(__file__).resolve().parents[2]


class Serving:
    """A service in a process of its own, which can be killed and begun again at its address."""

    def __init__(self, data: Path, *stations: Path, more: tuple[str, ...] = ()) -> None:
        self.address = ""
        self._log = data.parent / "service.log"
        self._command = [sys.executable, "-m", "service.cli", "serve", "--data", str(data)]
        for station in stations:
            self._command += ["--station", str(station)]
        self._command += more

    def begin(self) -> None:
        """Start it; returns when it answers."""
        port = urlsplit(self.address).port or 0
        with self._log.open("a") as log:
            self._process = subprocess.Popen(
                [*self._command, "--port", str(port)],
                stdout=subprocess.PIPE, stderr=log, text=True, cwd=ROOT,
            )  # fmt: skip
        assert self._process.stdout is not None
        self.address = self._process.stdout.readline().split()[3].removesuffix("/v1;") + "/"

    def end(self, how: signal.Signals = signal.SIGTERM) -> None:
        """End it, and wait until it has."""
        with self._process as process:
            process.send_signal(how)


@contextmanager
def served(data: Path, *stations: Path, more: tuple[str, ...] = ()) -> Iterator[str]:
    """The address of a service with these stations."""
    serving = Serving(data, *stations, more=more)
    serving.begin()
    try:
        yield serving.address
    finally:
        serving.end()


class Visit:
    """One person at one browser."""

    def __init__(self, browser: Browser, address: str, width: int = 1440) -> None:
        context = browser.new_context(viewport={"width": width, "height": 900})
        context.set_default_timeout(120_000)
        self.page: Page = context.new_page()
        self.address = address
        self.faults: list[str] = []
        self.foreign: list[str] = []
        self.page.on("console", lambda m: self.faults.append(m.text) if m.type == "error" else None)
        self.page.on("pageerror", lambda error: self.faults.append(str(error)))
        self.page.on("request", self._asked)
        self.page.goto(address)

    def _asked(self, request: object) -> None:
        url = str(request.url)
        if not url.startswith((self.address, "data:", "blob:")):
            self.foreign.append(url)

    def go(self, view: str) -> None:
        self.page.get_by_role("navigation").get_by_role("link", name=view, exact=True).click()

    def press(self, name: str) -> None:
        self.page.get_by_role("button", name=name, exact=True).click()

    def see(self, words: str) -> None:
        self.page.get_by_text(words).first.wait_for()

    def sound(self) -> None:
        """Nothing was said on the console, nobody else was asked, and everybody can read it."""
        from axe_playwright_python.sync_playwright import Axe

        rules = {"runOnly": {"type": "tag", "values": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa"]}}
        found = Axe().run(self.page, options={**rules, "iframes": False})
        told = [f"{v['id']}: {v['nodes'][0]['html'][:200]}" for v in found.response["violations"]]
        assert told == [], told
        assert self.faults == [], self.faults
        assert self.foreign == []
