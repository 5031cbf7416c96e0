"""The driver of ESPER's box: what it sends, what it refuses, what it does not claim."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from common.errors import ConflictError, DeviceError, InputError
from rig.acquisition.trigger import esper
from rig.acquisition.trigger.box import ArmRequest, FireOutcome, Pulse, TriggerBox, TriggerState
from rig.acquisition.trigger.driver import BoxAddress
from rig.acquisition.trigger.endpoint import PtyEndpoint
from rig.acquisition.trigger.esper import EsperTriggerBox
from rig.acquisition.trigger.fake.esper import FakeEsper
from rig.acquisition.trigger.fake.serving import FakeServer
from rig.acquisition.trigger.faultscript import FaultRates, Incident, ProxyScript
from rig.acquisition.trigger.metrics import WireLine
from rig.acquisition.trigger.proxy import FaultProxy

REQUEST = ArmRequest("a", {1: Pulse(0.0, 20_000.0), 3: Pulse(5000.0, 20_000.0)})


@dataclass
class Bench:
    fake: FakeEsper
    server: FakeServer
    box: EsperTriggerBox
    lines: list[WireLine]

    def sent(self) -> list[str]:
        return [line.text for line in self.lines if line.sent]


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    fake = FakeEsper(time.monotonic_ns)
    with FakeServer(fake, PtyEndpoint(tmp_path / "esper")) as server:
        lines: list[WireLine] = []
        box = EsperTriggerBox(BoxAddress(server.url), half_press=True, wire_log=lines.append)
        box.open()
        yield Bench(fake, server, box, lines)
        box.close()


def test_it_is_a_trigger_box_that_claims_little(bench: Bench) -> None:
    box: TriggerBox = bench.box
    assert not box.capabilities.acknowledges_fire
    assert not box.capabilities.edge_log
    assert not box.capabilities.clock
    health = box.health()
    assert (health.state, health.serial_number, health.firmware) == (
        TriggerState.READY,
        "34",
        "3.2",
    )
    assert health.interlock_closed is None


def test_a_capture_is_fired_and_not_claimed_to_be_acknowledged(bench: Bench) -> None:
    bench.box.arm(REQUEST)
    assert bench.fake.focus
    assert bench.box.health().armed_capture == "a"
    bench.box.fire("a")
    report = bench.box.wait_done("a", 2.0)
    assert (report.outcome, report.acknowledged) == (FireOutcome.FIRED, False)
    assert "does not acknowledge" in report.why
    assert report.edges == ()
    assert not bench.fake.focus
    rising = [edge for edge in bench.fake.edges if edge.rising]
    assert [edge.output for edge in rising] == [1, 3]
    assert rising[1].host_ns - rising[0].host_ns == 5_000_000
    assert bench.sent().count("S") == 1
    assert bench.box.wait_done("a", 0.0) == report


def test_fire_is_written_once_whatever_happens(bench: Bench) -> None:
    bench.box.arm(REQUEST)
    bench.box.fire("a")
    with pytest.raises(ConflictError):
        bench.box.fire("a")
    bench.box.wait_done("a", 2.0)
    with pytest.raises(ConflictError):
        bench.box.arm(REQUEST)
    assert bench.sent().count("S") == 1


def test_disarm_and_expiry_make_no_pulse(bench: Bench) -> None:
    bench.box.arm(REQUEST)
    with pytest.raises(ConflictError, match="armed for capture a"):
        bench.box.arm(ArmRequest("b", REQUEST.pulses))
    bench.box.disarm("a")
    bench.box.disarm("a")
    assert bench.box.wait_done("a", 0.1).outcome is FireOutcome.NOT_FIRED
    bench.box.arm(ArmRequest("b", REQUEST.pulses, expires_s=0.05))
    assert bench.box.wait_done("b", 0.0).outcome is FireOutcome.UNKNOWN
    time.sleep(0.1)
    with pytest.raises(ConflictError):
        bench.box.fire("b")
    assert bench.box.wait_done("never", 0.0).outcome is FireOutcome.UNKNOWN
    assert not bench.fake.edges


def test_abort_takes_the_outputs_out(bench: Bench) -> None:
    bench.box.arm(REQUEST)
    bench.box.abort()
    assert not bench.fake.focus
    assert bench.sent()[-2:] == ["F0", "s000000"]
    with pytest.raises(ConflictError):
        bench.box.fire("a")


@pytest.mark.parametrize(
    "request_",
    [
        ArmRequest("a", {}),
        ArmRequest("a", {7: Pulse(0.0, 1000.0)}),
        ArmRequest("a", {1: Pulse(100.0, 1000.0)}),
        ArmRequest("a", {1: Pulse(0.0, 31_000_000.0)}),
        ArmRequest("a", {1: Pulse(0.0, 1000.0), 2: Pulse(0.0, 2000.0)}),
        ArmRequest("a", {1: Pulse(0.0, 1000.0)}, shots=2, interval_us=1e6),
    ],
)
def test_what_it_cannot_do_is_refused(bench: Bench, request_: ArmRequest) -> None:
    with pytest.raises(InputError):
        bench.box.arm(request_)
    assert bench.box.health().state is TriggerState.READY


def test_lost_before_fire_and_found_again(bench: Bench) -> None:
    bench.server.unplug()
    with pytest.raises(DeviceError) as caught:
        bench.box.arm(REQUEST)
    assert caught.value.code == "device/trigger-gone"
    assert bench.box.health().state is TriggerState.DISCONNECTED
    bench.server.replug()
    bench.box.arm(ArmRequest("b", REQUEST.pulses))
    bench.box.fire("b")
    assert bench.box.wait_done("b", 2.0).outcome is FireOutcome.FIRED


def test_lost_at_fire_is_unknown(bench: Bench) -> None:
    bench.box.arm(REQUEST)
    bench.box.fire("a")
    bench.server.unplug()
    report = bench.box.wait_done("a", 2.0)
    assert (report.outcome, report.acknowledged) == (FireOutcome.UNKNOWN, False)
    assert bench.box.wait_done("a", 2.0).outcome is FireOutcome.UNKNOWN


def test_another_box_is_refused(bench: Bench) -> None:
    bench.server.unplug()
    with pytest.raises(DeviceError):
        bench.box.arm(REQUEST)
    bench.fake.id = "35"
    bench.server.replug()
    with pytest.raises(DeviceError) as caught:
        bench.box.arm(REQUEST)
    assert caught.value.code == "device/trigger-wrong"


def test_a_port_without_an_esper_box(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(esper, "_PROBE_S", 0.2)
    quiet = PtyEndpoint()
    with pytest.raises(DeviceError) as caught:
        EsperTriggerBox(BoxAddress(quiet.url)).open()
    assert caught.value.code == "device/trigger-gone"
    quiet.unplug()


def test_settings_are_said_again_when_lost_and_fire_is_not() -> None:
    fake = FakeEsper(time.monotonic_ns)
    incident = Incident("to_box", "drop", containing="S\n")
    script = ProxyScript(FaultRates(drop=0.2), incidents=(incident,), seed=1)
    with (
        FakeServer(fake, PtyEndpoint()) as server,
        FaultProxy(server.url, PtyEndpoint(), script) as proxy,
    ):
        box = EsperTriggerBox(BoxAddress(proxy.url))
        box.open()
        box.arm(REQUEST)
        box.fire("a")
        report = box.wait_done("a", 2.0)
        box.close()
        assert proxy.done["drop"] > 1
        assert box.health().counters["retries"] >= 1
    # The one order that nobody acknowledges is lost, and nobody can tell: it is said so.
    assert not fake.edges
    assert report.acknowledged is False


def test_the_focus_lines_are_held_before_it_fires() -> None:
    box = FakeEsper(time.monotonic_ns)
    with FakeServer(box, PtyEndpoint()) as server:
        driver = EsperTriggerBox(BoxAddress(server.url), half_press=True, focus_lead_us=300_000.0)
        driver.open()
        driver.arm(ArmRequest("a", {1: Pulse(0.0, 10_000.0)}))
        held = time.monotonic_ns()
        assert box.focus
        driver.fire("a")
        driver.wait_done("a", 1.0)
        driver.close()
    assert box.edges[0].host_ns - held > 250_000_000
    assert not box.focus
