"""Keys: who gets in, who may do what, when it ends, and what is written down of it."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx2
import pytest
from service_helpers import ROOT, StartServer, TestClient, rigwright_here, wait_for

from common.errors import ConflictError, InputError, NotFoundError
from service.api.app import create_app
from service.api.context import Service
from service.api.scopes import CHANGING, OPEN, needed_scope
from service.keys import keyfile
from service.keys.keyfile import add_key, read_keys, revoke_key
from service.keys.ring import WRONG_ALLOWED
from service.keys.scope import Scope
from service.kinds.queued import QUEUED
from service.settings import Settings, read_settings

# What the code makes of it is held by another test.
DOCUMENT: dict[str, Any] = json.loads((ROOT / "docs/reference/openapi.json").read_text("utf-8"))
OWN = {"Origin": "http://localhost"}
STOPS = "/v1/designs/none/cancel", "/v1/rigs/none/abort"


class Lab:
    """A service that others can reach, and a key of each scope."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir()
        self.folder = folder
        self.tokens = {scope: add_key(folder, scope.value, scope, None)[1] for scope in Scope}
        self.service = Service(read_settings(data_dir=folder, host="lab.example"), QUEUED)

    def bearer(self, scope: Scope) -> dict[str, str]:
        return {"Authorization": f"Bearer {self.tokens[scope]}"}

    def audit(self) -> list[dict[str, Any]]:
        path = self.folder / "audit.jsonl"
        lines = path.read_text().splitlines() if path.exists() else []
        return [json.loads(line) for line in lines]


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    opened = Lab(tmp_path_factory.mktemp("lab") / "data")
    yield opened
    opened.service.close()


@pytest.fixture
def client(lab: Lab) -> TestClient:
    # Nothing of the service is started: no request here needs its jobs.
    app = create_app(lab.service)
    app.openapi_schema = {"openapi": "3.1.0"}  # making it takes seconds
    return TestClient(app, raise_server_exceptions=False)


def kind(answer: httpx2.Response) -> tuple[int, str]:
    return answer.status_code, answer.json()["type"].removeprefix("/problems/")


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.7", "rig.example", ""])  # noqa: S104
def test_no_other_address_is_served_without_a_key(tmp_path: Path, host: str) -> None:
    done = rigwright_here("serve", "--host", host, "--data", "data", cwd=tmp_path)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "rigwright keys add NAME --scope hardware --data data" in line
    assert not (tmp_path / "data").exists()


def test_nor_with_one_that_has_expired(tmp_path: Path) -> None:
    add_key(tmp_path, "anna", Scope.HARDWARE, 1e-9)
    with pytest.raises(InputError, match="no valid key"):
        Service(read_settings(data_dir=tmp_path, host="lab.example"), QUEUED)


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.2", "::1", "localhost"])
def test_this_machine_needs_none_unless_it_is_wanted(host: str) -> None:
    assert not Settings(host=host).asks_for_keys
    assert Settings(host=host, require_keys=True).asks_for_keys


def test_a_key_is_shown_once_and_kept_as_a_hash(tmp_path: Path) -> None:
    asked = ("keys", "add", "anna", "--scope", "configure", "--expires", "30", "--data", "data")
    token = rigwright_here(*asked, cwd=tmp_path).stdout.strip()
    file = tmp_path / "data" / "keys.json"
    assert file.stat().st_mode & 0o777 == 0o600
    assert len(token) > 43 and token not in file.read_text()  # 256 bits are 43 letters in base64
    (key,) = read_keys(tmp_path / "data")
    assert (key.name, key.scope, key.sha256) == ("anna", Scope.CONFIGURE, keyfile.digest(token))
    listed = rigwright_here("keys", "list", "--data", "data", cwd=tmp_path).stdout
    assert listed.startswith("anna: configure, until ") and token not in listed
    again = rigwright_here("keys", "add", "anna", "--data", "data", cwd=tmp_path)
    assert again.returncode == 2 and "there is a key 'anna' already" in again.stderr
    odd = rigwright_here("keys", "add", "<b>", "--data", "data", cwd=tmp_path)
    assert odd.returncode == 2 and len(odd.stderr.splitlines()) == 1
    assert rigwright_here("keys", "revoke", "anna", "--data", "data", cwd=tmp_path).returncode == 0
    assert read_keys(tmp_path / "data") == []
    with pytest.raises(NotFoundError):
        revoke_key(tmp_path / "data", "anna")


