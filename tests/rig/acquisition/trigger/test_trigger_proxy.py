"""The fault proxy does to a line what it says, and nothing else."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import serial

from common.errors import InputError
from rig.acquisition.trigger.endpoint import PtyEndpoint, TcpEndpoint
from rig.acquisition.trigger.faultscript import FaultRates, Incident, ProxyScript
from rig.acquisition.trigger.proxy import FaultProxy


class Bench:
    """A proxy with a bare terminal on the device's side and a port on the host's."""

    def __init__(self, proxy: FaultProxy, device: PtyEndpoint, host: serial.SerialBase) -> None:
        self.proxy = proxy
        self.device = device
        self.host = host

    def to_box(self, data: bytes, wait_s: float = 0.1) -> bytes:
        self.host.write(data)
        time.sleep(wait_s)
        return self.device.read()

    def to_host(self, data: bytes, wait_s: float = 0.1) -> bytes:
        self.device.write(data)
        time.sleep(wait_s)
        return self.host.read(65_536)


@contextmanager
def bench(script: ProxyScript, link: Path | None = None) -> Iterator[Bench]:
    device = PtyEndpoint()
    with (
        FaultProxy(device.url, PtyEndpoint(link), script) as proxy,
        serial.serial_for_url(proxy.url, timeout=0) as host,
    ):
        yield Bench(proxy, device, host)
    device.unplug()


LINES = b"".join(b"line %d\n" % number for number in range(40))


def test_nothing_is_done_without_an_order() -> None:
    with bench(ProxyScript()) as line:
        assert line.to_box(LINES) == LINES
        assert line.to_host(LINES) == LINES
        assert line.to_host(b"no end", 0.5) == b"no end"  # it may have gone on
        assert not line.proxy.done


def test_the_same_seed_does_the_same() -> None:
    come = []
    for _ in range(2):
        with bench(ProxyScript(FaultRates(drop=0.3, corrupt=0.3), seed=4)) as line:
            come.append(line.to_box(LINES))
    assert come[0] == come[1] != LINES


@pytest.mark.parametrize(
    ("fault", "check"),
    [
        ("drop", lambda come: come == b""),
        ("duplicate", lambda come: come == b"one\none\ntwo\ntwo\n"),
        ("corrupt", lambda come: len(come) == 8 and come != b"one\ntwo\n"),
        ("truncate", lambda come: len(come) < 8 and b"\n" not in come),
        ("noise", lambda come: len(come) == 8 + 2 * 60),
        ("split", lambda come: come == b"one\ntwo\n"),
    ],
)
def test_each_fault(fault: str, check: object) -> None:
    with bench(ProxyScript(FaultRates(**{fault: 1.0}), seed=2)) as line:
        assert check(line.to_box(b"one\ntwo\n"))
        assert line.proxy.done[fault] == 2


def test_late_lines_keep_their_order_and_overtaken_ones_do_not() -> None:
    with bench(ProxyScript(FaultRates(delay=0.5, delay_s=0.02), seed=1)) as line:
        assert line.to_box(LINES, 0.7) == LINES
        assert line.proxy.done["delay"] > 5
    with bench(ProxyScript(FaultRates(reorder=0.5, delay_s=0.05), seed=1)) as line:
        come = line.to_box(LINES, 0.3)
        assert come != LINES
        assert sorted(come.splitlines()) == sorted(LINES.splitlines())


def test_echo() -> None:
    with bench(ProxyScript(FaultRates(echo=True))) as line:
        assert line.to_box(b"hello\n") == b"hello\n"
        assert line.host.read(100) == b"hello\n"


def test_latency_holds_lines_back() -> None:
    with bench(ProxyScript(to_host=FaultRates(latency_s=0.4), seed=3)) as line:
        assert line.to_host(b"a\n", 0.0) == b""
        time.sleep(0.5)
        assert line.host.read(10) == b"a\n"


def test_unplugged_at_a_byte_and_back(tmp_path: Path) -> None:
    link = tmp_path / "port"
    script = ProxyScript(incidents=(Incident("to_box", "unplug", at_byte=5, for_s=0.2),))
    with bench(script, link) as line:
        assert line.to_box(b"abcdefgh\n", 0.05) == b"abcde"
        assert not link.exists()
        with pytest.raises((serial.SerialException, OSError)):
            line.host.read(1)
            _ = line.host.in_waiting
        time.sleep(0.3)
        assert os.path.realpath(link).startswith("/dev/pts/")


def test_other_incidents() -> None:
    resets = []
    device = PtyEndpoint()
    script = ProxyScript(
        incidents=(
            Incident("to_box", "drop", at_line=2),
            Incident("to_box", "reset", containing="boom"),
        )
    )
    with (
        FaultProxy(device.url, TcpEndpoint(), script, lambda: resets.append(1)) as proxy,
        serial.serial_for_url(proxy.url, timeout=0) as host,
    ):
        host.write(b"one\ntwo\nboom\n")
        time.sleep(0.1)
        assert device.read() == b"one\nboom\n"
        assert resets == [1]
        assert proxy.done == {"drop": 1, "reset": 1}
        assert proxy.passed("to_box") == len(b"one\ntwo\nboom\n")
    device.unplug()


def test_a_device_that_goes_takes_the_port_with_it() -> None:
    device = PtyEndpoint()
    with FaultProxy(device.url, TcpEndpoint(), ProxyScript()) as proxy:
        device.unplug()
        deadline = time.monotonic() + 2.0
        while not proxy.done["device-gone"]:
            assert time.monotonic() < deadline
            time.sleep(0.01)


def test_an_incident_needs_one_moment() -> None:
    for moments in ({}, {"at_byte": 1, "at_line": 1}):
        with pytest.raises(InputError, match="one moment"):
            Incident("to_box", "drop", **moments)
