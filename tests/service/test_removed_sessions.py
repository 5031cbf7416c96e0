"""Sessions that are removed: gone at once, back when somebody wants them, erased after a time."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path

import pytest
from service_helpers import TestClient, running, wait_for
from stations import write_station

from common.errors import ConflictError
from common.files.lock import lock_folder
from service.kinds.calibration import CALIBRATION
from service.stations.removed import RemovedSessions
from service.store import Store
from service.store.jobrecords import NewJob


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[TestClient, Path]]:
    """A service with a rig, and where its sessions lie."""
    folder = tmp_path_factory.mktemp("lab")
    with running(folder / "data", write_station(folder / "in")) as client:
        yield client, folder / "data" / "sessions"


def photographed(client: TestClient, session: str, capture_id: str) -> None:
    asked = {"capture_id": capture_id, "session": session}
    job = client.post("/v1/rigs/studio/captures", json=asked).json()
    wait_for(lambda: client.get(job["links"]["self"]).json()["status"] == "completed")


def test_a_session_goes_comes_back_and_is_erased(lab: tuple[TestClient, Path]) -> None:
    client, sessions = lab
    photographed(client, "anna", "one")
    before = client.get("/v1/sessions/anna").json()
    gone = client.delete("/v1/sessions/anna")
    assert gone.status_code == 200, gone.text
    assert client.get("/v1/sessions/anna").status_code == 404
    assert client.get("/v1/sessions").json()["items"] == []
    (listed,) = client.get("/v1/removed-sessions").json()["items"]
    assert listed == gone.json() == client.get(listed["links"]["self"]).json()
    assert client.post(listed["links"]["restore"]).json()["name"] == "anna"
    assert client.get("/v1/sessions/anna").json() == before
    photographed(client, "anna", "two")  # the rig goes on with it as if nothing had been
    again = client.delete("/v1/sessions/anna").json()
    assert client.delete(again["links"]["self"]).status_code == 204
    assert client.post(again["links"]["restore"]).status_code == 404
    assert [path.name for path in sessions.iterdir()] == [".removed"]
    assert list((sessions / ".removed").iterdir()) == []
    audit = (sessions.parent / "audit.jsonl").read_text()
    assert all(f'"{name}"' in audit for name in ("remove_session", "restore_session"))


def test_a_session_in_use_stays(lab: tuple[TestClient, Path]) -> None:
    client, sessions = lab
    photographed(client, "used", "three")
    store: Store = client.app.state.service.store
    waiting = NewJob(CALIBRATION.name, {"session": str(sessions / "used")})
    job = store.jobs.create(waiting, max_pending=10, idempotency_key=None, request_sha256="")
    refused = client.delete("/v1/sessions/used")
    assert refused.json()["type"] == "/problems/conflict/session-in-use"
    client.post(f"/v1/calibrations/{job.id}/cancel")
    wait_for(lambda: store.jobs.get(job.id).status.terminal)
    burst = {"capture_id": "long", "session": "other", "shots": 40, "interval_us": 1e5}
    capture = client.post("/v1/rigs/studio/captures", json=burst).json()
    refused = client.delete("/v1/sessions/used")
    assert refused.json()["type"] == "/problems/conflict/rig-busy"
    client.post(capture["links"]["cancel"])
    wait_for(lambda: client.get(capture["links"]["self"]).json()["status"] == "cancelled")
    assert client.delete("/v1/sessions/used").status_code == 200


@pytest.mark.parametrize("name", ["..", ".removed", "none"])
def test_no_other_folder_is_removed(lab: tuple[TestClient, Path], name: str) -> None:
    client, sessions = lab
    assert client.delete(f"/v1/sessions/{name.replace('.', '%2E')}").status_code == 404
    assert client.delete(f"/v1/removed-sessions/{name.replace('.', '%2E')}").status_code == 404
    assert sessions.is_dir()


class TestGrace:
    def test_what_is_over_is_erased(self, tmp_path: Path) -> None:
        (tmp_path / "anna").mkdir()
        RemovedSessions(tmp_path, timedelta(days=1)).remove(tmp_path / "anna")
        assert len(RemovedSessions(tmp_path, timedelta(days=1)).all()) == 1
        assert RemovedSessions(tmp_path, timedelta()).all() == []
        assert list((tmp_path / ".removed").iterdir()) == []

    def test_a_name_that_is_taken_again_is_kept(self, tmp_path: Path) -> None:
        removed = RemovedSessions(tmp_path, timedelta(days=1))
        for name in ("a~b", "a~b"):
            (tmp_path / name).mkdir()
            (tmp_path / name / "session.json").touch()
            last = removed.remove(tmp_path / name)
        (tmp_path / "a~b").mkdir()
        assert [one.name for one in removed.all()] == ["a~b", "a~b"]
        with pytest.raises(ConflictError, match="there is a new session 'a~b'"):
            removed.restore(last.id)
        assert last.path.is_dir()

    def test_another_process_keeps_its_session(self, tmp_path: Path) -> None:
        (tmp_path / "anna").mkdir()
        lock = lock_folder(tmp_path / "anna")
        with pytest.raises(ConflictError, match="in use by another process"):
            RemovedSessions(tmp_path, timedelta(days=1)).remove(tmp_path / "anna")
        lock.release()
        assert (tmp_path / "anna").is_dir()


def test_what_cannot_be_erased_is_told_and_what_is_not_ours_is_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "anna").mkdir()
    removed = RemovedSessions(tmp_path, timedelta(days=7))
    one = removed.remove(tmp_path / "anna")
    for foreign in ("notes", "anna~99999999T999999999999Z"):
        (one.path.parent / foreign).mkdir()
    assert [known.id for known in removed.all()] == [one.id]
    with monkeypatch.context() as kept, pytest.raises(ConflictError, match="erased"):
        kept.setattr("shutil.rmtree", lambda *_, **__: None)
        removed.erase(one.id)
    removed.erase(one.id)
    assert sorted(path.name for path in one.path.parent.iterdir()) == [
        "anna~99999999T999999999999Z",
        "notes",
    ]
