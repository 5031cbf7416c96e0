"""The loop of a worker and the host's end of it, with a driver made for the purpose."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import psutil
import pytest
from camera_rigs import files_rig

import rig
from common.errors import DeviceError, InputError
from rig.acquisition.cameras.base import ArmSpec
from rig.acquisition.cameras.remotecamera import PING_S, RemoteCamera, WorkerSpec
from rig.acquisition.cameras.workers import serve, wire


class SlowDriver:
    """Looks for frames as long as it may, and tells when each command came."""

    shares_library = True

    def __init__(self, options: Mapping[str, Any]) -> None:
        self.options = options
        self.fail: Exception | None = None
        self.fetch_s = 0.0
        self.shows_nothing = False
        self.rested = 0

    def open(self, camera_id: str) -> Mapping[str, Any]:
        return {"info": {"id": camera_id}}

    def configure(self, settings: Mapping[str, Any]) -> Mapping[str, Any]:
        raise InputError("camera-setting", f"no {settings}", "leave it out")

    def arm(self, shots: int) -> int:
        return shots

    def trigger(self) -> None:
        if self.fail:
            raise self.fail

    def collect(self) -> None:
        """Nothing to begin."""

    def poll(self, timeout_s: float) -> Sequence[serve.Picture]:
        if self.fail:
            raise self.fail
        time.sleep(max(timeout_s, self.fetch_s))
        return (({"counter": 1}, b"abc"),)

    def disarm(self) -> None:
        """Nothing to end."""

    def clock(self, count: int) -> Sequence[Sequence[int]]:
        return [(1, 2, 3)] * count

    def ping(self) -> Mapping[str, int]:
        raise ZeroDivisionError("as libraries do")

    def preview(self, over: Callable[[], bool]) -> serve.Picture | None:
        while self.shows_nothing and not over():
            time.sleep(0.001)
        return None if self.shows_nothing else ({"counter": 9}, b"seen")

    def rest(self) -> None:
        self.rested += 1

    def close(self) -> None:
        """Nothing is held."""


class Host:
    """Talks to a worker that runs in a thread, through real pipes."""

    def __init__(self) -> None:
        down, up = os.pipe(), os.pipe()
        self.driver = SlowDriver({})
        self.commands, self.answers = os.fdopen(down[1], "wb"), os.fdopen(up[0], "rb")
        self.source, out = os.fdopen(down[0], "rb"), os.fdopen(up[1], "wb")
        self.out = out
        self.gone = threading.Event()
        self.worker = serve.Worker(lambda _: self.driver, out, self.gone.set)
        self.thread = threading.Thread(target=self.worker.run, args=(self.source,))
        self.thread.start()
        self.frames: list[tuple[wire.Header, bytes]] = []
        self.failed: list[Mapping[str, str]] = []

    def ask(self, do: str, **args: object) -> wire.Header:
        wire.send(self.commands, {"n": 7, "do": do, "args": args})
        while True:
            message = wire.receive(self.answers)
            assert message is not None
            if "re" in message[0]:
                return message[0]
            self._keep(*message)

    def hear_answer(self, number: int) -> None:
        while (message := wire.receive(self.answers)) is not None:
            if message[0].get("re") == number:
                return
        raise AssertionError("the worker ended")

    def hear(self) -> None:
        message = wire.receive(self.answers)
        assert message is not None
        self._keep(*message)

    def _keep(self, header: wire.Header, payload: bytes) -> None:
        if "preview" in header:
            self.frames.append((header["preview"], payload))
        elif "frame" in header:
            self.frames.append((header["frame"], payload))
        else:
            self.failed.append(header["failed"])


@pytest.fixture
def host() -> Iterator[Host]:
    host = Host()
    host.ask("open", id="A", options={})
    yield host
    host.ask("close")
    host.thread.join(5)
    assert not host.thread.is_alive()
    for stream in (host.commands, host.answers, host.source, host.out):
        stream.close()


def test_frames_carry_the_number_of_their_arming(host: Host) -> None:
    assert host.ask("arm", number=3, shots=2)["ok"] == 2
    host.hear()
    assert host.ask("arm", number=4, shots=1)["ok"] == 1
    host.hear()
    numbers = [header["arm"] for header, _ in host.frames]
    assert numbers[0] == 3
    assert numbers[-1] == 4
    assert numbers == sorted(numbers)
    assert {payload for _, payload in host.frames} == {b"abc"}


def test_a_command_never_starves_behind_the_fetching(host: Host) -> None:
    host.ask("arm", number=1, shots=1)
    began = time.monotonic()
    for number in range(2, 12):
        host.ask("arm", number=number, shots=1)
    # Each waits for at most the look that is under way; twice that leaves room for the scheduler.
    assert time.monotonic() - began < 10 * 2 * serve.POLL_S


def test_a_trigger_does_not_wait_for_the_fetching(host: Host) -> None:
    host.ask("arm", number=1, shots=1)
    waits = []
    for _ in range(20):
        began = time.monotonic()
        host.ask("trigger")
        waits.append(time.monotonic() - began)
    assert sorted(waits)[10] < serve.POLL_S / 5


def test_the_end_of_the_commands_ends_the_worker() -> None:
    host = Host()
    host.ask("open", id="A", options={})
    host.commands.close()
    host.thread.join(5)
    assert not host.thread.is_alive()
    assert host.gone.is_set()
    for stream in (host.answers, host.source, host.out):
        stream.close()


def test_a_sign_of_life_does_not_wait_for_a_download(host: Host) -> None:
    host.driver.shares_library = False
    host.driver.fetch_s = 0.5
    host.ask("arm", number=1, shots=1)
    time.sleep(serve.POLL_S)
    began = time.monotonic()
    host.ask("ping")
    host.ask("collect")
    assert time.monotonic() - began < 0.2
    began = time.monotonic()
    host.ask("trigger")  # this library cannot do both
    assert time.monotonic() - began > 0.1


def test_a_look_gives_way_to_whatever_is_asked_next(host: Host) -> None:
    host.driver.shows_nothing = True
    wire.send(host.commands, {"n": 1, "do": "preview", "args": {}})
    told = host.ask("arm", number=1, shots=1)  # the answer to the look comes first
    assert (told["re"], told["ok"]) == (1, False)
    host.hear_answer(7)
    assert host.driver.rested == 1
    assert host.ask("preview")["error"]["kind"] == "internal"  # it is armed


def test_a_camera_nobody_looks_through_goes_back_to_rest(
    host: Host, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serve, "REST_S", 0.05)
    assert host.ask("preview")["ok"] is True
    assert host.frames == [({"counter": 9}, b"seen")]
    until = time.monotonic() + 5.0
    while not host.driver.rested and time.monotonic() < until:
        time.sleep(0.005)
    time.sleep(0.15)
    assert host.driver.rested == 1


def test_errors_cross_as_they_are(host: Host) -> None:
    told = host.ask("configure", settings={"iso": 1})["error"]
    assert told["kind"] == "input"
    assert told["detail"] == "camera-setting"
    told = host.ask("ping")["error"]
    assert told["kind"] == "device"
    assert told["detail"] == "camera-error"
    assert "ZeroDivisionError: as libraries do" in told["problem"]
    assert host.ask("paint")["error"]["kind"] == "internal"
    assert host.ask("clock", count=2)["ok"] == [[1, 2, 3]] * 2


def test_a_failure_while_fetching_is_told_and_ends_the_fetching(host: Host) -> None:
    host.driver.fail = DeviceError("camera-gone", "cable", "plug it in")
    host.ask("arm", number=1, shots=1)
    host.hear()
    assert host.failed[0]["detail"] == "camera-gone"
    time.sleep(2 * serve.POLL_S)
    host.driver.fail = None
    host.ask("disarm")
    assert len(host.failed) == 1


def test_a_worker_that_hangs_is_ended_in_time_and_started_again(tmp_path: Path) -> None:
    with files_rig(tmp_path) as place:
        camera = place.backend.open("left")
        assert isinstance(camera, RemoteCamera)
        hang_and_go_on(camera)


def hang_and_go_on(camera: RemoteCamera) -> None:
    camera.arm(ArmSpec("a", 1, 1.0))
    hung = camera.worker_pid
    assert hung
    os.kill(hung, signal.SIGSTOP)
    began = time.monotonic()
    with pytest.raises(DeviceError) as caught:
        camera.software_trigger()
    assert time.monotonic() - began < 1.0 + 0.5  # the rig's command deadline and ending it
    assert caught.value.code == "device/camera-gone"
    assert "within 1 s" in str(caught.value)
    assert not psutil.pid_exists(hung)
    camera.arm(ArmSpec("b", 1, 1.0))
    camera.software_trigger()
    assert len(camera.wait_frames(1, 2.0)) == 1
    assert camera.health().counters["restarts"] == 1


def test_a_worker_that_hangs_is_seen_by_a_look_at_its_health(tmp_path: Path) -> None:
    with files_rig(tmp_path) as place:
        camera = place.backend.open("left")
        assert isinstance(camera, RemoteCamera)
        assert camera.worker_pid
        os.kill(camera.worker_pid, signal.SIGSTOP)
        began = time.monotonic()
        health = camera.health()
        assert time.monotonic() - began < PING_S + 0.3
        assert not health.connected
        assert "no answer" in health.problem
        # A look ends nothing: the worker was only slow.
        os.kill(camera.worker_pid, signal.SIGCONT)
        assert camera.health().connected


def test_no_worker_outlives_its_host(tmp_path: Path) -> None:
    place = files_rig(tmp_path)
    place.close()
    code = (
        "import sys, time; sys.path.insert(0, sys.argv[1])\n"
        "from rig.acquisition.cameras.opencv import OpencvBackend\n"
        "camera = OpencvBackend(sources={'a': sys.argv[2]}).open('a')\n"
        "print(camera.worker_pid, flush=True); time.sleep(60)\n"
    )
    root = str(Path(rig.__file__).parents[1])
    host = subprocess.Popen(
        [sys.executable, "-c", code, root, str(tmp_path / "f_%04d.png")], stdout=subprocess.PIPE
    )
    with host:
        assert host.stdout
        worker = psutil.Process(int(host.stdout.readline()))
        host.kill()
        with contextlib.suppress(psutil.NoSuchProcess):
            worker.wait(serve.LAST_GRACE_S + 2.0)
    assert not worker.is_running() or worker.status() == psutil.STATUS_ZOMBIE


def test_a_driver_that_cannot_be_loaded_says_why() -> None:
    spec = WorkerSpec("odd", "rig.acquisition.cameras.workers.no_such_driver:X", sys.executable, {})
    with pytest.raises(DeviceError, match=r"no_such_driver") as caught:
        RemoteCamera(spec, "a")
    assert caught.value.code == "device/camera-gone"
