"""Orders to the driver: who may give them, what they leave behind, which addresses work."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from trigger_boxes import ONE_EACH, fire_whole, named_in_time, opened, request_for, rises

from common.errors import ConflictError, DeviceError
from rig.acquisition.trigger import driver as driver_module
from rig.acquisition.trigger import owner
from rig.acquisition.trigger.box import ArmRequest, FireOutcome, Pulse, TriggerState
from rig.acquisition.trigger.connection import Connection
from rig.acquisition.trigger.driver import BoxAddress, SerialTriggerBox
from rig.acquisition.trigger.endpoint import PtyEndpoint
from rig.acquisition.trigger.fake.program import FakeTrigger
from rig.acquisition.trigger.metrics import WireLine
from rig.acquisition.trigger.program import Program

# -- orders --------------------------------------------------------------------------------------


def test_fire_without_arm(fake: FakeTrigger, driver: SerialTriggerBox) -> None:
    with named_in_time(ConflictError, "conflict/trigger-not-armed"):
        driver.fire("a")
    assert not rises(fake)


def test_many_threads_fire_the_same_capture(fake: FakeTrigger, driver: SerialTriggerBox) -> None:
    driver.arm(request_for("a"))
    refused = []

    def fire() -> None:
        try:
            driver.fire("a")
        except ConflictError as error:
            refused.append(error)

    threads = [threading.Thread(target=fire) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(refused) == 7
    assert driver.wait_done("a", 2.0).outcome is FireOutcome.FIRED
    assert rises(fake) == ONE_EACH


def test_arming_twice_and_using_an_id_again(fake: FakeTrigger, driver: SerialTriggerBox) -> None:
    driver.arm(request_for("a"))
    with named_in_time(ConflictError, "conflict/trigger-armed"):
        driver.arm(request_for("b"))
    driver.fire("a")
    driver.wait_done("a", 2.0)
    with named_in_time(ConflictError, "conflict/trigger-refused"):
        driver.arm(request_for("a"))
    assert rises(fake) == ONE_EACH


def test_an_arming_that_comes_too_late_blocks_nobody(
    fake: FakeTrigger, driver: SerialTriggerBox, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A busy computer: who asked has given up by the time the box is armed."""
    held, go = threading.Event(), threading.Event()
    set_outputs = Connection.set_outputs

    def slow(connection: Connection, program: Program) -> None:
        held.set()
        go.wait(2.0)
        set_outputs(connection, program)

    with monkeypatch.context() as patch:
        patch.setattr(Connection, "set_outputs", slow)
        patch.setattr(driver_module, "PATIENCE_S", 0.05)
        with named_in_time(DeviceError, "device/trigger-gone"):
            driver.arm(request_for("late"))
        assert held.is_set()
        go.set()
    assert driver.wait_done("late", 2.0).outcome is FireOutcome.NOT_FIRED
    fire_whole(driver, "b")
    assert rises(fake) == ONE_EACH


def test_outputs_that_are_not_asked_for_stay_low(
    fake: FakeTrigger, driver: SerialTriggerBox
) -> None:
    fire_whole(driver, "a")
    driver.arm(ArmRequest("b", {2: Pulse(100.0, 200.0)}))
    driver.fire("b")
    assert driver.wait_done("b", 2.0).outcome is FireOutcome.FIRED
    assert rises(fake) == {1: 1, 2: 2, 13: 1}


def test_outputs_are_sent_only_when_they_change(fake: FakeTrigger) -> None:
    lines: list[WireLine] = []
    driver = SerialTriggerBox(BoxAddress(fake.url), lines.append)
    driver.open()
    fire_whole(driver, "a")
    fire_whole(driver, "b")
    sent = [line.text for line in lines if line.sent and " OUT " in line.text]
    assert len(sent) == 3
    fake.box.reset()
    fake.server.wake()
    fire_whole(driver, "c")
    sent = [line.text for line in lines if line.sent and " OUT " in line.text]
    assert len(sent) == 6
    driver.close()


def test_what_an_earlier_program_left_armed_is_disarmed(fake: FakeTrigger) -> None:
    with opened(fake.url) as first:
        first.arm(request_for("a"))
        owner_of_port = first._owner
        assert owner_of_port is not None
        owner_of_port.stop()  # as if the program had been killed
        with opened(fake.url) as second:
            assert second.health().state is TriggerState.READY
            assert second.wait_done("a", 1.0).outcome is FireOutcome.NOT_FIRED
            fire_whole(second, "b")


def test_a_capture_of_another_program_is_asked_for(fake: FakeTrigger) -> None:
    with opened(fake.url) as first:
        fire_whole(first, "a")
    with opened(fake.url) as second:
        report = second.wait_done("a", 1.0)
        assert report.outcome is FireOutcome.FIRED
        assert report.shots_done == 1
        assert second.wait_done("never", 1.0).outcome is FireOutcome.UNKNOWN


