"""How soon the page of a service is there and answers, in a real browser.

``python -m benchmarks.page`` needs Debian's chromium. It starts services of its own with nine
simulated cameras, designs a nine-camera rig meanwhile, and prints a table. All times are by the
clock, so the computer has to be quiet: the load it had is told below the table.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import httpx2
import numpy as np
from browsers import chromium
from page_visits import Visit, served
from stations import write_station

from benchmarks.pages import table
from geometry.head import synthetic_head
from rig.specification.examples import example_text
from service.tasks.designing import write_scan

if TYPE_CHECKING:
    from playwright.sync_api import Browser

CAMERAS = 9
WIDTH_PX = 960
REQUESTS_PER_S = 20
SECONDS = 15
DESIGNS = 12
"""One follows the other, so that a rig is designed all the time."""

REPEATS = 5
VIEWS = ("Sessions", "Calibration", "Surface", "Design", "Studies", "Build", "Rig")
READ = ("", "page/start.js", "v1/health", "v1/ready", "v1/rigs", "v1/sessions", "v1/captures",
        "v1/designs", "v1/scans", "v1/target-sets")  # fmt: skip

# From the press until the heading of the new view has been painted.
_CLICK = """name => new Promise(resolve => {
  const link = [...document.querySelectorAll('nav a')].find(a => a.textContent === name);
  const main = document.getElementById('content');
  const old = main.firstElementChild;
  const began = performance.now();
  const look = () => main.firstElementChild !== old && main.querySelector('h1')
    ? requestAnimationFrame(() => resolve(performance.now() - began)) : requestAnimationFrame(look);
  link.click();
  look();
})"""
_SHEET = f"""before => {{
  const name = document.querySelector('.result h2')?.textContent;
  const all = [...document.querySelectorAll('.result .sheet img')];
  return name && name !== before && all.length === {CAMERAS}
    && all.every(one => one.complete && one.naturalWidth > 0);
}}"""


@dataclass(frozen=True)
class Measured:
    """What was measured, the share of cases that the limit is for, and the limit itself."""

    what: str
    times_ms: list[float]
    limit_ms: float
    share: float = 1.0

    def row(self) -> tuple[str, ...]:
        """A row of the table."""
        middle, most = (float(np.quantile(self.times_ms, q)) for q in (0.5, self.share))
        which = "most" if self.share == 1.0 else f"p{100.0 * self.share:.0f}"
        told = "yes" if most <= self.limit_ms else "**no**"
        return (self.what, str(len(self.times_ms)), f"{middle:.0f} ms",
                f"{most:.0f} ms ({which})", f"{self.limit_ms:.0f} ms", told)  # fmt: skip


@contextmanager
def one_core() -> Iterator[None]:
    """What is started here shares one core."""
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)


def _done(method: str, address: str, **more: Any) -> Any:
    """What a service answers. Without the mark it takes a request for one of another web page."""
    answer = httpx2.request(method, address, headers={"X-Rigwright": "1"}, timeout=60.0, **more)
    answer.raise_for_status()
    return answer.json()


def page_ready(folder: Path) -> Measured:
    """Browser and service on one core: until the rig, its box and the service's state are shown."""
    times_ms = []
    station = write_station(folder / "rig", cameras=CAMERAS)
    with one_core(), served(folder / "data", station) as address, chromium() as browser:
        for _ in range(1 + REPEATS):
            one = Visit(browser, address)
            one.see("Trigger box: ready")
            one.page.locator("#service.good").wait_for()
            times_ms.append(float(one.page.evaluate("performance.now()")))
            one.page.context.close()
    # The first is the browser's own start, and finds the rig still being opened.
    return Measured("page ready, on one core", times_ms[1:], 1500.0)


def contact_sheet(browser: Browser, address: str, sessions: Path) -> Measured:
    """From when the last picture of a capture was written to disk until all are painted."""
    times_ms = []
    one = Visit(browser, address)
    one.see("Trigger box: ready")
    shown = ""
    for _ in range(REPEATS):
        one.page.locator("button.fire:enabled").click()
        one.page.wait_for_function(_SHEET, arg=shown, polling="raf")
        seen_s = time.time()
        shown = one.page.locator(".result h2").inner_text()
        newest = _done("GET", f"{address}v1/captures?limit=1")["items"][0]
        folder = sessions / newest["result"]["session"]
        frames = newest["result"]["record"]["frames"]
        last_s = max((folder / frame["file"]["path"]).stat().st_mtime for frame in frames)
        times_ms.append(1e3 * (seen_s - last_s))
    one.page.context.close()
    return Measured(f"contact sheet of {CAMERAS} pictures, from the last", times_ms, 1000.0)


