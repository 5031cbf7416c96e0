"""What a page of another origin can do with this service from a real browser: nothing."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import TYPE_CHECKING

import httpx2
import pytest
from browsers import chromium
from prometheus_client.parser import text_string_to_metric_families
from service_helpers import StartServer, wait_for
from stations import write_station

if TYPE_CHECKING:
    from playwright.sync_api import Page

REBOUND = "rebound.example"
# A name of the page's own that leads to this machine.
REBINDING = f"--host-resolver-rules=MAP {REBOUND} 127.0.0.1"
ATTACKS = """async ([target, capture, design]) => {
    const send = (path, more) => fetch(target + path, {method: "POST", mode: "no-cors", ...more})
        .catch(() => null);
    const form = new FormData();
    form.append("file", new Blob(["v 0 0 0"]), "a.obj");
    const json = JSON.stringify({to: 3});
    const bodies = [
        {}, {body: json}, {body: form}, {body: new URLSearchParams({a: "b"})},
        {body: new Blob([json], {type: "application/json"})},
        {body: new Blob([json])}, {body: json, headers: {"Content-Type": "application/json"}},
        {body: json, headers: {"X-Rigwright": "1"}}, {mode: "cors", headers: {"X-Rigwright": "1"}},
        {mode: "cors", body: json, headers: {"Content-Type": "application/json"}},
    ];
    const paths = ["/v1/rigs/studio/abort", "/v1/rigs/studio/reset", "/v1/counts",
        "/v1/rigs/studio/captures", "/v1/scans?filename=a.obj", "/v1/picture-sets",
        "/v1/target-sets", design + "/cancel"];
    for (const path of paths) for (const body of bodies) await send(path, body);
    await fetch(target + capture, {method: "DELETE"}).catch(() => null);
    for (const path of paths) navigator.sendBeacon(target + path, json);
    const frame = document.createElement("iframe");
    frame.name = "sink";
    document.body.append(frame);
    for (const enctype of ["text/plain", "multipart/form-data"]) {
        const page = document.createElement("form");
        Object.assign(page, {method: "POST", enctype, action: target + paths[2], target: "sink"});
        document.body.append(page);
        page.submit();
    }
}"""
SEEN = """address => new Promise(done => {
    const picture = new Image();
    picture.onload = () => done(picture.naturalWidth);
    picture.onerror = () => done(0);
    picture.src = address;
})"""
READ = """address => fetch(address).then(answer => answer.text(), () => null)"""

pytestmark = [pytest.mark.slow, pytest.mark.needs_browser]


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def page() -> Iterator[Page]:
    with chromium(REBINDING) as browser:
        yield browser.new_page()


@pytest.fixture
def elsewhere(tmp_path: Path) -> Iterator[str]:
    """The origin of somebody else's page."""
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    (folder / "index.html").write_text("<!doctype html><title>Cats</title>", encoding="utf-8")
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=folder)) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://localhost:{server.server_port}/"
        server.shutdown()
        thread.join()


def posts(client: httpx2.Client) -> dict[tuple[str, str], float]:
    """How many requests that change something were answered, by route and status."""
    families = text_string_to_metric_families(client.get("/metrics").text)
    return {
        (sample.labels["route"], sample.labels["status"]): sample.value
        for family in families
        for sample in family.samples
        if sample.name == "rigwright_requests_total" and sample.labels["method"] != "GET"
    }


def test_a_page_of_another_origin_changes_nothing_and_sees_nothing(
    start_server: StartServer, tmp_path: Path, page: Page, elsewhere: str
) -> None:
    station = write_station(tmp_path / "in")
    server = start_server(stations=station)
    with server.client() as client:
        wait_for(lambda: client.get("/v1/ready").status_code == 200)
        client.post("/v1/rigs/studio/captures", json={"capture_id": "one"})
        wait_for(lambda: client.get("/v1/captures/one").json()["status"] == "completed")
        counting = client.post("/v1/counts", json={"to": 100_000}).headers["Location"]
        own = posts(client)
        record = client.get("/v1/captures/one").json()["result"]["record"]
        picture = f"{server.url}/v1/sessions/one/files/{record['frames'][0]['file']['path']}"

        page.goto(elsewhere)
        page.evaluate(ATTACKS, [server.url, "/v1/captures/one", counting])
        # Forms and beacons are sent without waiting for them.
        wait_for(lambda: sum(posts(client).values()) >= sum(own.values()) + 40)
        theirs = {key for key, number in posts(client).items() if number > own.get(key, 0.0)}
        assert {status for _, status in theirs} <= {"403", "405", "415"}
        assert client.get(counting).json()["status"] in ("pending", "running")
        assert client.get(counting).json()["cancel_requested"] is False
        for kind in ("scans", "picture-sets", "target-sets"):
            assert client.get(f"/v1/{kind}").json()["items"] == []

        assert page.evaluate(SEEN, picture) == 0
        assert page.evaluate(READ, picture) is None
        assert page.evaluate(READ, f"{server.url}/v1/captures") is None

        # Whoever asks for it as its own page sees it: it is the origin that is refused.
        shown = page.goto(picture)
        assert shown is not None and shown.status == 200

        port = server.url.rpartition(":")[2]
        for path in ("/v1", "/v1/rigs"):
            rebound = page.goto(f"http://{REBOUND}:{port}{path}")
            assert rebound is not None and rebound.status == 421
        client.post(f"{counting}/cancel")