def test_an_armed_box_is_kept_armed_by_the_heartbeat(
    fake: FakeTrigger, driver: SerialTriggerBox
) -> None:
    driver.arm(request_for("a"))
    time.sleep(3.5)
    assert driver.health().state is TriggerState.ARMED
    driver.fire("a")
    assert driver.wait_done("a", 2.0).outcome is FireOutcome.FIRED
    assert rises(fake) == ONE_EACH


def test_health_never_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(owner, "PROBE_S", 1.0)
    deaf = PtyEndpoint()
    driver = SerialTriggerBox(BoxAddress(deaf.url))
    thread = threading.Thread(target=_try_open, args=(driver,))
    thread.start()
    for _ in range(50):
        began = time.monotonic()
        driver.health()
        assert time.monotonic() - began < 0.05
        time.sleep(0.01)
    thread.join()
    deaf.unplug()


def _try_open(driver: SerialTriggerBox) -> None:
    with contextlib.suppress(DeviceError):
        driver.open()


def test_listeners_hear_each_report_once(driver: SerialTriggerBox) -> None:
    heard: list[str] = []
    end = driver.subscribe(lambda report: heard.append(report.capture_id))
    fire_whole(driver, "a")
    assert heard == ["a"]
    end()
    end()
    fire_whole(driver, "b")
    assert heard == ["a"]


def test_a_step_of_the_wall_clock_moves_nothing(
    fake: FakeTrigger, driver: SerialTriggerBox, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = time.time
    errors_us = []
    for number, step_s in enumerate((0.0, 3600.0, -7200.0)):
        monkeypatch.setattr(time, "time", lambda step_s=step_s: real() + step_s)
        capture = f"a{number}"
        driver.arm(request_for(capture))
        driver.fire(capture)
        report = driver.wait_done(capture, 2.0)
        made = [edge for edge in fake.box.edges if edge.capture == capture]
        errors_us += [
            abs(said.at_host_ns - true.host_ns) / 1000.0
            for said, true in zip(report.edges, made, strict=True)
        ]
    assert max(errors_us) <= 100.0


# -- addresses -----------------------------------------------------------------------------------


# pyserial leaves the file of spy:// open.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_spy_writes_down_the_line(fake: FakeTrigger, tmp_path: Path) -> None:
    log = tmp_path / "spy.txt"
    with opened(f"spy://{fake.url}?file={log}") as driver:
        fire_whole(driver, "a")
    assert "IDN?" in log.read_text()


def test_a_port_that_cannot_be_waited_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(owner, "PROBE_S", 0.5)
    # loop:// gives back what is written: an echo, and nobody behind it.
    driver = SerialTriggerBox(BoxAddress("loop://"))
    with named_in_time(DeviceError, "device/trigger-gone"):
        driver.open()
    assert driver.health().counters["echoes"] > 0


# pyserial's own thread is made in an old way.
@pytest.mark.filterwarnings("ignore:set.* is deprecated:DeprecationWarning")
def test_over_rfc2217(fake: FakeTrigger) -> None:
    with _rfc2217_server(fake.url) as port, opened(f"rfc2217://127.0.0.1:{port}") as driver:
        fire_whole(driver, "a")
        assert rises(fake) == ONE_EACH


@contextlib.contextmanager
def _rfc2217_server(device_url: str) -> Iterator[int]:
    """A network serial server in miniature: pyserial's own protocol half, two threads."""
    import serial
    import serial.rfc2217

    device = serial.serial_for_url(device_url, timeout=0.02)
    listener = socket.create_server(("127.0.0.1", 0))
    over = threading.Event()

    class Connection:
        def __init__(self, client: socket.socket) -> None:
            self.client = client

        def write(self, data: bytes) -> None:
            self.client.sendall(data)

    def serve() -> None:
        client, _ = listener.accept()
        client.settimeout(0.02)
        manager = serial.rfc2217.PortManager(_PlainPort(device), Connection(client))
        with client:
            while not over.is_set():
                with contextlib.suppress(TimeoutError):
                    data = client.recv(1024)
                    if not data:
                        return
                    device.write(b"".join(manager.filter(data)))
                said = device.read(device.in_waiting)
                if said:
                    client.sendall(b"".join(manager.escape(said)))

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield listener.getsockname()[1]
    finally:
        over.set()
        thread.join()
        listener.close()
        device.close()


class _PlainPort:
    """A terminal has no modem lines; the server's protocol half asks for them."""

    def __init__(self, device: object) -> None:
        self.__dict__["device"] = device
        self.__dict__.update(cts=True, dsr=True, ri=False, cd=True, dtr=True, rts=True)

    def __getattr__(self, name: str) -> object:
        return getattr(self.device, name)
