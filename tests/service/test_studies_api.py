"""``/v1/studies``: the same work as the command, by the same request."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from inline_studies import inline
from service_helpers import InThisProcess, TestClient, wait_for

from rig.study.studyfile import Study, read_study_file
from service.api.app import create_app
from service.api.context import Service
from service.kinds.queued import QUEUED
from service.settings import read_settings
from service.tasks import studying

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
JSON = dict[str, Any]


@pytest.fixture(autouse=True)
def computed_here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(studying, "processes", lambda _: inline())


@pytest.fixture
def in_process(tmp_path: Path) -> Iterator[TestClient]:
    service = Service(read_settings(data_dir=tmp_path / "data"), QUEUED, InThisProcess())
    with TestClient(create_app(service)) as client:
        yield client
    service.close()


def wall() -> JSON:
    return tomllib.loads((EXAMPLES / "studies/wall-rig.toml").read_text(encoding="utf-8"))


def uploaded(client: TestClient, name: str, **options: str) -> str:
    targets = (EXAMPLES / "wall/targets.xyz").read_bytes()
    told = {"filename": name, "units": "m", "up": "+z", "front": "-y", "subject": "object"}
    answer = client.post(
        "/v1/scans", params=told | options, content=targets,
        headers={"Content-Type": "application/octet-stream"},
    )  # fmt: skip
    assert answer.status_code in (200, 201), answer.text
    return str(answer.json()["id"])


def ended(client: TestClient, job: JSON) -> JSON:
    def look() -> JSON | None:
        found: JSON = client.get(job["links"]["self"]).json()
        return found if found["status"] not in ("pending", "running") else None

    return wait_for(look)


def test_a_study_is_asked_for_followed_and_read(in_process: TestClient) -> None:
    client = in_process
    asked = {
        "study": {"name": "wall", "starts": 1, "grid": {"cameras": [3, 4]}},
        "rigs": [wall()],
        "scan_ids": [uploaded(client, "targets.xyz")],
    }
    answer = client.post("/v1/studies", json=asked)
    assert answer.status_code == 201, answer.text
    job = ended(client, answer.json())
    assert job["status"] == "completed", job["problem"]
    assert (job["result"]["designs"], job["result"]["reused"]) == (2, 0)
    files = client.get(job["links"]["files"]).json()["items"]
    names = {file["name"] for file in files}
    assert names == {"study.json", "study.csv", "report.html", "recommended.toml"}
    study = client.get(f"{job['links']['self']}/study").json()
    assert study["heads"] == ["targets.xyz"]
    assert "Recommended" in client.get(f"{job['links']['self']}/report").text
    best = client.get(f"{job['links']['self']}/recommended").json()["rig"]
    assert best["cameras"] == job["result"]["recommended"]["cameras"]
    wanted = client.post("/v1/designs", json={"scan_id": asked["scan_ids"][0], "rig": best})
    assert wanted.status_code == 201, wanted.text
    client.post(wanted.json()["links"]["cancel"])
    # The same designs under another name: none is computed again.
    again = client.post("/v1/studies", json=asked | {"head_names": ["the wall"]})
    assert ended(client, again.json())["result"]["reused"] == 2


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"study": {"grid": {"camera": [3]}}}, "camera"),
        ({"study": {"grid": {"lens": ["nobody's"]}}}, "not in the catalogue"),
        ({"study": {"grid": {"seed": list(range(20_001))}}}, "20001 designs"),
        ({"rigs": []}, "rigs"),
        ({"scan_ids": ["none"]}, "no scan"),
        ({"scan_ids": []}, "scan_ids"),
    ],
)
def test_what_cannot_be_is_refused_at_once(
    in_process: TestClient, changed: JSON, told: str
) -> None:
    asked = {"study": {}, "rigs": [wall()], "scan_ids": [uploaded(in_process, "targets.xyz")]}
    answer = in_process.post("/v1/studies", json=asked | changed)
    assert answer.status_code in (404, 422)
    assert told in json.dumps(answer.json())


def test_scans_that_are_read_differently_are_refused(in_process: TestClient) -> None:
    scans = [uploaded(in_process, "a.xyz"), uploaded(in_process, "b.xyz", units="cm")]
    answer = in_process.post("/v1/studies", json={"study": {}, "rigs": [wall()], "scan_ids": scans})
    assert answer.status_code == 422
    assert "different units or axes" in answer.json()["detail"]


def text_of(path: str) -> JSON:
    file = EXAMPLES / path
    return {"name": file.name, "text": file.read_text(encoding="utf-8")}


def test_a_study_file_is_read_as_the_command_reads_it(in_process: TestClient) -> None:
    rigs = [text_of("studies/paper-rig.toml"), text_of("studies/wall-rig.toml")]
    given = {"study": text_of("studies/wall.toml"), "rigs": rigs}
    answer = in_process.post("/v1/study-files", json=given)
    assert answer.status_code == 200, answer.text
    read = answer.json()
    file = read_study_file(EXAMPLES / "studies/wall.toml")
    assert Study.model_validate_json(json.dumps(read["study"])) == file.study()
    assert read["heads"] == ["targets.xyz"]
    scan_id = uploaded(in_process, "targets.xyz")
    asked = {"study": read["study"], "rigs": read["rigs"], "scan_ids": [scan_id]}
    job = in_process.post("/v1/studies", json=asked)
    assert job.status_code == 201, job.text
    in_process.post(job.json()["links"]["cancel"])
    assert read["rigs"] == [wall()]


@pytest.mark.parametrize(
    ("study", "told"),
    [
        ("", "schema"),
        ("name = ", "my.toml"),
        ('schema = "rigwright.study/1"\nrigs = ["b/a.toml"]', "'a.toml', which was not given"),
        ('schema = "rigwright.study/1"\nrigs = ["b/a.toml", "c/a.toml"]', "two files"),
        ('schema = "rigwright.study/1"\nrigs = ["wall-rig.toml"]\nhead = []', "head"),
        ('schema = "rigwright.study/1"\nrigs = ["bad.toml"]', "bad.toml"),
    ],
)
def test_a_study_file_that_cannot_be_is_told_in_one_line(
    in_process: TestClient, study: str, told: str
) -> None:
    rigs = [text_of("studies/wall-rig.toml"), {"name": "bad.toml", "text": "x = 1"}]
    given = {"study": {"name": "my.toml", "text": study}, "rigs": rigs}
    answer = in_process.post("/v1/study-files", json=given)
    assert answer.status_code == 422
    assert told in answer.json()["detail"] and "\n" not in answer.json()["detail"]
