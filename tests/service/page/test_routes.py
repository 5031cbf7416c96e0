"""The files of the page over HTTP: only those that were shipped, and none that could run a name."""

from __future__ import annotations

import re

import pytest
from fastapi.testclient import TestClient

from service.api.app import make_app
from service.api.conditional import Conditional
from service.page.routes import POLICY, assets


@pytest.fixture(scope="module")
def client() -> TestClient:
    return TestClient(Conditional(make_app()), raise_server_exceptions=False)


def test_a_browser_gets_a_page(client: TestClient) -> None:
    answer = client.get("/")
    assert answer.status_code == 200
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    assert answer.headers["content-security-policy"] == POLICY
    assert "inline" not in POLICY and "http" not in POLICY


def test_what_the_page_asks_for_is_there(client: TestClient) -> None:
    html = client.get("/").text
    wanted = re.findall(r'(?:src|href)="(page/[^"]+)"', html)
    wanted = [f"/{path}" for path in wanted]
    scripts = [name for name in assets() if name.endswith(".js")]
    for name in scripts:
        found = re.findall(r'from "\./([^"]+)"', assets()[name].content.decode())
        wanted += [f"/page/{other}" for other in found]
    assert len(wanted) > 10
    for path in sorted(set(wanted)):
        assert client.get(path).status_code == 200, path
    assert {path.removeprefix("/page/") for path in wanted} == set(assets()) - {"index.html"}


def test_unchanged_parts_are_not_sent_again(client: TestClient) -> None:
    first = client.get("/page/look.css")
    again = client.get("/page/look.css", headers={"If-None-Match": first.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    other = client.get("/page/look.css", headers={"If-None-Match": '"another"'})
    assert other.status_code == 200


def test_the_icon_is_kept_and_all_else_asked_for_again(client: TestClient) -> None:
    """Browsers ask for it with each view."""
    kept = {name: client.get(f"/page/{name}").headers["cache-control"] for name in assets()}
    assert kept.pop("icon.svg") == "max-age=3600"
    assert set(kept.values()) == {"no-cache"}


@pytest.mark.parametrize(
    "name", ["gone.js", "..%2Froutes.py", "routes.py", "%2e%2e", "__init__.py"]
)
def test_nothing_else_is_served(client: TestClient, name: str) -> None:
    answer = client.get(f"/page/{name}")
    assert answer.status_code == 404
    assert answer.json()["type"] == "/problems/not-found/path"


def test_no_script_makes_markup_of_words() -> None:
    for name, asset in assets().items():
        text = asset.content.decode()
        assert not re.search(
            r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|eval\(", text
        ), name
        assert not re.search(r'\son[a-z]+="|style="|https?://(?!www\.w3\.org/2000/svg)', text), name
