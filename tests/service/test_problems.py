from __future__ import annotations

import ast
import json
import logging
import re

import pytest
from service_helpers import ROOT, TestClient

from common import errors
from common.files.plain import plain
from service.api import picturesets, targetsets
from service.api.app import make_app
from service.ipc import error_fields, error_from_fields
from service.kinds.queued import QUEUED as JOB_KINDS
from service.logs import JsonLines, job_id
from service.problems import (
    HTTP_ERRORS,
    KINDS,
    STATUS_OF_CODE,
    exit_code_of,
    problem_document,
    status_of,
)
from service.settings import PREFIX, Settings
from service.stations.registry import STATION_KINDS
from service.store.blobs import Staging
from service.store.jobs import Jobs


def all_errors() -> list[type[errors.RigwrightError]]:
    return [
        kind
        for kind in vars(errors).values()
        if isinstance(kind, type)
        and issubclass(kind, errors.RigwrightError)
        and kind is not errors.RigwrightError
    ]


@pytest.mark.parametrize("kind", all_errors())
def test_every_error_has_a_status_and_an_exit_code_and_crosses_the_wire(
    kind: type[errors.RigwrightError],
) -> None:
    error = kind("detail", "something is wrong", "do something")
    document = problem_document(error)
    assert document["type"] == f"/problems/{kind.kind}/detail"
    assert document["status"] == KINDS[kind.kind].status
    assert document["detail"] == "something is wrong; do something"
    back = error_from_fields(json.loads(json.dumps(error_fields(error))))
    assert type(back) is kind
    assert str(back) == str(error)


def test_exit_codes() -> None:
    codes = {kind.kind: exit_code_of(kind("d", "p", "r")) for kind in all_errors()}
    assert codes == {
        "input": 2, "too-large": 2, "not-found": 2, "conflict": 2, "unsatisfiable": 3,
        "device": 4, "interlock": 4, "cancelled": 130, "internal": 1,
    }  # fmt: skip
    # No fault of the program, and told as any other write that has no room.
    assert exit_code_of(errors.InternalError("disk-full", "p", "r")) == 2


def test_special_statuses_belong_to_known_kinds() -> None:
    assert {code.split("/")[0] for code in STATUS_OF_CODE} <= set(KINDS)
    for status, (kind, detail, remedy) in HTTP_ERRORS.items():
        fields = {"kind": kind, "detail": detail, "problem": "p", "remedy": remedy}
        assert status_of(error_from_fields(fields)) == status


def test_what_has_no_form_in_json_becomes_null() -> None:
    nan = float("nan")
    assert plain({"a": nan, "b": [float("inf"), 1.5], "c": (True, None, "x")}) == {
        "a": None, "b": [None, 1.5], "c": [True, None, "x"],
    }  # fmt: skip


@pytest.mark.parametrize(
    ("method", "path", "body", "status", "code"),
    [
        ("GET", "/v1/nothing", None, 404, "not-found/path"),
        ("GET", "/v1/scans/none", None, 404, "not-found/scan"),
        ("GET", "/v1/designs/none", None, 404, "not-found/design"),
        ("PUT", "/v1/designs", None, 405, "input/method-not-allowed"),
        ("POST", "/v1/designs", b"{", 400, "input/malformed-json"),
        ("POST", "/v1/designs", b"{}", 422, "input/request-invalid"),
        (
            "POST",
            "/v1/designs",
            b'{"scan_id": "a", "rig": {"camers": 3}}',
            422,
            "input/request-invalid",
        ),
        ("GET", "/v1/designs?limit=0", None, 422, "input/request-invalid"),
        ("GET", "/v1/designs?limit=many", None, 422, "input/request-invalid"),
        ("GET", "/v1/designs?cursor=9223372036854775808", None, 422, "input/request-invalid"),
    ],
)
def test_every_error_has_one_shape(
    client: TestClient, method: str, path: str, body: bytes | None, status: int, code: str
) -> None:
    headers = {"content-type": "application/json"}
    answer = client.request(method, path, content=body, headers=headers)
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    problem = answer.json()
    assert problem["type"] == f"/problems/{code}"
    assert problem["status"] == status
    assert set(problem) - {"errors"} == {"type", "title", "status", "detail", "remedy"}


def test_the_allow_header_names_every_method_of_the_path(client: TestClient) -> None:
    answer = client.put("/v1/scans")
    assert (answer.status_code, answer.headers["Allow"]) == (405, "GET, POST")


