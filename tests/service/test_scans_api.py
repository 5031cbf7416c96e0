from __future__ import annotations

import io
import socket
import threading
import zipfile
from contextlib import closing
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from service_helpers import InThisProcess, StartServer, TestClient, files_under, wait_for

from service.api.app import create_app
from service.api.context import Service
from service.jobs.process import ProcessEngine
from service.settings import read_settings


@pytest.fixture
def engine() -> InThisProcess:
    """Refusals and the store are what is asked about here: a process for each takes a second."""
    return InThisProcess()


def upload(client: TestClient, path: Path, **more: object) -> object:
    return client.post(
        f"/v1/scans?filename={path.name}&subject=object", content=path.read_bytes(), **more
    )


def nothing_stays(service: Service) -> bool:
    folder = service.store.folder
    assert service.store.scans.page(10, None) == []
    return not any(files_under(folder / name) for name in ("blobs", "tmp", "work"))


@pytest.mark.parametrize("engine", [ProcessEngine()], ids=["a process"])
def test_a_scan_goes_in_and_what_was_inferred_comes_back(
    client: TestClient, head_file: Path
) -> None:
    answer = upload(client, head_file)
    assert answer.status_code == 201, answer.text
    scan = answer.json()
    assert answer.headers["Location"] == scan["links"]["self"]
    assert scan["faces"] == 5120
    assert sorted(round(extent) for extent in scan["extents_mm"]) == [150, 190, 220]
    assert any(note["kind"] == "inferred" for note in scan["notes"])
    assert client.get(answer.headers["Location"]).json() == scan
    assert client.get("/v1/scans").json() == {"items": [scan], "next": None}


def test_the_same_file_is_the_same_scan(
    client: TestClient, head_file: Path, service: Service
) -> None:
    first, again = upload(client, head_file), upload(client, head_file)
    assert (first.status_code, again.status_code) == (201, 200)
    assert first.json() == again.json()
    assert len(files_under(service.store.folder / "blobs")) == 1


def test_reading_options_are_kept_and_make_another_scan(
    client: TestClient, head_file: Path
) -> None:
    plain = upload(client, head_file).json()
    content = head_file.read_bytes()
    given = client.post(
        "/v1/scans?filename=egg.ply&units=mm&up=%2Bz&front=-y&subject=object", content=content
    ).json()
    assert given["options"] == {"units": "mm", "up": "+z", "front": "-y", "subject": "object"}
    assert given["id"] != plain["id"]
    assert given["sha256"] == plain["sha256"]


def test_a_removed_scan_is_gone(client: TestClient, head_file: Path, service: Service) -> None:
    location = upload(client, head_file).headers["Location"]
    assert client.delete(location).status_code == 204
    assert client.get(location).status_code == 404
    assert client.delete(location).json()["type"] == "/problems/not-found/scan"
    assert nothing_stays(service)


def test_pages_of_scans(client: TestClient, head_file: Path) -> None:
    content = head_file.read_bytes()
    for units in ("mm", "cm", "inch"):
        client.post(f"/v1/scans?filename=egg.ply&units={units}&subject=object", content=content)
    first = client.get("/v1/scans?limit=2").json()
    second = client.get(f"/v1/scans?limit=2&cursor={first['next']}").json()
    assert [scan["options"]["units"] for scan in first["items"] + second["items"]] == [
        "inch",
        "cm",
        "mm",
    ]
    assert second["next"] is None


def a_zip() -> bytes:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        archive.writestr("head.obj", "v 0 0 0\n")
    return made.getvalue()


@pytest.mark.parametrize(
    ("filename", "content", "status", "kind"),
    [
        ("head.glb", a_zip(), 422, "input"),
        ("head.ply", b"ply\nformat ascii 1.0\nelement vertex 0\nend_header\n", 422, "input"),
        ("head.stl", b"\x00" * 84, 422, "input"),
        ("head.obj", b"\xff\xfe garbage", 422, "input"),
        ("head.ply", b"", 422, "input"),
        ("head", b"v 0 0 0\n", 422, "input"),
        ("head.exe", b"MZ", 422, "input"),
        ("../../etc/passwd", b"root", 422, "input"),
        ("head.ply", b"x" * ((2 << 20) + 1), 413, "too-large"),
    ],
)
def test_what_is_no_scan_is_refused_and_leaves_nothing(
    client: TestClient, service: Service, filename: str, content: bytes, status: int, kind: str
) -> None:
    answer = client.post("/v1/scans", params={"filename": filename}, content=content)
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    problem = answer.json()
    assert problem["type"].startswith(f"/problems/{kind}/")
    assert "\n" not in problem["detail"]
    assert nothing_stays(service)


@pytest.mark.parametrize(
    "stem", ["h\u00e9ad \U0001f600" * 20, "a\nb\x00c", "..", "a/../b", "%2e%2e", " "]
)
def test_any_file_name_will_do(client: TestClient, service: Service, stem: str) -> None:
    answer = client.post("/v1/scans", params={"filename": f"{stem}.glb"}, content=a_zip())
    assert answer.status_code == 422, answer.text
    assert answer.json()["type"].startswith("/problems/input/")
    assert nothing_stays(service)


def test_a_form_is_refused_with_a_hint(client: TestClient, service: Service) -> None:
    answer = client.post("/v1/scans?filename=a.ply", files={"file": b"ply"})
    assert answer.status_code == 415
    assert "--data-binary" in answer.json()["remedy"]
    assert nothing_stays(service)


