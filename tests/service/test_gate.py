"""What foreign web pages, wrong types, large and slow bodies meet."""

from __future__ import annotations

import socket
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from service_helpers import MARKED, LiveServer, StartServer, TestClient

from service.api.app import create_app
from service.api.context import Service
from service.api.limits import LARGEST_BODY_BYTES, PAUSE_S
from service.kinds.queued import QUEUED
from service.settings import read_settings


@pytest.mark.parametrize(
    "host", ["rebound.example", "rebound.example:8000", "", "127.0.0.1.example"]
)
def test_a_foreign_name_is_not_answered(client: TestClient, host: str) -> None:
    answer = client.get("/v1", headers={"Host": host})
    assert (answer.status_code, answer.json()["type"]) == (421, "/problems/input/host")


@pytest.mark.parametrize("host", ["localhost", "127.0.0.1:8000", "[::1]:8000", "192.168.1.7"])
def test_addresses_and_this_machine_are(client: TestClient, host: str) -> None:
    assert client.get("/v1", headers={"Host": host}).status_code == 200


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://localhost:3000"])
@pytest.mark.parametrize("path", ["/v1/rigs/studio/abort", "/v1/designs/one/cancel", "/v1/designs"])
def test_pages_of_other_origins_change_nothing(client: TestClient, path: str, origin: str) -> None:
    answer = client.post(path, json={}, headers={"Origin": origin})
    assert (answer.status_code, answer.json()["type"]) == (403, "/problems/input/origin")


def test_pages_that_are_allowed_may(tmp_path: Path) -> None:
    settings = read_settings(data_dir=tmp_path, allowed_origins="http://lab.example:3000")
    service = Service(settings, QUEUED)
    with TestClient(create_app(service)) as client:
        asked = {"Origin": "http://lab.example:3000", "Access-Control-Request-Method": "POST"}
        asked["Access-Control-Request-Headers"] = "content-type,x-rigwright"
        allowed = client.options("/v1/designs/one/cancel", headers=asked)
        assert allowed.headers["Access-Control-Allow-Origin"] == "http://lab.example:3000"
        mine = {"Origin": "http://lab.example:3000"}
        assert client.post("/v1/designs/one/cancel", headers=mine).status_code == 404
        other = client.options("/v1", headers=asked | {"Origin": "http://evil.example"})
        assert "Access-Control-Allow-Origin" not in other.headers
    service.close()


def test_its_own_pages_may(client: TestClient) -> None:
    answer = client.post("/v1/designs/one/cancel", headers={"Origin": "http://localhost"})
    assert answer.status_code == 404


@pytest.mark.parametrize(
    "path", ["/v1/rigs/studio/abort", "/v1/rigs/studio/reset", "/v1/designs/one/cancel"]
)
def test_what_a_browser_sends_without_asking_is_refused(client: TestClient, path: str) -> None:
    del client.headers["X-Rigwright"]
    answer = client.post(path)
    assert (answer.status_code, answer.json()["type"]) == (403, "/problems/input/unmarked")
    assert client.post(path, headers=MARKED).status_code == 404


@pytest.mark.parametrize(
    "given", ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data; boundary=x"]
)
@pytest.mark.parametrize(
    ("path", "right"),
    [
        ("/v1/designs", "application/json"),
        ("/v1/scans?filename=head.ply", "application/octet-stream"),
        ("/v1/picture-sets?filename=p.zip", "application/octet-stream"),
    ],
)
def test_a_wrong_type_is_told_the_right_one(
    client: TestClient, path: str, right: str, given: str
) -> None:
    answer = client.post(path, content=b"{}", headers={"Content-Type": given})
    assert answer.status_code == 415
    assert right in answer.json()["remedy"]


@pytest.mark.parametrize("method", ["PUT", "PATCH", "DELETE"])
def test_a_method_that_does_not_exist_is_told_whatever_it_carries(
    client: TestClient, method: str
) -> None:
    headers = {"Content-Type": "application/octet-stream"}
    answer = client.request(method, "/v1/scans", content=b"solid", headers=headers)
    assert answer.status_code == 405