def design_body(address: str, folder: Path) -> dict[str, object]:
    """A design of nine cameras that both cores work on for half a minute."""
    head = folder / "head.ply"
    write_scan(synthetic_head(), head)
    scan = _done("POST", f"{address}v1/scans?filename=head.ply", content=head.read_bytes())
    rig = tomllib.loads(example_text("face"))
    return {"scan_id": scan["id"], "rig": rig, "cameras": CAMERAS, "starts": 64}


def first_progress(address: str, body: dict[str, object]) -> Measured:
    """From asking for a design until its first progress is heard."""
    times_ms = []
    for _ in range(REPEATS):
        began_s = time.monotonic()
        job = _done("POST", f"{address}v1/designs", json=body)
        own = f"{address.rstrip('/')}{job['links']['events']}"
        with httpx2.stream("GET", own, timeout=60.0) as events:
            next(line for line in events.iter_lines() if line == "event: progress")
        times_ms.append(1e3 * (time.monotonic() - began_s))
        end(address, job["id"])
    return Measured("first progress of a design", times_ms, 1000.0)


def begun(address: str, body: dict[str, object]) -> list[str]:
    """Designs that wait for one another; returns when the first one solves."""
    designs = [
        str(_done("POST", f"{address}v1/designs", json=body | {"seed": seed})["id"])
        for seed in range(DESIGNS)
    ]
    # Before that it reads the scan, on one core alone.
    while (_done("GET", f"{address}v1/designs/{designs[0]}")["progress"] or {}).get(
        "start", -1
    ) < 0:
        time.sleep(0.1)
    return designs


def end(address: str, design: str) -> None:
    """Stop a design, if it has not ended, and wait until it has stopped."""
    if _done("GET", f"{address}v1/designs/{design}")["status"] in ("pending", "running"):
        _done("POST", f"{address}v1/designs/{design}/cancel")
    while _done("GET", f"{address}v1/designs/{design}")["status"] in ("pending", "running"):
        time.sleep(0.05)


def clicks(browser: Browser, address: str) -> Measured:
    """From a press in the navigation until the view is there, with what the service says."""
    one = Visit(browser, address)
    one.see("Trigger box: ready")
    times_ms = [float(one.page.evaluate(_CLICK, view)) for _ in range(REPEATS) for view in VIEWS]
    one.page.context.close()
    return Measured("click to another view, while a rig is designed", times_ms, 100.0)


def requests(address: str) -> Measured:
    """What only reads, at a steady rate that waits for no answer."""
    with httpx2.Client(base_url=address) as client, ThreadPoolExecutor(16) as pool:

        def ask(path: str) -> float:
            began_s = time.monotonic()
            client.get(path).raise_for_status()
            return 1e3 * (time.monotonic() - began_s)

        begun_s = time.monotonic()
        asked = []
        for k in range(SECONDS * REQUESTS_PER_S):
            time.sleep(max(0.0, begun_s + k / REQUESTS_PER_S - time.monotonic()))
            asked.append(pool.submit(ask, READ[k % len(READ)]))
        times_ms = [one.result() for one in asked]
    return Measured(f"{REQUESTS_PER_S} requests a second, while a rig is designed",
                    times_ms, 50.0, 0.99)  # fmt: skip


def measured(folder: Path) -> list[Measured]:
    """All of it, one after the other."""
    found = [page_ready(folder)]
    data = folder / "full"
    with served(
        data, write_station(folder / "nine", cameras=CAMERAS, width_px=WIDTH_PX)
    ) as address:
        body = design_body(address, folder)
        with chromium() as browser:
            found.append(contact_sheet(browser, address, data / "sessions"))
            found.append(first_progress(address, body))
            designs = begun(address, body)
            found.append(clicks(browser, address))
        found.append(requests(address))
        if _done("GET", f"{address}v1/designs/{designs[-1]}")["status"] != "pending":
            raise SystemExit("the designs ended before all was asked: ask for more")
        for design in reversed(designs):
            end(address, design)
    return found


def main() -> None:
    """Measure and print."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as folder:
        found = measured(Path(folder))
    head = ("what", "times", "median", "at most", "limit", "held")
    print(table(head, [one.row() for one in found]))
    print(f"{os.cpu_count()} cores; load before it began: {load:.1f}.")


if __name__ == "__main__":
    main()
