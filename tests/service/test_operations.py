"""Running the service: readiness, metrics, a proxy's prefix, tags, archives."""

from __future__ import annotations

import io
import tracemalloc
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import anyio
import pytest
from prometheus_client.parser import text_string_to_metric_families
from service_helpers import TestClient, running, wait_for
from stations import write_station

from rig.acquisition.capture.results import RigHealth
from rig.acquisition.session import moment
from rig.acquisition.session.index import SessionIndex
from rig.acquisition.session.storage import Disk
from rig.acquisition.session.verify import verify_session
from service.api.zipped import streamed
from service.stations.worker import StationWorker

PREFIX = "/lab/rigwright"


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    """A service behind a proxy, whose rig has taken one capture."""
    folder = tmp_path_factory.mktemp("rig")
    station = write_station(folder / "in")
    with running(folder / "data", station, root_path=PREFIX) as client:
        asked = {"capture_id": "one", "session": "anna-1"}
        job = client.post("/v1/rigs/studio/captures", json=asked).json()
        wait_for(lambda: client.get(job["links"]["self"]).json()["status"] == "completed")
        yield client


def figures(client: TestClient) -> dict[tuple[str, ...], float]:
    """Samples by name and label values."""
    answer = client.get("/metrics")
    assert answer.headers["content-type"].startswith("text/plain; version=0.0.4")
    return {
        (sample.name, *sample.labels.values()): sample.value
        for family in text_string_to_metric_families(answer.text)
        for sample in family.samples
    }


def links_in(document: object) -> Iterator[str]:
    """Every link and href of a document."""
    if isinstance(document, dict):
        for key, value in document.items():
            if key == "links":
                yield from value.values()
            elif key == "href":
                yield value
            else:
                yield from links_in(value)
    elif isinstance(document, list):
        for value in document:
            yield from links_in(value)


def unplugged(told: tuple[RigHealth | None, Any, Any]) -> tuple[RigHealth | None, Any, Any]:
    health, problem, doing = told
    assert health is not None
    gone = replace(health.cameras["cam02"], connected=False, problem="it was unplugged")
    return replace(health, cameras={**health.cameras, "cam02": gone}), problem, doing


