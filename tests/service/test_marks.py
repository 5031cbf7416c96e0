"""What people and the program think of a session's pictures, over HTTP."""

from __future__ import annotations

import io
import json
import threading
import zipfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from service_helpers import TestClient, running, wait_for
from stations import write_station

from common.errors import InputError
from service.pictures.listing import pictures_in_session
from service.stations.judged import FiledLook, filed_look

JSON = dict[str, Any]


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[TestClient, Path]]:
    """A service whose session ``anna`` has two captures of two shots by two cameras."""
    folder = tmp_path_factory.mktemp("marks")
    with running(folder / "data", write_station(folder / "in")) as client:
        for name in ("one", "two"):
            asked = {"capture_id": name, "session": "anna", "shots": 2, "interval_us": 2e5}
            made = client.post("/v1/rigs/studio/captures", json=asked)
            own = made.headers["Location"]
            wait_for(lambda own=own: client.get(own).json()["status"] == "completed")
        yield client, folder / "data" / "sessions" / "anna"


@pytest.fixture
def service(lab: tuple[TestClient, Path]) -> Iterator[TestClient]:
    """The same with no mark before and after."""
    client, folder = lab
    yield client
    (folder / "marks.json").unlink(missing_ok=True)


def mark(client: TestClient, what: str, capture: str, **body: object) -> JSON:
    answer = client.post(f"/v1/sessions/anna/captures/{capture}/{what}", json=body)
    assert answer.status_code == 200, answer.text
    found: JSON = answer.json()
    return found


def places(marks: JSON) -> list[tuple[str, str | None, int | None]]:
    return [(m["capture_id"], m["camera"], m["shot"]) for m in marks["rejected"]]


def test_marks_stay_until_they_are_taken_back(service: TestClient) -> None:
    assert service.get("/v1/sessions/anna/marks").json()["rejected"] == []
    mark(service, "reject", "one", camera="cam01", shot=2, why="blinked")
    told = mark(service, "reject", "two")
    assert places(told) == [("one", "cam01", 2), ("two", None, None)]
    assert (told["rejected"][0]["why"], told["rejected"][0]["by"]) == ("blinked", "")
    assert service.get("/v1/sessions/anna/marks").json() == told
    again = mark(service, "reject", "one", camera="cam01", shot=2, why="and moved")
    assert [m["why"] for m in again["rejected"]] == ["", "and moved"]
    assert places(mark(service, "accept", "one", camera="cam01")) == places(again)
    assert places(mark(service, "accept", "one", camera="cam01", shot=2)) == [("two", None, None)]


@pytest.mark.parametrize(
    ("capture", "body"),
    [("three", {}), ("one", {"camera": "cam9"}), ("one", {"shot": 3})],
)
@pytest.mark.parametrize("what", ["reject", "accept"])
def test_what_is_not_there_gets_no_mark(
    service: TestClient, what: str, capture: str, body: JSON
) -> None:
    answer = service.post(f"/v1/sessions/anna/captures/{capture}/{what}", json=body)
    assert (answer.status_code, answer.json()["type"]) == (
        404,
        "/problems/not-found/session-capture",
    )


def test_a_session_with_marks_is_whole_and_takes_them_along(
    service: TestClient, lab: tuple[TestClient, Path]
) -> None:
    told = mark(service, "reject", "two", why="blinked")
    assert service.post("/v1/sessions/anna/verify").json()["whole"] is True
    archive = zipfile.ZipFile(io.BytesIO(service.get("/v1/sessions/anna/archive").content))
    assert json.loads(archive.read("anna/marks.json")) == told
    (lab[1] / "marks.json").write_text("{")
    proof = service.post("/v1/sessions/anna/verify").json()
    assert [(f["kind"], f["path"]) for f in proof["findings"]] == [("changed", "marks.json")]
    answer = service.get("/v1/sessions/anna/marks")
    assert (answer.status_code, answer.json()["type"]) == (422, "/problems/input/session-not-json")


def test_rejected_pictures_are_left_out(service: TestClient, lab: tuple[TestClient, Path]) -> None:
    def frames(*captures: str) -> list[tuple[str, str]]:
        return [(p.camera, p.frame) for p in pictures_in_session(lab[1], captures)]

    everything = frames()
    assert len(everything) == 8
    mark(service, "reject", "one", camera="cam01", shot=2)
    mark(service, "reject", "two")
    assert frames() == [("cam01", "one-1"), ("cam02", "one-1"), ("cam02", "one-2")]
    # Who names a capture wants it all the same, without the pictures that are rejected.
    assert len(frames("one", "two")) == 7
    mark(service, "reject", "one")
    with pytest.raises(InputError, match="no pictures but rejected ones"):
        frames()


def test_how_pictures_look(lab: tuple[TestClient, Path]) -> None:
    client, folder = lab
    frames = client.get("/v1/sessions/anna/captures/one").json()["frames"]
    paths = [frame["file"]["path"] for frame in frames]
    board = np.kron(np.indices((12, 18)).sum(axis=0) % 2, np.ones((16, 16)))
    sharp = (40 + 170 * board).astype(np.uint8)
    # A blur of 4 pixels, far above the 1.5 that still counts as sharp.
    soft = cv2.GaussianBlur(sharp, (0, 0), 4.0)
    whole = [
        cv2.imencode(Path(paths[0]).suffix, picture)[1].tobytes()
        for picture in (sharp, soft, sharp)
    ]
    for path, content in zip(paths, (whole[0], whole[1], whole[2][:-40]), strict=False):
        (folder / path).write_bytes(content)
    looks = [client.get(f"/v1/sessions/anna/looks/{path}").json() for path in paths[:3]]
    assert [(look["sharp"], look["whole"]) for look in looks[:2]] == [(True, True), (False, True)]
    assert looks[0]["image_size_px"] == [288, 192]
    assert looks[2]["whole"] is False
    # A scene without a head has no edges.
    bare = client.get(f"/v1/sessions/anna/looks/{paths[3]}").json()
    assert (bare["sharp"], bare["whole"]) == (None, True)


@pytest.mark.parametrize("path", ["session.json", "images/rig1/cam01/000099.png", "..%2f..%2fx"])
def test_only_pictures_are_looked_at(lab: tuple[TestClient, Path], path: str) -> None:
    assert lab[0].get(f"/v1/sessions/anna/looks/{path}").status_code == 404


def test_many_who_look_hold_up_nobody_who_aborts(
    service: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    going_on, looks = threading.Event(), 60  # of 40 threads that answer

    def slow(folder: Path, path: str) -> FiledLook:
        assert going_on.wait(60.0)
        return filed_look(folder, path)

    monkeypatch.setattr("service.api.marks.filed_look", slow)
    record = service.get("/v1/sessions/anna/captures/one").json()
    own = f"/v1/sessions/anna/looks/{record['frames'][0]['file']['path']}"
    with ThreadPoolExecutor(looks + 1) as clients:
        try:
            asked = [clients.submit(service.get, own) for _ in range(looks)]
            aborted = clients.submit(service.post, "/v1/rigs/studio/abort")
            assert aborted.result(20.0).status_code < 300
            assert not any(one.done() for one in asked)
        finally:
            going_on.set()
        assert {one.result(60.0).status_code for one in asked} == {200}
