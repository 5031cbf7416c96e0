"""Everything that can happen to a box and its line, one by one; each ends in a whole capture or
in a named error, and never in a second pulse."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from trigger_boxes import (
    GONE,
    ONE_EACH,
    PROMPT_S,
    SLACK_S,
    fire_whole,
    named_in_time,
    of_fake,
    opened,
    request_for,
    rises,
    wait_until,
)

from common.errors import DeviceError, RigwrightError
from rig.acquisition.trigger import connection, link, owner
from rig.acquisition.trigger.box import FireOutcome, TriggerState
from rig.acquisition.trigger.driver import BoxAddress, SerialTriggerBox
from rig.acquisition.trigger.endpoint import PtyEndpoint, TcpEndpoint
from rig.acquisition.trigger.fake.device import FakeSettings
from rig.acquisition.trigger.fake.faults import FakeFaults
from rig.acquisition.trigger.fake.program import FakeTrigger, start_fake
from rig.acquisition.trigger.faultscript import FaultRates, Incident, ProxyScript
from rig.acquisition.trigger.metrics import WireLine
from rig.acquisition.trigger.proxy import FaultProxy
from rig.acquisition.trigger.serialline import LineLostError, SerialLine

# -- at the start --------------------------------------------------------------------------------


@pytest.mark.parametrize("url", ["/dev/no-such-port", "socket://127.0.0.1:1", "nonsense://x"])
def test_no_port(url: str) -> None:
    with named_in_time(DeviceError, "device/trigger-gone"):
        SerialTriggerBox(BoxAddress(url)).open()


def test_orders_to_a_box_that_is_not_open() -> None:
    driver = SerialTriggerBox(BoxAddress("/dev/no-such-port"))
    for order in (driver.abort, driver.reset, lambda: driver.fire("a")):
        with named_in_time(DeviceError, "device/trigger-gone"):
            order()
    with named_in_time(DeviceError, "device/trigger-gone"):
        driver.arm(request_for("a"))
    with named_in_time(DeviceError, "device/trigger-gone"):
        _ = driver.capabilities
    assert driver.health().state is TriggerState.DISCONNECTED
    assert driver.wait_done("a", 0.1).outcome is FireOutcome.UNKNOWN
    driver.close()


def test_a_port_where_nothing_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(owner, "PROBE_S", 0.5)
    quiet = PtyEndpoint()
    try:
        with named_in_time(DeviceError, "device/trigger-gone"):
            SerialTriggerBox(BoxAddress(quiet.url)).open()
    finally:
        quiet.unplug()


@pytest.mark.parametrize("address", ["127.0.0.1:7411", "box.local:23"])
def test_an_address_of_the_network_is_told_how_to_be_written(address: str) -> None:
    with pytest.raises(DeviceError) as caught:
        SerialLine(address, 115_200, -1)
    assert caught.value.remedy == f"for a port of the network give socket://{address}"


@pytest.mark.parametrize("address", ["/dev/none", "COM77"])
def test_other_ports_are_looked_for_at_the_cable(address: str) -> None:
    with pytest.raises(DeviceError, match="plug the box in"):
        SerialLine(address, 115_200, -1)


def test_a_peer_that_takes_nothing_blocks_nobody() -> None:
    quiet = PtyEndpoint()
    line = SerialLine(quiet.url, 115_200, -1)
    began = time.monotonic()
    try:
        # A terminal holds some kilobytes; nobody reads these.
        with pytest.raises(LineLostError):
            line.send(b"x" * 1_000_000)
        assert time.monotonic() - began < 1.0
    finally:
        line.close()
        quiet.unplug()


@pytest.mark.parametrize("identity", ["Acme,PulseMaker,7,1.0", "nothing"])
def test_another_device(identity: str) -> None:
    with (
        start_fake(FakeSettings(identity=identity)) as fake,
        named_in_time(DeviceError, "device/trigger-wrong"),
    ):
        SerialTriggerBox(BoxAddress(fake.url)).open()


def test_another_box_than_the_one_named(fake: FakeTrigger) -> None:
    with named_in_time(DeviceError, "device/trigger-wrong"):
        SerialTriggerBox(BoxAddress(fake.url, serial_number="rig-7")).open()


def test_a_second_driver_is_told_who_holds_the_port(
    fake: FakeTrigger, driver: SerialTriggerBox
) -> None:
    with pytest.raises(DeviceError, match=f"held by process {os.getpid()}") as caught:
        SerialTriggerBox(BoxAddress(fake.url)).open()
    assert caught.value.code == "device/trigger-busy"
    fire_whole(driver, "a")


def test_a_second_process_is_refused_and_the_lock_dies_with_its_holder(tmp_path: Path) -> None:
    code = (
        "import sys, time\n"
        "from rig.acquisition.trigger.serialline import PortLock\n"
        "lock = PortLock(sys.argv[1])\nprint('held', flush=True)\ntime.sleep(60)\n"
    )
    link_path = tmp_path / "box"
    with start_fake(link=link_path) as fake:
        real = str(link_path.resolve())  # the lock is the device's, whatever its name
        holder = subprocess.Popen([sys.executable, "-c", code, real], stdout=subprocess.PIPE)
        try:
            assert holder.stdout is not None
            holder.stdout.readline()
            with pytest.raises(DeviceError, match=f"held by process {holder.pid}"):
                SerialTriggerBox(BoxAddress(fake.url)).open()
        finally:
            holder.kill()
            holder.communicate()
        with opened(fake.url) as driver:
            fire_whole(driver, "a")


def test_opening_that_resets_the_board() -> None:
    settings = FakeSettings(boot_s=0.7)
    with (
        start_fake(settings, port=0, reset_on_open=True) as fake,
        opened(fake.url) as driver,
    ):
        fire_whole(driver, "a")
        assert rises(fake) == ONE_EACH


# -- unplugged -----------------------------------------------------------------------------------


@pytest.mark.parametrize("over", ["pty", "tcp"])
def test_unplugged_while_idle_and_plugged_in_again(over: str, tmp_path: Path) -> None:
    where = {"port": 0} if over == "tcp" else {"link": tmp_path / "box"}
    with start_fake(**where) as fake, opened(fake.url) as driver:
        fire_whole(driver, "a")
        fake.server.unplug()
        wait_until(lambda: driver.health().state in GONE)
        with named_in_time(DeviceError, "device/trigger-gone"):
            driver.arm(request_for("b"))
        fake.server.replug()
        wait_until(lambda: driver.health().state is TriggerState.READY)
        fire_whole(driver, "c")
        assert driver.health().last_problem == ""
        assert rises(fake)[1] == 2


def test_unplugged_while_armed_and_back_in_time(tmp_path: Path) -> None:
    with start_fake(link=tmp_path / "box") as fake, opened(fake.url) as driver:
        driver.arm(request_for("a"))
        fake.server.unplug()
        time.sleep(0.1)
        fake.server.replug()
        wait_until(lambda: driver.health().state is TriggerState.ARMED)
        driver.fire("a")
        assert driver.wait_done("a", 2.0).outcome is FireOutcome.FIRED
        assert rises(fake) == ONE_EACH


def test_unplugged_while_armed_for_good(tmp_path: Path) -> None:
    with start_fake(link=tmp_path / "box") as fake, opened(fake.url) as driver:
        driver.arm(request_for("a"))
        fake.server.unplug()
        wait_until(lambda: driver.health().state in GONE)
        with named_in_time(DeviceError, "device/trigger-gone"):
            driver.fire("a")
        # FIRE was never sent, and this driver will not send it any more.
        assert driver.wait_done("a", 0.5).outcome is FireOutcome.NOT_FIRED
        fake.server.replug()
        wait_until(lambda: driver.health().state is TriggerState.READY, 6.0)
        assert driver.wait_done("a", 2.0).outcome is FireOutcome.NOT_FIRED
        assert not rises(fake)


def test_unplugged_at_fire_for_good_is_unknown(tmp_path: Path) -> None:
    incident = Incident("to_box", "unplug", containing="FIRE", for_s=-1.0)
    with (
        start_fake() as fake,
        FaultProxy(
            fake.url, PtyEndpoint(tmp_path / "box"), ProxyScript(incidents=(incident,))
        ) as proxy,
        opened(proxy.url) as driver,
    ):
        driver.arm(request_for("a"))
        with named_in_time(DeviceError, "device/trigger-gone"):
            driver.fire("a")
        began = time.monotonic()
        report = driver.wait_done("a", 1.0)
        assert report.outcome is FireOutcome.UNKNOWN
        assert report.acknowledged is False
        assert "cannot be opened" in report.why
        assert time.monotonic() - began < 1.0 + SLACK_S
        # The truth comes with the cable.
        proxy.replug()
        wait_until(lambda: driver.wait_done("a", 0.2).outcome is FireOutcome.NOT_FIRED, 8.0)
        assert not rises(fake)


@pytest.mark.parametrize("byte", [0, 1, 7, 15, 22])
def test_unplugged_at_any_byte_of_the_fire_line(byte: int, tmp_path: Path) -> None:
    with start_fake() as fake:
        endpoint = PtyEndpoint(tmp_path / "box")
        with FaultProxy(fake.url, endpoint, ProxyScript()) as proxy, opened(proxy.url) as driver:
            driver.arm(request_for("a"))
            wait_until(lambda: driver.health().state is TriggerState.ARMED)
            passed = proxy.passed("to_box")
            proxy.add(Incident("to_box", "unplug", at_byte=passed + byte, for_s=0.05))
            with contextlib.suppress(DeviceError):
                driver.fire("a")
            outcome = driver.wait_done("a", 3.0).outcome
            made = rises(fake)
            assert (outcome, made) in (
                (FireOutcome.FIRED, ONE_EACH),
                (FireOutcome.NOT_FIRED, {}),
            )


def test_another_box_on_the_path_after_replugging_is_never_fired(tmp_path: Path) -> None:
    path = tmp_path / "box"
    with (
        start_fake(FakeSettings(serial_number="one"), link=path) as one,
        opened(one.url) as driver,
    ):
        fire_whole(driver, "a")
        driver.arm(request_for("b"))
        one.server.unplug()
        with start_fake(FakeSettings(serial_number="two"), link=path) as two:
            wait_until(lambda: "'two' answers" in driver.health().last_problem)
            with named_in_time(DeviceError, "device/trigger-gone"):
                driver.fire("b")
            assert driver.health().state is not TriggerState.READY
            assert "plug the right box in" not in driver.health().last_problem, "an error's remedy"
            assert not rises(two)
        assert rises(one) == ONE_EACH


def test_the_power_lost_with_the_cable_is_unknown(tmp_path: Path) -> None:
    incident = Incident("to_host", "unplug", containing="OK cap=a t0=", for_s=0.2)
    with (
        start_fake() as fake,
        FaultProxy(
            fake.url, PtyEndpoint(tmp_path / "box"), ProxyScript(incidents=(incident,))
        ) as proxy,
        opened(proxy.url) as driver,
    ):
        driver.arm(request_for("a"))
        with contextlib.suppress(DeviceError):
            driver.fire("a")
        fake.box.reset("POWER", keeps_power=False)
        report = driver.wait_done("a", 2.0)
        assert report.outcome is FireOutcome.UNKNOWN
        assert "does not remember" in report.why
        fire_whole(driver, "b")
        # The pulse of the first capture may have been made before the power went, or not.
        assert rises(fake)[1] in (1, 2)


# -- resets --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("state", "outcome"), [("ARMED", FireOutcome.NOT_FIRED), ("FIRING", FireOutcome.PARTIAL)]
)
def test_a_box_that_resets_itself(state: str, outcome: FireOutcome) -> None:
    with start_fake(faults=FakeFaults(reset_in=state)) as fake, opened(fake.url) as driver:
        try:
            driver.arm(request_for("a", shots=2, late_us=50_000.0))
            driver.fire("a")
        except RigwrightError as error:
            assert error.code in ("conflict/trigger-not-armed", "conflict/trigger-refused")
        assert driver.wait_done("a", 2.0).outcome is outcome
        fire_whole(driver, "b")
        assert driver.health().counters["reboots"] == 1
        assert rises(fake)[3] == 0


def test_a_reset_whose_banner_is_lost_is_found_by_the_clock(
    fake: FakeTrigger, driver: SerialTriggerBox, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection, "HEARTBEAT_S", 0.1)
    fire_whole(driver, "a")
    time.sleep(0.5)
    emit, fake.box.emit = fake.box.emit, lambda _: None
    fake.box.reset()
    fake.box.emit = emit
    wait_until(lambda: driver.health().counters.get("reboots") == 1)
    fire_whole(driver, "b")
    assert rises(fake) == dict.fromkeys(ONE_EACH, 2)


# -- the line ------------------------------------------------------------------------------------

BAD_LINES = {
    "drop": FaultRates(drop=0.06),
    "duplicate": FaultRates(duplicate=0.5),
    "corrupt": FaultRates(corrupt=0.08),
    "truncate": FaultRates(truncate=0.05),
    "delay": FaultRates(delay=0.2, delay_s=0.05),
    "reorder": FaultRates(reorder=0.2, delay_s=0.05),
    "split": FaultRates(split=0.7),
    "noise": FaultRates(noise=0.1),
}


@pytest.mark.parametrize("fault", BAD_LINES)
def test_bad_lines(fault: str) -> None:
    # Seeds are fixed; with so many lines lost an order may fail by name, never doubly fire.
    script = ProxyScript(BAD_LINES[fault], BAD_LINES[fault], seed=11)
    fired = 0
    with (
        start_fake() as fake,
        FaultProxy(fake.url, PtyEndpoint(), script) as proxy,
        opened(proxy.url) as driver,
    ):
        for number in range(3):
            capture = f"a{number}"
            before = rises(fake)
            try:
                driver.arm(request_for(capture))
                driver.fire(capture)
            except DeviceError as error:
                assert error.code == "device/trigger-gone"
            outcome = driver.wait_done(capture, 2.0).outcome
            made = rises(fake) - before
            assert max(made.values(), default=0) <= 1
            if outcome is FireOutcome.FIRED:
                assert made == ONE_EACH
                fired += 1
            elif outcome is FireOutcome.NOT_FIRED:
                assert not made
        assert proxy.done[fault] > 0
    assert fired >= 2


def test_latency_of_an_ftdi_adapter_and_merged_reads() -> None:
    script = ProxyScript(FaultRates(latency_s=0.001), FaultRates(latency_s=0.016, merge_s=0.004))
    with (
        start_fake(FakeSettings(drift_ppm=-2000.0)) as fake,
        FaultProxy(fake.url, PtyEndpoint(), script) as proxy,
        opened(proxy.url) as driver,
    ):
        fire_whole(driver, "a")
        health = driver.health()
        assert health.round_trip_p99_ms is not None
        assert health.round_trip_p99_ms < 150.0
        report = driver.wait_done("a", 0.0)
        true_ns = next(edge.host_ns for edge in fake.box.edges if edge.rising)
        error_us = abs(report.edges[0].at_host_ns - true_ns) / 1000.0
        assert error_us <= report.clock_uncertainty_us + 1.0


def test_an_echo_on_the_line() -> None:
    script = ProxyScript(FaultRates(echo=True))
    with (
        start_fake() as fake,
        FaultProxy(fake.url, PtyEndpoint(), script) as proxy,
        opened(proxy.url) as driver,
    ):
        fire_whole(driver, "a")
        assert driver.health().counters["echoes"] > 0
        assert rises(fake) == ONE_EACH


@pytest.mark.parametrize("way", ["to_box", "to_host"])
def test_four_kilobytes_of_noise(way: str) -> None:
    incident = Incident(way, "noise", containing="cap=a")
    with (
        start_fake() as fake,
        FaultProxy(fake.url, PtyEndpoint(), ProxyScript(incidents=(incident,))) as proxy,
        opened(proxy.url) as driver,
    ):
        fire_whole(driver, "a")
        assert proxy.done["noise"] == 1
        assert rises(fake) == ONE_EACH


def test_a_proxy_that_resets_the_box_in_the_middle_of_arming() -> None:
    with start_fake() as fake:
        incident = Incident("to_box", "reset", containing="ARM")
        script = ProxyScript(incidents=(incident,))
        with (
            FaultProxy(fake.url, PtyEndpoint(), script, of_fake(fake).reset) as proxy,
            opened(proxy.url) as driver,
        ):
            # The outputs were set before the reset: the box has none, and gets them again.
            fire_whole(driver, "a")
        assert rises(fake) == ONE_EACH


def test_a_socket_closed_by_the_other_side_is_noticed() -> None:
    with start_fake() as fake:
        endpoint = TcpEndpoint()
        with FaultProxy(fake.url, endpoint, ProxyScript()) as proxy, opened(proxy.url) as driver:
            driver.arm(request_for("a"))
            proxy.unplug()
            with named_in_time(DeviceError, "device/trigger-gone"):
                driver.fire("a")
            assert driver.wait_done("a", 0.2).outcome in (
                FireOutcome.NOT_FIRED,
                FireOutcome.UNKNOWN,
            )
        assert not rises(fake)


# -- the box -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "faults",
    [
        FakeFaults(lost=0.08),
        FakeFaults(late=0.1, late_s=0.17),
        FakeFaults(duplicate=0.5),
        FakeFaults(garbage=0.4),
        FakeFaults(slow_s=0.01),
        FakeFaults(flood=400.0),
    ],
    ids=lambda faults: str(faults),
)
def test_a_box_with_bad_manners(faults: FakeFaults) -> None:
    with start_fake(FakeSettings(seed=3), faults) as fake, opened(fake.url) as driver:
        for number in range(2):
            before = rises(fake)
            capture = f"a{number}"
            driver.arm(request_for(capture))
            driver.fire(capture)
            assert driver.wait_done(capture, 3.0).outcome is FireOutcome.FIRED
            assert rises(fake) - before == ONE_EACH


def test_a_box_that_falls_silent() -> None:
    with (
        start_fake(faults=FakeFaults(silent_after=50)) as fake,
        opened(fake.url) as driver,
    ):
        problem = None
        for number in range(6):
            capture, before = f"a{number}", rises(fake)
            began = time.monotonic()
            try:
                driver.arm(request_for(capture))
                driver.fire(capture)
            except DeviceError as error:
                problem = error
            assert time.monotonic() - began < 2.0 * (PROMPT_S + SLACK_S)
            report = driver.wait_done(capture, 0.3)
            made = rises(fake) - before
            assert report.outcome is not FireOutcome.FIRED or made == ONE_EACH
            assert report.outcome is not FireOutcome.NOT_FIRED or not made
            if problem is not None:
                break
        assert problem is not None
        assert problem.code == "device/trigger-gone"


def test_counters_that_wrap(monkeypatch: pytest.MonkeyPatch) -> None:
    settings = FakeSettings(first_event=65_530, start_ticks=(1 << 32) - 400_000)
    monkeypatch.setattr(link.random, "randrange", lambda _: 65_520)
    sent: list[WireLine] = []
    with start_fake(settings) as fake:
        driver = SerialTriggerBox(BoxAddress(fake.url), sent.append)
        driver.open()
        try:
            for number in range(5):
                fire_whole(driver, f"a{number}")
            time.sleep(0.25)
            fire_whole(driver, "b")
        finally:
            driver.close()
        assert fake.box.ticks() > 1 << 32
        assert driver.health().counters.get("events_lost", 0) == 0
        assert driver.health().counters.get("reboots", 0) == 0
        assert rises(fake)[1] == 6
    numbers = [int(line.text.split()[0]) for line in sent if line.sent]
    assert {65_535, 0, 1} <= set(numbers)


def test_lost_events_are_asked_for() -> None:
    # The event that says FIRED is lost; the next one shows the gap.
    incident = Incident("to_host", "drop", containing=" ARMED cap=a")
    lines: list[WireLine] = []
    with (
        start_fake() as fake,
        FaultProxy(fake.url, PtyEndpoint(), ProxyScript(incidents=(incident,))) as proxy,
    ):
        driver = SerialTriggerBox(BoxAddress(proxy.url), lines.append)
        driver.open()
        fire_whole(driver, "a")
        wait_until(lambda: any(" LOG? " in line.text for line in lines))
        assert driver.health().counters["events_lost"] == 1
        driver.close()
