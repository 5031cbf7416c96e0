from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx2
import pytest
from service_helpers import StartServer, TestClient, files_under, wait_for

TERMINAL = {"completed", "failed", "cancelled", "interrupted"}


def finished(client: httpx2.Client, location: str) -> dict[str, Any]:
    def look() -> dict[str, Any] | None:
        job = client.get(location).json()
        return job if job["status"] in TERMINAL else None

    return wait_for(look)


def read_events(lines: Iterator[str]) -> Iterator[dict[str, Any]]:
    event: dict[str, Any] = {}
    for line in lines:
        if not line:
            if "event" in event:
                yield event
            event = {}
        elif not line.startswith(":"):
            name, _, value = line.partition(": ")
            event[name] = json.loads(value) if name == "data" else value


def follow(client: httpx2.Client, location: str, **headers: str) -> list[dict[str, Any]]:
    with client.stream("GET", f"{location}/events", headers=headers) as answer:
        assert answer.status_code == 200
        assert answer.headers["content-type"].startswith("text/event-stream")
        return list(read_events(answer.iter_lines()))


def count(client: httpx2.Client, to: int, **more: object) -> str:
    answer = client.post("/v1/counts", json={"to": to, **more})
    assert answer.status_code == 201, answer.text
    location: str = answer.headers["Location"]
    assert answer.json()["status"] == "pending"
    assert answer.json()["links"]["self"] == location
    return location


def test_a_job_and_its_files(client: TestClient) -> None:
    location = count(client, 3)
    job = finished(client, location)
    assert job["status"] == "completed"
    assert job["result"] == {"counted": 3, "read": {}}
    assert job["problem"] is None
    (file,) = client.get(f"{location}/files").json()["items"]
    assert file["name"] == "numbers.txt"
    answer = client.get(file["href"])
    assert answer.text.split() == ["0", "1", "2"]
    assert answer.headers["content-type"].startswith("text/plain")


@pytest.mark.parametrize("name", ["..%2f..%2frigwright.sqlite3", "%2fetc%2fpasswd", "numbers", "."])
def test_file_names_are_never_paths(client: TestClient, name: str) -> None:
    location = count(client, 1)
    finished(client, location)
    answer = client.get(f"{location}/files/{name}")
    assert answer.status_code == 404 or answer.json() == client.get(f"{location}/files").json()
    assert "SQLite" not in answer.text


def test_files_of_a_job_that_has_not_ended(client: TestClient) -> None:
    location = count(client, 1000)
    answer = client.get(f"{location}/files/numbers.txt")
    assert (answer.status_code, answer.json()["type"]) == (409, "/problems/conflict/job-active")
    assert client.get(f"{location}/files").json() == {"items": []}
    answer = client.delete(location)
    assert (answer.status_code, answer.json()["type"]) == (409, "/problems/conflict/job-active")


def test_cancel_twice_then_too_late_then_remove(client: TestClient) -> None:
    location = count(client, 10_000)
    wait_for(lambda: client.get(location).json()["progress"])
    began = time.monotonic()
    for _ in range(2):
        answer = client.post(f"{location}/cancel")
        if answer.status_code != 409:  # the second may come when it is over already
            assert (answer.status_code, answer.json()["cancel_requested"]) == (202, True)
            assert answer.headers["Location"] == location
    assert finished(client, location)["status"] == "cancelled"
    assert time.monotonic() - began < 1.0
    answer = client.post(f"{location}/cancel")
    assert (answer.status_code, answer.json()["type"]) == (409, "/problems/conflict/job-ended")
    assert client.delete(location).status_code == 204
    assert client.get(location).json()["type"] == "/problems/not-found/count"


def test_pages_of_jobs(client: TestClient) -> None:
    made = [count(client, 1) for _ in range(5)]
    seen, cursor = [], ""
    while True:
        page = client.get(f"/v1/counts?limit=2{cursor}").json()
        seen += [job["links"]["self"] for job in page["items"]]
        if page["next"] is None:
            break
        cursor = f"&cursor={page['next']}"
    assert seen == made[::-1]


def test_the_same_key_gets_the_same_job(client: TestClient) -> None:
    headers = {"Idempotency-Key": "once"}
    first, again = (client.post("/v1/counts", json={"to": 1}, headers=headers) for _ in range(2))
    assert first.json() == again.json()
    finished(client, first.headers["Location"])
    # Even when it is over: the same answer as the first time.
    assert client.post("/v1/counts", json={"to": 1}, headers=headers).json() == first.json()
    answer = client.post("/v1/counts", json={"to": 2}, headers=headers)
    assert (answer.status_code, answer.json()["type"]) == (
        422,
        "/problems/input/idempotency-key-reused",
    )
    assert len(client.get("/v1/counts").json()["items"]) == 1


@pytest.mark.slow
def test_too_many_jobs_are_put_off(start_server: StartServer) -> None:
    with start_server(max_queued_jobs=1).client() as client:
        running = count(client, 10_000)
        wait_for(lambda: client.get(running).json()["status"] == "running")
        count(client, 1)
        answer = client.post("/v1/counts", json={"to": 1})
        assert (answer.status_code, answer.json()["type"]) == (503, "/problems/conflict/queue-full")
        assert int(answer.headers["Retry-After"]) > 0
        assert client.get("/v1/health").json()["status"] == "degraded"


