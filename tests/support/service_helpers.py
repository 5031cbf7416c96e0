"""What several tests of the service use."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from types import MappingProxyType
from typing import TypeVar

import httpx2
import pytest
import uvicorn
from fastapi import FastAPI
from starlette.testclient import TestClient as StarletteClient
from typer.testing import CliRunner

from common.progress import CancelToken, ProgressCallback
from rig.specification.examples import example_text
from service.api.app import create_app
from service.api.context import Service
from service.cli import app
from service.cli import running as running_tasks
from service.client.notes import noted
from service.ipc import TaskMessage, message_from_line, outcome_line, task_line
from service.jobs.engine import Running, Task
from service.kinds.base import RequestT, ResultT
from service.kinds.queued import QUEUED
from service.settings import read_settings
from service.store import Store
from service.store.jobrecords import JobRecord
from service.tasks.registry import work_of

T = TypeVar("T")
HERE = Path(__file__).parent
ROOT = HERE.parents[1]
MARKED = {"X-Rigwright": "1"}
NO_HEADERS: Mapping[str, str] = MappingProxyType({})
RIGWRIGHT = [sys.executable, "-W", "error", "-m", "service.cli"]


def rigwright(*arguments: object, **more: object) -> subprocess.CompletedProcess[str]:
    command = [*RIGWRIGHT, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, **more)


class TestClient(StarletteClient):
    """A client of this machine, whose requests say that no web page sends them."""

    __test__ = False

    def __init__(self, app: FastAPI, *, raise_server_exceptions: bool = True) -> None:
        super().__init__(
            app,
            base_url="http://localhost",
            headers=MARKED,
            raise_server_exceptions=raise_server_exceptions,
        )


@contextmanager
def running(
    data: Path, station: Path, headers: Mapping[str, str] = NO_HEADERS, **settings: object
) -> Iterator[TestClient]:
    """A service with the rig ``studio`` that a station file tells of, asked with ``headers``."""
    service = Service(read_settings(data_dir=data, stations=[station], **settings), QUEUED)
    try:
        with TestClient(create_app(service), raise_server_exceptions=False) as client:
            client.headers.update(headers)
            wait_for(lambda: client.get("/v1/rigs/studio").json()["status"] != "closed")
            yield client
    finally:
        service.close()


def wait_for(condition: Callable[[], T | None], seconds: float = 30.0) -> T:
    """The first true value of ``condition``; fails when there is none in time.

    What takes longer is looked at more seldom: a look is often a request, which takes half of the
    processor when it comes every 20 ms.
    """
    end, pause_s = time.monotonic() + seconds, 0.01
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(pause_s)
        pause_s = min(1.2 * pause_s, 0.1)
    raise AssertionError(f"nothing happened in {seconds} s")


def ended(store: Store, job_id: str, seconds: float = 30.0) -> JobRecord:
    """The job once it has ended."""

    def look() -> JobRecord | None:
        job = store.jobs.get(job_id)
        return job if job.status.terminal else None

    return wait_for(look, seconds)


def alive(mark: str) -> list[int]:
    """Processes whose command line holds ``mark``."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            if mark.encode() in path.read_bytes():
                found.append(int(path.parent.name))
        except OSError:  # it ended between the listing and the look
            continue
    return found


def files_under(folder: Path) -> list[Path]:
    """Every file below ``folder``, which others may be changing."""
    return sorted(Path(where) / name for where, _, names in os.walk(folder) for name in names)


def rigwright_here(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """The command, its task too, in this process: loading everything anew takes two seconds."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(cwd or Path.cwd())
        patch.setattr(running_tasks, "ProcessEngine", InThisProcess)
        done = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return subprocess.CompletedProcess(list(arguments), done.exit_code, done.stdout, done.stderr)


def one_line_and_nothing_left(folder: Path, *arguments: object, here: bool = False) -> str:
    """What a command says that is refused: one line with a remedy, and no file more or less."""
    before = files_under(folder)
    run = rigwright_here if here else rigwright
    done = run(*arguments, "--out", "out", cwd=folder)
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    told = [line for line in done.stderr.splitlines() if line.startswith("rigwright: ")]
    assert len(told) == 1
    assert done.stderr.splitlines()[-1] == told[0]
    assert "; " in told[0]  # what to do about it
    assert files_under(folder) == before
    return told[0]


class InThisProcess:
    """An engine that begins no process: for many tasks that fail early. Faults are seen whole."""

    def run(
        self, task: Task[RequestT, ResultT], report: ProgressCallback, cancel: CancelToken
    ) -> ResultT:
        there = TaskMessage(task_line(task)).task(task.kind)
        result = work_of(task.kind.name).function(there, Running(report, cancel))
        back = message_from_line(outcome_line(result), task.kind)
        assert isinstance(back, task.kind.result)
        return back


@dataclass
class LiveServer:
    """A real server process."""

    process: subprocess.Popen[str]
    url: str
    log: Path

    def client(self) -> httpx2.Client:
        return httpx2.Client(base_url=self.url, timeout=30.0, headers=MARKED)

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()

    def stop(self) -> int:
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(60.0)

    def stop_took_s(self) -> float:
        """Stop it; from hearing of it to the last line of its log.

        How long the interpreter takes to go depends on who else works on this machine.
        """
        assert self.stop() == 0
        lines = [json.loads(line) for line in self.log.read_text().splitlines()]
        (began,) = [line["at"] for line in lines if line["message"] == "Shutting down"]
        return (
            datetime.fromisoformat(lines[-1]["at"]) - datetime.fromisoformat(began)
        ).total_seconds()


StartServer = Callable[..., LiveServer]


def small_rig_text() -> str:
    """The example face rig with few cameras, points and starts, and modest wishes for views."""
    text = example_text("face")
    for before, after in (
        ("cameras = 7", "cameras = 4"),
        # Of so few starts and points the classical ones are quicker.
        ("starts = 8", 'starts = 1\nstrategy = "k-means"'),
        ("share = 0.95", "share = 0.5"),
        ("share = 0.999", "share = 0.95"),
        # The mean of a few points is another one than that of the points that judge.
        ("tolerance_px = 100.0", "tolerance_px = 600.0"),
    ):
        assert text.count(before) == 1
        text = text.replace(before, after)
    assert "[subject]" not in text
    return f"{text}\n[subject]\ndesign_points = 40\ncheck_points = 120\n"


@contextmanager
def listening(data: Path, *stations: Path, **settings: object) -> Iterator[str]:
    """The address of a service of this process that listens, and notes whose rigs it runs."""
    service = Service(read_settings(data_dir=data, stations=stations, **settings), QUEUED)
    with ExitStack() as stack:
        stack.callback(service.close)
        config = uvicorn.Config(create_app(service), port=0, log_config=None, lifespan="on")
        server = uvicorn.Server(config)
        thread = threading.Thread(target=server.run)
        thread.start()
        stack.callback(thread.join)
        stack.callback(setattr, server, "should_exit", True)
        wait_for(lambda: server.started)
        url = f"http://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}"
        rigs = service.rigs.all()
        stack.enter_context(noted(url, [r.station for r in rigs], service.rigs.sessions))
        wait_for(lambda: all(rig.health()[0] is not None for rig in rigs))
        yield url