def test_two_commands_at_once_lose_no_key(tmp_path: Path) -> None:
    def add(number: int) -> None:
        while True:
            try:
                add_key(tmp_path, f"key{number}", Scope.READ, None)
                return
            except ConflictError:
                time.sleep(0.001)

    threads = [threading.Thread(target=add, args=(number,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(read_keys(tmp_path)) == 8


def test_every_operation_has_a_scope_and_the_document_says_which() -> None:
    assert set(DOCUMENT["components"]["securitySchemes"]) == {"key", "signIn"}
    names = set()
    for methods in DOCUMENT["paths"].values():
        for method, operation in methods.items():
            name = operation["operationId"]
            if name in OPEN:
                assert operation["security"] == []
                continue
            if method != "get":
                assert name in CHANGING, name
                names.add(name)
            role = [needed_scope(method.upper(), name).value]
            assert operation["security"] == [{}, {"key": role}, {"signIn": role}]
            assert "401" in operation["responses"]
    assert set(CHANGING) == names


def test_stopping_needs_the_least_and_firing_the_greatest() -> None:
    for path, methods in DOCUMENT["paths"].items():
        for method, operation in methods.items():
            needed = needed_scope(method.upper(), operation["operationId"])
            if path.endswith(("/cancel", "/abort")):
                assert needed is Scope.READ, path
            elif method == "post" and path.startswith("/v1/rigs/"):
                assert needed is Scope.HARDWARE, path
    assert needed_scope("POST", "what_is_new_and_was_forgotten") is Scope.HARDWARE


def test_without_a_key_there_is_the_page_and_nothing_else(client: TestClient) -> None:
    for path in ("/", "/page/start.js", "/openapi.json"):
        assert client.get(path).status_code == 200
    assert client.get("/v1/sign-in").json() == {"name": None, "scope": None, "until": None}
    for path in ("/v1", "/v1/health", "/metrics", "/v1/sessions", "/v1/nothing"):
        answer = client.get(path)
        assert kind(answer) == (401, "input/key-needed")
        assert answer.headers["WWW-Authenticate"].startswith("Bearer")
    for path in STOPS:
        assert client.post(path).status_code == 401


@pytest.mark.parametrize("given", ["Bearer", "Bearer rw_wrong", "Basic YTpi", "rw_wrong"])
def test_nor_with_a_wrong_one(client: TestClient, given: str) -> None:
    assert client.get("/v1", headers={"Authorization": given}).status_code == 401


@pytest.mark.parametrize(
    ("method", "path", "needed"),
    [
        ("GET", "/v1/rigs", Scope.READ),
        *(("POST", path, Scope.READ) for path in STOPS),
        ("POST", "/v1/designs", Scope.CONFIGURE),
        ("DELETE", "/v1/designs/none", Scope.CONFIGURE),
        ("POST", "/v1/rigs/none/captures", Scope.HARDWARE),
        ("POST", "/v1/rigs/none/reset", Scope.HARDWARE),
    ],
)
def test_each_key_may_what_its_scope_says(
    client: TestClient, lab: Lab, method: str, path: str, needed: Scope
) -> None:
    for scope in Scope:
        answer = client.request(method, path, headers=lab.bearer(scope))
        if scope.covers(needed):
            assert answer.status_code not in (401, 403), (scope, answer.text)
        else:
            assert kind(answer) == (403, "input/key-scope")
            assert needed.value in answer.json()["remedy"]


def test_a_browser_signs_in_and_out(client: TestClient, lab: Lab) -> None:
    wrong = client.post("/v1/sign-in", json={"key": "rw_wrong"}, headers=OWN)
    assert kind(wrong) == (401, "input/key-wrong")
    answer = client.post("/v1/sign-in", json={"key": lab.tokens[Scope.HARDWARE]}, headers=OWN)
    assert (answer.json()["name"], answer.json()["scope"]) == ("hardware", "hardware")
    cookie = answer.headers["set-cookie"]
    for part in ("HttpOnly", "SameSite=strict", "Path=/", "Max-Age=57600"):
        assert part in cookie
    assert lab.tokens[Scope.HARDWARE] not in cookie
    assert client.get("/v1/rigs").status_code == 200
    assert client.post(STOPS[0], headers=OWN).status_code == 404
    assert client.delete("/v1/sign-in", headers=OWN).status_code == 204
    assert client.get("/v1/rigs").status_code == 401


def test_a_sign_in_survives_a_restart_and_ends_with_its_key(tmp_path: Path) -> None:
    lab = Lab(tmp_path / "data")
    client = TestClient(create_app(lab.service))
    token = lab.tokens[Scope.CONFIGURE]
    assert client.post("/v1/sign-in", json={"key": token}, headers=OWN).status_code == 200
    lab.service.close()
    again = Service(lab.service.settings, QUEUED)
    second = TestClient(create_app(again))
    second.cookies = client.cookies
    assert second.get("/v1/rigs").status_code == 200
    revoke_key(lab.folder, "configure")
    assert kind(second.get("/v1/rigs")) == (401, "input/signed-out")
    again.close()


def test_a_cookie_alone_changes_nothing(client: TestClient, lab: Lab) -> None:
    client.post("/v1/sign-in", json={"key": lab.tokens[Scope.HARDWARE]}, headers=OWN)
    path = STOPS[1]
    assert kind(client.post(path)) == (403, "input/cookie-bare")
    assert kind(client.post(path, headers={"Origin": "http://evil.example"}))[0] == 403
    del client.headers["X-Rigwright"]
    assert client.post(path, headers=OWN, json={}).status_code == 403
    assert client.post(path, headers=OWN | {"X-Rigwright": "1"}).status_code == 404


def test_who_guesses_is_told_to_wait_and_nobody_else(tmp_path: Path) -> None:
    lab = Lab(tmp_path / "data")
    client = TestClient(create_app(lab.service))
    assert client.get("/v1", headers=lab.bearer(Scope.READ)).status_code == 200
    wrong = {"Authorization": "Bearer rw_guess"}
    for _ in range(WRONG_ALLOWED):
        assert client.get("/v1", headers=wrong).status_code == 401
    answer = client.get("/v1", headers=wrong)
    assert kind(answer) == (429, "conflict/keys-guessed") and "Retry-After" in answer.headers
    # A right key that was never shown from anywhere is not looked at now: else guessing went on.
    assert client.get("/v1", headers=lab.bearer(Scope.HARDWARE)).status_code == 429
    sign_in = client.post("/v1/sign-in", json={"key": lab.tokens[Scope.HARDWARE]}, headers=OWN)
    assert sign_in.status_code == 429
    assert client.get("/v1", headers=lab.bearer(Scope.READ)).status_code == 200
    ring = lab.service.keys
    assert ring is not None
    assert ring.with_key(lab.tokens[Scope.HARDWARE], "192.168.1.8").key.name == "hardware"
    # All that was refused is written down, with where it came from.
    told = lab.audit()
    assert [line["answer"] for line in told] == [401] * WRONG_ALLOWED + [429]
    assert {line["from"] for line in told} == {"testclient"}
    lab.service.close()


def test_what_was_done_and_refused_is_written_down(client: TestClient, lab: Lab) -> None:
    before = len(lab.audit())
    name = "<img src=x onerror=alert(1)>"
    client.post(f"/v1/rigs/{name}/abort", headers=lab.bearer(Scope.READ))
    client.post("/v1/rigs/x/captures", headers=lab.bearer(Scope.READ), json={})
    client.get("/v1", headers={"Host": "rebound.example"})
    client.post("/v1/rigs/x/abort", headers={"Origin": "http://evil.example"})
    client.get("/v1/rigs", headers=lab.bearer(Scope.READ))
    told = lab.audit()[before:]
    assert [(line.get("who"), line["answer"]) for line in told] == [
        ("read", 404), ("read", 403), (None, 421), (None, 403),
    ]  # fmt: skip
    assert told[0]["operation"] == "abort_rig" and name in told[0]["path"]
    text = (lab.folder / "audit.jsonl").read_text()
    assert not any(token in text for token in lab.tokens.values())
    assert (lab.folder / "audit.jsonl").stat().st_mode & 0o777 == 0o600


@pytest.mark.slow
def test_an_event_stream_ends_with_its_key(start_server: StartServer, tmp_path: Path) -> None:
    data = tmp_path / "data"
    data.mkdir()
    _, long = add_key(data, "long", Scope.HARDWARE, None)
    server = start_server(require_keys=True)
    with httpx2.Client(base_url=server.url, timeout=30.0) as client:
        asked = {"Authorization": f"Bearer {long}"}
        job = client.post("/v1/counts", json={"to": 1000, "step_s": 0.1}, headers=asked).json()
        # Three seconds: enough to begin on a busy machine, short enough to be waited for.
        _, short = add_key(data, "short", Scope.HARDWARE, 3.0 / 86400.0)
        for token, end in ((short, None), (long, lambda: revoke_key(data, "long"))):
            headers = {"Authorization": f"Bearer {token}"}
            with client.stream("GET", job["links"]["events"], headers=headers) as stream:
                assert stream.status_code == 200
                if end is not None:
                    end()
                for _ in stream.iter_lines():  # ends: the job itself goes on for 100 s
                    pass
            assert client.get("/v1", headers=headers).status_code == 401
    assert "Traceback" not in server.log.read_text()
    assert wait_for(lambda: server.process.poll() is None)
