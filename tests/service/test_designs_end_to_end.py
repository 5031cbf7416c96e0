"""From a scan to a report, over HTTP and on the command line, with the real solver."""

from __future__ import annotations

import copy
import io
import json
import os
import signal
import subprocess
import time
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx2
import pytest
from service_helpers import (
    RIGWRIGHT,
    InThisProcess,
    LiveServer,
    StartServer,
    TestClient,
    files_under,
    rigwright_here,
    small_rig_text,
    wait_for,
)

from common.files.ownership import files_of
from common.progress import CancelToken, ProgressCallback
from geometry.head import synthetic_head
from rig.report.designfolder import FILE_NAMES
from service.api.app import create_app
from service.api.context import Service
from service.jobs.engine import Task
from service.jobs.process import ProcessEngine
from service.kinds.base import RequestT, ResultT
from service.kinds.design import DESIGN
from service.kinds.queued import QUEUED
from service.settings import read_settings
from service.tasks.designing import write_scan

JSON = dict[str, Any]
TERMINAL = {"completed", "failed", "cancelled", "interrupted"}


@pytest.fixture(scope="module")
def head(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("head") / "head.ply"
    write_scan(synthetic_head(), path)
    return path


@pytest.fixture(scope="module")
def small_rig() -> JSON:
    return tomllib.loads(small_rig_text())


class OnlyDesignsInProcesses(ProcessEngine):
    """A design is made as users have it; what reads and scores it saves the start of a process."""

    def run(
        self, task: Task[RequestT, ResultT], report: ProgressCallback, cancel: CancelToken
    ) -> ResultT:
        if task.kind is DESIGN:
            return super().run(task, report, cancel)
        return InThisProcess().run(task, report, cancel)


@pytest.fixture(scope="module")
def http(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    settings = read_settings(data_dir=tmp_path_factory.mktemp("data"), workers_per_job=1)
    service = Service(settings, QUEUED, OnlyDesignsInProcesses())
    with TestClient(create_app(service), raise_server_exceptions=False) as client:
        yield client
    service.close()


@pytest.fixture(scope="module")
def scan_id(http: TestClient, head: Path) -> str:
    return upload(http, head)


def upload(client: httpx2.Client, head: Path) -> str:
    answer = client.post("/v1/scans?filename=head.ply", content=head.read_bytes())
    assert answer.status_code == 201, answer.text
    found: str = answer.json()["id"]
    return found


def finished(client: httpx2.Client, location: str) -> JSON:
    def look() -> JSON | None:
        job: JSON = client.get(location).json()
        return job if job["status"] in TERMINAL else None

    return wait_for(look, 120.0)


@pytest.fixture(scope="module")
def completed(http: TestClient, scan_id: str, small_rig: JSON) -> JSON:
    answer = http.post("/v1/designs", json={"scan_id": scan_id, "rig": small_rig})
    assert answer.status_code == 201, answer.text
    job = finished(http, answer.headers["Location"])
    assert job["status"] == "completed", job
    return job


def with_limits(rig: JSON, **limits: object) -> JSON:
    changed = copy.deepcopy(rig)
    changed["limits"].update(limits)
    return changed


class TestOverHttp:
    @pytest.mark.slow
    def test_a_design_is_made_and_its_files_fit_its_summary(
        self, http: TestClient, completed: JSON
    ) -> None:
        result = completed["result"]
        own = completed["links"]["self"]
        listed = {file["name"]: file for file in http.get(f"{own}/files").json()["items"]}
        assert set(listed) == set(FILE_NAMES)
        design = http.get(f"{own}/design").json()
        assert design["schema"] == "rigwright.design/1"
        assert len(design["cameras"]) == result["cameras"] == 4
        assert design["feasible"] == result["feasible"]
        assert design["quality"]["cost_mm2"] == result["cost_mm2"]
        assert any(note["kind"] == "inferred" for note in result["notes"])
        assert http.get(f"{own}/layout").json()["schema"] == "rigwright.layout/1"
        report = http.get(f"{own}/report")
        assert report.headers["content-type"] == "text/html; charset=utf-8"
        assert "<html" in report.text[:500]
        scene = http.get(f"{own}/files/scene.glb")
        assert scene.headers["content-type"] == "model/gltf-binary"
        assert scene.content[:4] == b"glTF"

    def test_its_cameras_go_to_other_programs(self, http: TestClient, completed: JSON) -> None:
        own = completed["links"]["self"]
        formats = http.get(f"{own}/exports").json()["items"]
        assert {"colmap-text", "metashape-xml", "opencv"} <= {form["name"] for form in formats}
        answer = http.get(f"{own}/exports/colmap-text")
        assert answer.headers["content-type"] == "application/zip"
        with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
            cameras = archive.read("cameras.txt").decode()
        placed = http.get(f"{own}/design").json()["cameras"]
        lines = [line for line in cameras.splitlines() if line and not line.startswith("#")]
        assert len(lines) == len(placed)
        assert http.get(f"{own}/exports/colmpa").status_code == 404

    def test_progress_was_told_and_never_fell(self, http: TestClient, completed: JSON) -> None:
        answer = http.get(f"{completed['links']['self']}/events")
        data = [
            json.loads(line.removeprefix("data: "))
            for line in answer.text.splitlines()
            if line.startswith("data: ")
        ]
        fractions = [event["fraction"] for event in data if "fraction" in event]
        assert len(fractions) > 3
        assert fractions == sorted(fractions)
        assert data[-1]["result"] == completed["result"]

    @pytest.mark.slow
    def test_the_same_seed_gives_the_same_cameras(
        self, http: TestClient, scan_id: str, small_rig: JSON, completed: JSON
    ) -> None:
        answer = http.post("/v1/designs", json={"scan_id": scan_id, "rig": small_rig})
        again = finished(http, answer.headers["Location"])
        assert again["id"] != completed["id"]
        first, second = (
            http.get(f"{job['links']['self']}/design").json() for job in (completed, again)
        )
        assert first["cameras"] == second["cameras"]
        assert first["quality"] == second["quality"]

    @pytest.mark.slow
    def test_overrides_win_over_the_rig(
        self, http: TestClient, scan_id: str, small_rig: JSON
    ) -> None:
        asked = {"scan_id": scan_id, "rig": small_rig, "cameras": 3, "seed": 11}
        job = finished(http, http.post("/v1/designs", json=asked).headers["Location"])
        assert (job["result"]["cameras"], job["result"]["seed"]) == (3, 11)

    @pytest.mark.slow
    def test_limits_in_conflict_complete_with_the_nearest_design(
        self, http: TestClient, scan_id: str, small_rig: JSON
    ) -> None:
        # Seen at 20 degrees from straight on, four cameras cannot see a whole face twice.
        rig = with_limits(small_rig, incidence={"ray_max_deg": 20.0})
        answer = http.post("/v1/designs", json={"scan_id": scan_id, "rig": rig})
        assert answer.status_code == 201, answer.text
        job = finished(http, answer.headers["Location"])
        assert job["status"] == "completed"
        assert job["result"]["feasible"] is False
        assert "coverage_2" in {row["family"] for row in job["result"]["conflicts"]}
        assert http.get(f"{job['links']['self']}/design").json()["feasible"] is False

    @pytest.mark.parametrize(
        "limits",
        [
            {"stand_off": {"min_mm": 900.0, "max_mm": 500.0}},
            {"stand_off": {"minimum_mm": 500.0}},
            {"gsd": {"max_mm": -1.0}},
            {"image_sigma_px": "half"},
        ],
    )
    def test_limits_that_cannot_be_are_refused_at_once(
        self, http: TestClient, scan_id: str, small_rig: JSON, limits: JSON
    ) -> None:
        before = http.get("/v1/designs").json()["items"]
        rig = with_limits(small_rig, **limits)
        answer = http.post("/v1/designs", json={"scan_id": scan_id, "rig": rig})
        assert answer.status_code == 422, answer.text
        assert answer.json()["type"].startswith("/problems/input/")
        assert http.get("/v1/designs").json()["items"] == before

    def test_a_design_needs_a_scan(self, http: TestClient, small_rig: JSON) -> None:
        answer = http.post("/v1/designs", json={"scan_id": "none", "rig": small_rig})
        assert (answer.status_code, answer.json()["type"]) == (404, "/problems/not-found/scan")

    def test_an_evaluation_gives_the_figures_of_the_design(
        self, http: TestClient, scan_id: str, small_rig: JSON, completed: JSON
    ) -> None:
        design = http.get(f"{completed['links']['self']}/design").json()
        asked = {"scan_id": scan_id, "rig": small_rig, "design": design}
        answer = http.post("/v1/evaluations", json=asked)
        assert answer.status_code == 201, answer.text
        job = finished(http, answer.headers["Location"])
        for name in ("feasible", "cost_mm2", "sigma_max_mm", "coverage", "violated"):
            assert job["result"][name] == completed["result"][name]
        document = http.get(f"{job['links']['self']}/evaluation").json()
        assert document["constraints"] == design["constraints"]

    def test_an_existing_rig_needs_cameras_only(
        self, http: TestClient, scan_id: str, small_rig: JSON, completed: JSON
    ) -> None:
        design = http.get(f"{completed['links']['self']}/design").json()
        bare = {"schema": design["schema"], "cameras": design["cameras"][:2]}
        asked = {"scan_id": scan_id, "rig": small_rig, "design": bare}
        job = finished(http, http.post("/v1/evaluations", json=asked).headers["Location"])
        assert job["result"]["cameras"] == 2
        assert job["result"]["cost_mm2"] > completed["result"]["cost_mm2"]


@pytest.mark.slow
def test_a_long_design_leaves_the_service_quick_and_stops_within_a_second(
    start_server: StartServer, head: Path, small_rig: JSON
) -> None:
    server: LiveServer = start_server(workers_per_job=2)
    long = small_rig | {"cameras": 9, "starts": 40}
    long["subject"] = {"design_points": 600, "check_points": 2000}
    with server.client() as client:
        asked = {"scan_id": upload(client, head), "rig": long}
        location = client.post("/v1/designs", json=asked).headers["Location"]
        wait_for(
            lambda: (client.get(location).json()["progress"] or {}).get("start", -1) >= 0, 60.0
        )
        assert max(client.get(location).elapsed.total_seconds() for _ in range(20)) < 0.5
        began = time.monotonic()
        assert client.post(f"{location}/cancel").status_code == 202
        assert finished(client, location)["status"] == "cancelled"
        assert time.monotonic() - began < 1.2
        assert client.get(f"{location}/files").json()["items"] == []


class TestOnTheCommandLine:
    @pytest.fixture
    def rig_file(self, tmp_path: Path) -> Path:
        path = tmp_path / "rig.toml"
        path.write_text(small_rig_text())
        return path

    def run(self, *arguments: object, **more: str) -> subprocess.CompletedProcess[str]:
        command = [*RIGWRIGHT, *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, check=False, **more)

    @pytest.mark.slow
    def test_a_design_like_that_of_the_service(
        self, tmp_path: Path, head: Path, rig_file: Path, http: TestClient, completed: JSON
    ) -> None:
        out = tmp_path / "out"
        done = self.run("design", head, "--rig", rig_file, "--out", out, "--workers", 1)
        assert done.returncode == 0, done.stderr
        assert set(files_of(out)) == {*FILE_NAMES, "scan.json"}
        for path in (out / name for name in FILE_NAMES):
            assert f"\n  {path}\n" in done.stdout
        assert "points seen by 2 or more" in done.stdout
        assert "inferred: " in done.stdout
        own = completed["links"]["self"]
        cameras = json.loads((out / "design.json").read_text())["cameras"]
        assert cameras == http.get(f"{own}/design").json()["cameras"]

        scored = self.run("evaluate", out / "design.json", head, "--rig", rig_file, "--json")
        assert scored.returncode == 0, scored.stderr
        result = json.loads(scored.stdout)["result"]
        assert result["cost_mm2"] == completed["result"]["cost_mm2"]
        shown = self.run("evaluate", out / "design.json", head, "--rig", rig_file)
        assert "sigma, largest" in shown.stdout

    @pytest.mark.slow
    def test_json_is_all_there_is_on_standard_output(
        self, tmp_path: Path, head: Path, rig_file: Path
    ) -> None:
        text = rig_file.read_text().replace("cameras = 4", "cameras = 9")
        rig_file.write_text(text.replace("seed = 1", "seed = 9"))
        options = ("--cameras", 4, "--seed", 1, "--starts", 1, "--json")
        done = self.run("design", head, "--rig", rig_file, "--out", tmp_path / "out", *options)
        assert done.returncode == 0, done.stderr
        document = json.loads(done.stdout)
        assert (document["result"]["cameras"], document["result"]["seed"]) == (4, 1)
        assert {Path(path).name for path in document["files"].values()} == {
            *FILE_NAMES,
            "scan.json",
        }
        assert document["constraints"]
        assert " % " in done.stderr

    @pytest.mark.slow
    def test_limits_that_cannot_be_met_give_three_and_the_nearest_design(
        self, tmp_path: Path, head: Path, rig_file: Path
    ) -> None:
        text = rig_file.read_text()
        assert "ray_max_deg = 75.0" in text
        rig_file.write_text(text.replace("ray_max_deg = 75.0", "ray_max_deg = 20.0"))
        out = tmp_path / "out"
        done = self.run("design", head, "--rig", rig_file, "--out", out)
        assert done.returncode == 3, done.stderr
        assert (out / "design.json").exists()
        assert "Limits in conflict" in done.stdout
        assert done.stderr.splitlines()[-1].startswith("rigwright: the limits cannot all be met")

    @pytest.mark.parametrize(
        ("before", "after", "words"),
        [
            ("seed = 1", "sed = 1", "sed"),
            ("cameras = 4", 'cameras = "four"', "cameras"),
            ("min_mm = 500.0", "min_mm = 5000.0", "stand_off"),
            ("[camera]", "[camera", "TOML"),
        ],
    )
    def test_a_wrong_rig_file_gets_one_line(
        self, tmp_path: Path, head: Path, rig_file: Path, before: str, after: str, words: str
    ) -> None:
        text = rig_file.read_text()
        assert before in text
        rig_file.write_text(text.replace(before, after))
        done = rigwright_here("design", head, "--rig", rig_file, "--out", tmp_path / "out")
        assert done.returncode == 2
        assert words in done.stderr
        assert len(done.stderr.splitlines()) <= 2  # progress may have begun
        assert not (tmp_path / "out").exists()

    def test_a_file_that_is_no_scan_gets_one_line(self, tmp_path: Path, rig_file: Path) -> None:
        scan = tmp_path / "head.glb"
        scan.write_bytes(b"PK\x03\x04 no mesh")
        before = files_under(tmp_path)
        done = rigwright_here("design", scan, "--rig", rig_file, "--out", tmp_path / "out")
        assert done.returncode == 2, done.stderr
        assert done.stderr.splitlines()[-1].startswith("rigwright: ")
        assert "Traceback" not in done.stderr
        assert files_under(tmp_path) == before

    @pytest.mark.slow
    def test_interrupting_a_solve(self, tmp_path: Path, head: Path, rig_file: Path) -> None:
        text = rig_file.read_text().replace("starts = 1", "starts = 40")
        rig_file.write_text(text.replace("cameras = 4", "cameras = 9"))
        out = tmp_path / "out"
        process = subprocess.Popen(
            [
                *RIGWRIGHT,
                "design",
                str(head),
                "--rig",
                str(rig_file),
                "--out",
                str(out),
                "--workers",
                "2",
            ],
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ | {"COLUMNS": "80"},
        )
        assert process.stderr is not None
        assert any("start 1," in line for line in process.stderr)
        began = time.monotonic()
        process.send_signal(signal.SIGINT)
        assert process.wait(10.0) == 130
        assert time.monotonic() - began < 1.5
        process.stderr.close()
        assert not out.exists()
        assert sorted(path.name for path in tmp_path.iterdir()) == ["rig.toml"]
