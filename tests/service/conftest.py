from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import counting_job
import live_server
import pytest
import trimesh
from service_helpers import HERE, ROOT, LiveServer, StartServer, TestClient

from service.api.context import Service
from service.jobs.engine import Engine
from service.jobs.process import ProcessEngine
from service.kinds.queued import QUEUED
from service.settings import read_settings
from service.store import Store


@pytest.fixture(autouse=True)
def _plain_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    """Jobs of tests are found by name, and no setting of the person who runs them applies."""
    for name in list(os.environ):
        if name.upper().startswith("RIGWRIGHT_"):
            monkeypatch.delenv(name)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), str(HERE)]))


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with Store(tmp_path / "data") as opened:
        yield opened


@pytest.fixture
def start_server(tmp_path: Path) -> Iterator[StartServer]:
    """Starts servers on free ports; ends those that still run after the test."""
    started: list[LiveServer] = []

    def start(data: Path | None = None, **settings: object) -> LiveServer:
        log = (tmp_path / f"server-{len(started)}.log").open("w")
        environment = {f"RIGWRIGHT_{name.upper()}": str(value) for name, value in settings.items()}
        process = subprocess.Popen(
            [
                sys.executable,
                "-W",
                "error",
                str(HERE / "live_server.py"),
                str(data or tmp_path / "data"),
            ],
            stdout=subprocess.PIPE,
            stderr=log,
            text=True,
            env=os.environ | environment,
        )
        assert process.stdout is not None
        url = process.stdout.readline().strip()
        log.close()
        if not url:
            process.wait(20.0)
            process.stdout.close()
            raise AssertionError(Path(log.name).read_text())
        server = LiveServer(process, url, Path(log.name))
        started.append(server)
        return server

    yield start
    for server in started:
        server.kill()
        assert server.process.stdout is not None
        server.process.stdout.close()


@pytest.fixture(scope="session")
def head_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An egg of a head's size in millimetres, Z up: enough to be read."""
    egg = trimesh.creation.icosphere(subdivisions=4)
    egg.apply_scale([75.0, 95.0, 110.0])
    path = tmp_path_factory.mktemp("scan") / "egg.ply"
    egg.export(path)
    return path


@pytest.fixture
def engine() -> Engine:
    """What does the tasks of ``service``: processes, unless a module says otherwise."""
    return ProcessEngine(program="counting_job")


@pytest.fixture
def service(tmp_path: Path, engine: Engine) -> Iterator[Service]:
    settings = read_settings(
        data_dir=tmp_path / "data", max_upload_bytes=2 << 20, workers_per_job=1
    )
    opened = Service(settings, {**QUEUED, **counting_job.KINDS}, engine)
    yield opened
    opened.close()


@pytest.fixture
def client(service: Service) -> Iterator[TestClient]:
    """The application with its jobs running; errors are answered as a server would."""
    with TestClient(live_server.make(service), raise_server_exceptions=False) as opened:
        yield opened