def test_every_answer_is_protected(client: TestClient) -> None:
    for path in ("/v1", "/v1/nothing"):
        headers = client.get(path).headers
        assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert "frame-ancestors 'self'" in headers["Content-Security-Policy"]
    slash = client.get("/v1/designs/", follow_redirects=False)
    assert (slash.status_code, slash.headers.get("Location")) == (404, None)


def test_an_unchanged_page_may_still_do_what_it_did(client: TestClient) -> None:
    # A browser takes the headers of a 304 in place of those that it has kept.
    first = client.get("/")
    again = client.get("/", headers={"If-None-Match": first.headers["etag"]})
    assert again.status_code == 304
    policy = first.headers["Content-Security-Policy"]
    assert again.headers.get("Content-Security-Policy", policy) == policy


@pytest.mark.parametrize("given", ["application/json", "application/problem+json"])
def test_no_body_is_larger_than_allowed(client: TestClient, given: str) -> None:
    piece = b" " * (1 << 20)

    def body() -> object:
        for _ in range((LARGEST_BODY_BYTES >> 20) + 1):
            yield piece

    for headers, content in (
        ({"Content-Length": str(LARGEST_BODY_BYTES + 1)}, b"{}"),
        ({}, body()),
    ):
        answer = client.post(
            "/v1/designs", content=content, headers={"Content-Type": given} | headers
        )
        assert answer.status_code == 413


HEAD = (
    "POST /v1/designs HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
    "Content-Length: 1000\r\n\r\n"
)


def half_sent(server: LiveServer, text: str) -> socket.socket:
    port = int(server.url.rpartition(":")[2])
    opened = socket.create_connection(("127.0.0.1", port), timeout=20.0)
    opened.sendall(text.encode())
    return opened


@pytest.mark.slow
def test_the_service_stops_at_once_while_requests_are_half_sent(start_server: StartServer) -> None:
    server = start_server()
    slow = [half_sent(server, HEAD + "{") for _ in range(20)]
    silent = [half_sent(server, "POST /v1/designs HTT") for _ in range(20)]
    with server.client() as client:
        assert client.get("/v1/health").status_code == 200
    # A quarter of a second until they hear of it, 2 s for their answers, 0.8 s for jobs.
    assert server.stop_took_s() < 5.0
    assert b"503" in slow[0].recv(4096).splitlines()[0]
    assert "Traceback" not in server.log.read_text()
    for one in (*slow, *silent):
        one.close()


def dripped(server: LiveServer, for_s: float) -> bytes:
    """What comes back to a body that never pauses and never ends."""
    opened = half_sent(server, HEAD.replace("1000", "1000000"))
    opened.settimeout(0.1)
    until_s = time.monotonic() + for_s
    with opened:
        while time.monotonic() < until_s:
            try:
                opened.sendall(b" ")
                return opened.recv(4096)
            except TimeoutError:
                continue
    return b""


@pytest.mark.slow
def test_a_body_that_drips_does_not_hold_the_service(start_server: StartServer) -> None:
    server = start_server()
    with ThreadPoolExecutor(1) as pool:
        # 10 bytes a second are less than 1000; the first 20 s are for slow lines.
        assert b"408" in dripped(server, PAUSE_S + 10.0).splitlines()[0]
        answer = pool.submit(dripped, server, 20.0)
        time.sleep(1.0)
        assert server.stop_took_s() < 5.0
        assert b"503" in answer.result().splitlines()[0]


@pytest.mark.slow
def test_nor_does_it_wait_for_who_takes_no_answer(start_server: StartServer) -> None:
    server = start_server()
    request = "GET /v1/counts/endless HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
    deaf = [half_sent(server, request) for _ in range(3)]
    for one in deaf:
        assert one.recv(100).startswith(b"HTTP/1.1 200")
    # 2 s of grace for the answers, 0.8 s for jobs.
    assert server.stop_took_s() < 5.0
    assert "Traceback" not in server.log.read_text()
    for one in deaf:
        one.close()


@pytest.mark.slow
def test_a_head_that_never_ends_is_let_go(start_server: StartServer) -> None:
    server = start_server()
    opened = half_sent(server, "GET /v1/health HTTP/1.1\r\nHost: ")
    assert opened.recv(100) == b""  # before the socket's own 20 s
    opened.close()