def test_a_body_longer_than_allowed_is_cut_off_when_no_length_was_given(
    client: TestClient, service: Service
) -> None:
    sent: list[int] = []

    def endless() -> object:
        for n in range(1000):
            sent.append(n)
            yield b"x" * 65536

    answer = client.post("/v1/scans?filename=a.ply", content=endless())
    assert answer.status_code == 413
    assert nothing_stays(service)


def test_a_scan_that_takes_too_long_is_refused(tmp_path: Path, head_file: Path) -> None:
    settings = read_settings(data_dir=tmp_path / "data", scan_time_limit_s=0.05)
    with closing(Service(settings, {})) as service, TestClient(create_app(service)) as client:
        answer = upload(client, head_file)
        assert (answer.status_code, answer.json()["type"]) == (413, "/problems/too-large/time")
        assert nothing_stays(service)


def test_a_service_that_stops_takes_no_scan(
    client: TestClient, service: Service, head_file: Path
) -> None:
    service.announce_stop()
    answer = upload(client, head_file)
    assert answer.status_code == 503, answer.text
    assert answer.json()["type"] == "/problems/internal/stopping"
    assert nothing_stays(service)


class TestIdempotencyKey:
    def test_the_answer_is_repeated(self, client: TestClient, head_file: Path) -> None:
        headers = {"Idempotency-Key": "upload-1"}
        first, again = (upload(client, head_file, headers=headers) for _ in range(2))
        assert first.status_code == again.status_code == 201
        assert first.json() == again.json()

    def test_another_file_under_the_key_is_refused(
        self, client: TestClient, head_file: Path
    ) -> None:
        headers = {"Idempotency-Key": "upload-1"}
        upload(client, head_file, headers=headers)
        other = head_file.read_bytes() + b"\n"
        answer = client.post(
            "/v1/scans?filename=egg.ply&subject=object", content=other, headers=headers
        )
        assert answer.status_code == 422
        assert answer.json()["type"] == "/problems/input/idempotency-key-reused"

    def test_a_failed_upload_frees_the_key(self, client: TestClient, head_file: Path) -> None:
        headers = {"Idempotency-Key": "upload-1"}
        assert (
            client.post("/v1/scans?filename=a.glb", content=a_zip(), headers=headers).status_code
            == 422
        )
        assert upload(client, head_file, headers=headers).status_code == 201


class TestOnARealServer:
    def connect(self, url: str) -> socket.socket:
        parts = urlsplit(url)
        return socket.create_connection((parts.hostname, parts.port), timeout=10.0)

    @pytest.mark.slow
    def test_two_gigabytes_are_refused_without_being_read(
        self, start_server: StartServer, tmp_path: Path
    ) -> None:
        server = start_server()
        with self.connect(server.url) as connection:
            head = (
                "POST /v1/scans?filename=a.ply HTTP/1.1\r\nHost: localhost\r\nX-Rigwright: 1\r\n"
                f"Content-Length: {2 << 30}\r\nExpect: 100-continue\r\n\r\n"
            )
            connection.sendall(head.encode())
            # Only the head was sent: an answer proves that the body was not waited for.
            with connection.makefile("rb") as lines:
                answer = lines.read().decode()
        assert answer.startswith("HTTP/1.1 413 ")
        assert "/problems/too-large/upload" in answer
        assert files_under(tmp_path / "data" / "tmp") == []

    @pytest.mark.slow
    def test_a_broken_upload_leaves_nothing(
        self, start_server: StartServer, tmp_path: Path
    ) -> None:
        server = start_server()
        staging = tmp_path / "data" / "tmp"
        for end in ("close", "reset"):
            with self.connect(server.url) as connection:
                connection.sendall(
                    b"POST /v1/scans?filename=a.ply HTTP/1.1\r\nHost: localhost\r\n"
                    b"X-Rigwright: 1\r\nIdempotency-Key: k\r\n"
                    b"Content-Length: 9000000\r\n\r\n" + b"x" * 3_000_000
                )
                wait_for(lambda: files_under(staging))
                if end == "reset":
                    connection.setsockopt(
                        socket.SOL_SOCKET, socket.SO_LINGER, b"\x01\x00\x00\x00\x00\x00\x00\x00"
                    )
            wait_for(lambda: not files_under(staging))
        assert files_under(tmp_path / "data" / "blobs") == []
        assert "met a fault" not in server.log.read_text()
        with server.client() as client:
            assert client.get("/v1/scans").json()["items"] == []

    @pytest.mark.slow
    def test_the_service_answers_while_scans_are_read(
        self, start_server: StartServer, head_file: Path
    ) -> None:
        server = start_server()
        content = head_file.read_bytes()

        kept: list[int] = []

        def send(n: int) -> None:
            other = content.replace(b"element vertex", f"comment {n}\nelement vertex".encode(), 1)
            with server.client() as client:
                kept.append(
                    client.post(
                        "/v1/scans?filename=egg.ply&subject=object", content=other
                    ).status_code
                )

        threads = [threading.Thread(target=send, args=(n,)) for n in range(3)]
        for thread in threads:
            thread.start()
        with server.client() as client:
            while any(thread.is_alive() for thread in threads):
                assert client.get("/v1/health").elapsed.total_seconds() < 0.5
        assert kept == [201, 201, 201]
