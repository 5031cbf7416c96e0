from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

from service_helpers import ROOT, LiveServer, StartServer  # noqa: E402 - found by the line above

from service.store import Store  # noqa: E402


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
            [sys.executable, "-W", "error", str(HERE / "live_server.py"), str(data or tmp_path / "data")],
            stdout=subprocess.PIPE,
            stderr=log,
            text=True,
            env=os.environ | environment,
        )
        assert process.stdout is not None
        url = process.stdout.readline().strip()
        log.close()
        assert url, Path(log.name).read_text()
        server = LiveServer(process, url, Path(log.name))
        started.append(server)
        return server

    yield start
    for server in started:
        server.kill()
        assert server.process.stdout is not None
        server.process.stdout.close()