def test_a_json_body_has_a_size_limit(client: TestClient) -> None:
    answer = client.post(
        "/v1/designs", content=b" " * ((64 << 20) + 1), headers={"content-type": "application/json"}
    )
    assert answer.status_code == 413
    assert answer.json()["type"] == "/problems/too-large/body"


def test_a_full_disk_is_told(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    # A full disk cannot be had in a test without rights to mount one: the error is the system's.
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Staging, "write", full)
    answer = client.post("/v1/scans?filename=a.ply", content=b"ply")
    assert (answer.status_code, answer.json()["type"]) == (507, "/problems/internal/disk-full")


def test_a_fault_tells_no_secrets(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError("inside")

    monkeypatch.setattr(Jobs, "counts", broken)
    answer = client.get("/v1/health")
    assert (answer.status_code, answer.json()["type"]) == (500, "/problems/internal/fault")
    assert "inside" not in answer.text


def test_requests_have_ids(client: TestClient) -> None:
    assert client.get("/v1", headers={"X-Request-ID": "mine-1"}).headers["X-Request-ID"] == "mine-1"
    made = client.get("/v1", headers={"X-Request-ID": 'bad "id"'}).headers["X-Request-ID"]
    assert len(made) == 16


def test_log_lines_are_json_with_the_job() -> None:
    token = job_id.set("job-1")
    record = logging.LogRecord("rigwright", logging.INFO, "", 0, "a\nline", (), None)
    record.fields = {"seconds": 1.5}
    line = JsonLines().format(record)
    job_id.reset(token)
    assert "\n" not in line
    entry = json.loads(line)
    assert (entry["message"], entry["job_id"], entry["seconds"]) == ("a\nline", "job-1", 1.5)


GUIDE = (ROOT / "docs" / "how-to" / "api.md").read_text(encoding="utf-8")


def codes_in_the_code(package: str = "service") -> set[str]:
    """The type of every error that a package itself raises."""
    kinds = {kind.__name__: kind.kind for kind in all_errors()}
    found = set()
    for path in (ROOT / package).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.args):
                continue
            detail = node.args[0]
            if node.func.id in kinds and isinstance(detail, ast.Constant):
                found.add(f"{kinds[node.func.id]}/{detail.value}")
    return found


def test_the_guide_lists_every_error() -> None:
    for name, kind in KINDS.items():
        assert f"| `{name}/…` | {kind.status} | {kind.exit_code} |" in GUIDE
    framework = {f"{kind}/{detail}" for kind, detail, _ in HTTP_ERRORS.values()}
    codes = codes_in_the_code() | set(STATUS_OF_CODE) | framework
    assert len(codes) > 30
    assert [code for code in sorted(codes) if f"`{code}`" not in GUIDE] == []


def test_the_guide_lists_no_error_that_cannot_come() -> None:
    listed = set(re.findall(r"`((?:" + "|".join(KINDS) + r")/[a-z-]+)`", GUIDE))
    framework = {f"{kind}/{detail}" for kind, detail, _ in HTTP_ERRORS.values()}
    stored = (*JOB_KINDS, *STATION_KINDS, targetsets.KIND, picturesets.KIND)
    of_job_kinds = {f"not-found/{kind}" for kind in stored}
    of_rigs = codes_in_the_code("rig") | codes_in_the_code("calibration")
    of_rigs |= codes_in_the_code("common")
    assert listed - codes_in_the_code() - of_rigs - framework - of_job_kinds == set()


LIKE_DESIGNS = tuple(
    f"/v1/{name}/{{id}}/"
    for name in (
        "captures",
        "rig-tests",
        "studies",
        "evaluations",
        "plans",
        "calibrations",
        "checks",
        "acceptances",
        "reconstructions",
        "comparisons",
    )
)
"""What is below these is said to be as it is below designs."""


@pytest.mark.slow
def test_the_guide_lists_every_setting_and_path() -> None:
    for name in Settings.model_fields:
        assert f"`{PREFIX}{name.upper()}`" in GUIDE
    for path in make_app().openapi()["paths"]:
        shown = re.sub(r"{(scan|job|target_set|picture_set)_id}", "{id}", path)
        if not shown.startswith(LIKE_DESIGNS):
            assert shown in GUIDE or re.sub(r"^/v1/[a-z-]+/{id}", "\u2026", shown) in GUIDE, shown