def test_ready_means_that_box_and_every_camera_are_there(
    rig: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert rig.get("/v1/ready").json() == {"ready": True}
    assert figures(rig)["rigwright_camera_connected", "cam02", "studio"] == 1.0
    health_of = StationWorker.health
    monkeypatch.setattr(StationWorker, "health", lambda worker: unplugged(health_of(worker)))
    answer = rig.get("/v1/ready")
    assert (answer.status_code, answer.json()["type"]) == (503, "/problems/conflict/not-ready")
    assert "rig studio: camera cam02: it was unplugged" in answer.json()["detail"]
    health = rig.get("/v1/health")
    assert (health.status_code, health.json()["status"]) == (200, "degraded")
    assert figures(rig)["rigwright_camera_connected", "cam02", "studio"] == 0.0
    assert figures(rig)["rigwright_camera_connected", "cam01", "studio"] == 1.0


def test_metrics_count_routes_and_not_what_anybody_makes_up(rig: TestClient) -> None:
    for name in ("a", "b", "c"):
        assert rig.get(f"/v1/scans/{name}").status_code == 404
        assert rig.get(f"/v1/made/up/{name}").status_code == 404
        assert rig.request(f"X{name}".upper(), "/v1").status_code == 405
    told = figures(rig)
    assert told["rigwright_requests_total", "GET", "/v1/scans/{scan_id}", "404"] == 3.0
    assert told["rigwright_requests_total", "GET", "none", "404"] == 3.0
    assert {key[1] for key in told if key[0] == "rigwright_requests_total"} <= {
        *("GET", "POST", "DELETE", "other")
    }
    assert told["rigwright_jobs", "completed"] == 1.0
    assert told["rigwright_trigger_box_ready", "studio"] == 1.0
    assert told["rigwright_disk_free_bytes",] > 0.0


@pytest.mark.parametrize("kept", ["", PREFIX])
def test_behind_a_proxy_every_link_has_its_prefix(rig: TestClient, kept: str) -> None:
    for path in ("/v1", "/v1/rigs", "/v1/captures", "/v1/sessions", "/v1/captures/one"):
        answer = rig.get(f"{kept}{path}")
        assert answer.status_code == 200
        links = list(links_in(answer.json()))
        assert links and all(link.startswith(f"{PREFIX}/") for link in links)
    asked = {"capture_id": "one", "session": "anna-1"}
    again = rig.post(f"{kept}/v1/rigs/studio/captures", json=asked)
    assert (again.status_code, again.headers["Location"]) == (200, f"{PREFIX}/v1/captures/one")
    assert rig.get(f"{kept}/openapi.json").json()["servers"] == [{"url": PREFIX}]
    # The gate and the limits know uploads by their own paths.
    upload = rig.post(f"{kept}/v1/scans?filename=a.ply", json={})
    assert upload.status_code == 415 and "octet-stream" in upload.json()["remedy"]


def test_what_the_client_has_is_not_sent_again(rig: TestClient) -> None:
    record = rig.get("/v1/captures/one").json()["result"]["record"]
    picture = f"/v1/sessions/anna-1/files/{record['frames'][0]['file']['path']}"
    for path in (picture, "/v1/captures/one", "/v1/sessions/anna-1"):
        first = rig.get(path)
        tag = first.headers["ETag"]
        for known in (tag, f'"other", W/{tag}', "*"):
            again = rig.get(path, headers={"If-None-Match": known})
            assert (again.status_code, again.content) == (304, b"")
            assert again.headers["ETag"] == tag
        other = rig.get(path, headers={"If-None-Match": '"other"'})
        assert (other.status_code, other.content) == (200, first.content)
    assert rig.get(picture).headers["ETag"] == f'"{record["frames"][0]["file"]["sha256"]}"'


def test_a_session_is_one_archive_that_is_a_session_again(rig: TestClient, tmp_path: Path) -> None:
    answer = rig.get("/v1/sessions/anna-1/archive")
    assert answer.headers["content-type"] == "application/zip"
    assert int(answer.headers["content-length"]) == len(answer.content)
    assert 'filename="anna-1.zip"' in answer.headers["content-disposition"]
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert archive.testzip() is None
        archive.extractall(tmp_path)
    assert verify_session(tmp_path / "anna-1").whole
    assert rig.get("/v1/sessions/nobody/archive").status_code == 404


def test_an_archive_is_of_one_moment(rig: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    read, looks = moment.read_index, []

    def commits_meanwhile(folder: Path, disk: Disk) -> SessionIndex:
        index = read(folder, disk)
        looks.append(folder)
        if len(looks) == 1:
            manifest = folder / "session.json"
            manifest.write_bytes(manifest.read_bytes() + b"\n")  # other bytes of the same session
        return index

    monkeypatch.setattr(moment, "read_index", commits_meanwhile)
    answer = rig.get("/v1/sessions/anna-1/archive")
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert archive.read("anna-1/session.json").endswith(b"\n\n")
    assert len(looks) == 2


async def _sizes(body: Any) -> list[int]:  # noqa: ANN401 - Starlette's own union of iterables
    return [len(piece) async for piece in body]


def test_an_archive_is_made_as_it_is_sent(tmp_path: Path) -> None:
    size = 64 << 20
    big = tmp_path / "big.raw"
    with big.open("wb") as file:
        file.truncate(size)
    answer = streamed([("a/big.raw", big), ("a/note", b"one")], "a.zip", pictures=True)
    tracemalloc.start()
    sizes = anyio.run(_sizes, answer.body_iterator)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert sum(sizes) == int(answer.headers["content-length"]) > size
    assert peak < 4 << 20  # pieces of 64 KiB, some of them waiting