class TestEvents:
    def test_every_event_in_order_and_a_clear_end(self, client: TestClient) -> None:
        events = follow(client, count(client, 5, step_s=0.05))
        assert [event["event"] for event in events] == [
            "pending", "running", *["progress"] * 6, "completed"
        ]  # fmt: skip
        assert [int(event["id"]) for event in events] == list(range(1, 10))
        assert [event["data"]["start"] for event in events[2:8]] == [-1, 0, 1, 2, 3, 4]
        assert events[-1]["data"]["result"]["counted"] == 5

    def test_a_stream_goes_on_where_it_was_left(self, client: TestClient) -> None:
        location = count(client, 5)
        whole = follow(client, location)
        assert follow(client, location, **{"Last-Event-ID": "4"}) == whole[4:]
        assert follow(client, location, **{"Last-Event-ID": whole[-1]["id"]}) == []

    def test_a_cancelled_job_ends_its_stream(self, client: TestClient) -> None:
        location = count(client, 10_000, deaf=True)
        client.post(f"{location}/cancel")
        assert follow(client, location)[-1]["event"] == "cancelled"

    def test_a_failed_job_ends_with_its_problem(self, client: TestClient) -> None:
        events = follow(client, count(client, -1))
        assert events[-1]["event"] == "failed"
        assert events[-1]["data"]["problem"]["type"] == "/problems/input/value"

    def test_unknown_jobs_have_no_events(self, client: TestClient) -> None:
        answer = client.get("/v1/counts/none/events")
        assert (answer.status_code, answer.headers["content-type"]) == (
            404,
            "application/problem+json",
        )

    @pytest.mark.slow
    def test_open_streams_do_not_hold_up_the_shutdown(self, start_server: StartServer) -> None:
        server = start_server()
        with server.client() as client:
            location = count(client, 10_000)
            wait_for(lambda: client.get(location).json()["progress"])
            heard: list[dict[str, Any]] = []

            def listen() -> None:
                with server.client() as other, other.stream("GET", f"{location}/events") as answer:
                    heard.extend(read_events(answer.iter_lines()))

            listener = threading.Thread(target=listen)
            listener.start()
            wait_for(lambda: len(heard) > 3)
            began = time.monotonic()
            assert server.stop() == 0
            assert time.monotonic() - began < 4.0
            listener.join(5.0)
        assert not listener.is_alive()
        assert heard[-1]["event"] == "progress"
        assert "Traceback" not in server.log.read_text()


class TestDurability:
    @pytest.mark.slow
    def test_kill_nine_during_jobs_loses_nothing_that_was_finished(
        self, start_server: StartServer, tmp_path: Path
    ) -> None:
        data = tmp_path / "data"
        done: dict[str, str] = {}
        killed: list[str] = []
        for round_number in range(3):
            server = start_server(data)
            with server.client() as client:
                for location in killed:
                    job = client.get(location).json()
                    assert job["status"] == "interrupted"
                    assert job["problem"]["type"] == "/problems/internal/service-stopped"
                for location, text in done.items():
                    assert client.get(location).json()["status"] == "completed"
                    assert client.get(f"{location}/files/numbers.txt").text == text
                key = {"Idempotency-Key": "the-same"}
                kept = client.post("/v1/counts", json={"to": 4}, headers=key).headers["Location"]
                location = count(client, 2 + round_number)
                assert finished(client, location)["status"] == "completed"
                done[location] = client.get(f"{location}/files/numbers.txt").text
                finished(client, kept)
                done.setdefault(kept, "0\n1\n2\n3")
                running = count(client, 10_000)
                wait_for(
                    lambda client=client, running=running: client.get(running).json()["progress"]
                )
                killed.append(running)
                (data / "tmp" / f"{'ab' * 16}.ply").write_bytes(b"half an upload")
            server.kill()
        with start_server(data).client() as client:
            assert len(client.get("/v1/counts").json()["items"]) == len(done) + len(killed)
            assert files_under(data / "tmp") == files_under(data / "work") == []
            # One file per distinct content: nothing lost, nothing left over.
            assert len(files_under(data / "blobs")) == len(set(done.values()))

    @pytest.mark.slow
    def test_a_job_that_waited_is_done_after_a_crash(
        self, start_server: StartServer, tmp_path: Path
    ) -> None:
        server = start_server()
        with server.client() as client:
            running = count(client, 10_000)
            wait_for(lambda: client.get(running).json()["progress"])
            waiting = count(client, 2)
            server.kill()
        with start_server(tmp_path / "data").client() as client:
            assert finished(client, waiting)["status"] == "completed"
            events = follow(client, waiting)
            assert [event["event"] for event in events][:2] == ["pending", "running"]

    @pytest.mark.slow
    def test_a_stop_marks_what_ran(self, start_server: StartServer, tmp_path: Path) -> None:
        server = start_server()
        with server.client() as client:
            running = count(client, 10_000)
            wait_for(lambda: client.get(running).json()["progress"])
        assert server.stop() == 0
        with start_server(tmp_path / "data").client() as client:
            assert client.get(running).json()["status"] == "interrupted"

    @pytest.mark.slow
    def test_a_second_service_on_the_same_data_is_refused(
        self, start_server: StartServer, tmp_path: Path
    ) -> None:
        start_server()
        with pytest.raises(AssertionError, match="another service"):
            start_server(tmp_path / "data")


@pytest.mark.slow
def test_the_service_answers_at_once_while_a_job_runs(start_server: StartServer) -> None:
    with start_server().client() as client:
        location = count(client, 10_000, step_s=0.0)
        wait_for(lambda: client.get(location).json()["progress"])
        slowest = max(client.get(location).elapsed.total_seconds() for _ in range(50))
        assert slowest < 0.5
