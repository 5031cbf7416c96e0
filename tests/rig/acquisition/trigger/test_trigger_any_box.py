"""One suite over every box there is: the fake, and the firmware on the simulators.

It uses the driver and the public line only; what the outputs did is counted outside the box.
"""

from __future__ import annotations

import contextlib
from pathlib import Path

import pytest
from trigger_boxes import AnyBox, opened, request_for, wait_until

from common.errors import ConflictError, DeviceError, InputError, InterlockError
from rig.acquisition.trigger.box import ArmRequest, FireOutcome, Pulse, TriggerState
from rig.acquisition.trigger.driver import BoxAddress, SerialTriggerBox
from rig.acquisition.trigger.endpoint import PtyEndpoint
from rig.acquisition.trigger.faultscript import FaultRates, Incident, ProxyScript
from rig.acquisition.trigger.proxy import FaultProxy


def test_a_capture_is_fired_once_and_reported_whole(box_under_test: AnyBox) -> None:
    with opened(box_under_test.url) as driver:
        driver.arm(request_for("a", shots=2))
        assert driver.health().state is TriggerState.ARMED
        driver.fire("a")
        report = driver.wait_done("a", 2.0)
        assert report.outcome is FireOutcome.FIRED
        assert (report.shots_done, report.shots_wanted) == (2, 2)
        assert report.why == ""
        rising = report.rising_edges(2)
        assert [edge.at_us for edge in rising] == [100.0, 100.0]
        assert [edge.shot for edge in rising] == [1, 2]
        # 5 ms from start to start, by a clock that is right to 1 %.
        assert rising[1].at_host_ns - rising[0].at_host_ns == pytest.approx(5e6, rel=0.011)
        assert driver.health().state is TriggerState.READY
    assert box_under_test.rises() == {1: 2, 2: 2, 13: 2}


def test_a_second_fire_is_refused(box_under_test: AnyBox) -> None:
    with opened(box_under_test.url) as driver:
        driver.arm(request_for("a"))
        driver.fire("a")
        with pytest.raises(ConflictError, match="has been fired"):
            driver.fire("a")
        driver.wait_done("a", 2.0)
        with pytest.raises(ConflictError, match="is over"):
            driver.fire("a")
    assert box_under_test.rises()[1] == 1


def test_disarm_makes_no_pulse(box_under_test: AnyBox) -> None:
    with opened(box_under_test.url) as driver:
        driver.arm(request_for("a"))
        driver.disarm("a")
        assert driver.wait_done("a", 1.0).outcome is FireOutcome.NOT_FIRED
        driver.disarm("a")
        with pytest.raises(ConflictError):
            driver.fire("a")
    assert not box_under_test.rises()


def test_abort_while_armed_and_while_firing(box_under_test: AnyBox) -> None:
    with opened(box_under_test.url) as driver:
        driver.abort()
        driver.arm(request_for("a"))
        driver.abort()
        assert driver.wait_done("a", 1.0).outcome is FireOutcome.NOT_FIRED
        driver.arm(request_for("b", late_us=600_000.0))
        driver.fire("b")
        driver.abort()
        report = driver.wait_done("b", 1.0)
        assert report.outcome is FireOutcome.PARTIAL
        assert report.shots_done == 0
    assert box_under_test.rises()[3] == 0


def test_the_open_interlock_keeps_everything_off(box_under_test: AnyBox) -> None:
    with opened(box_under_test.url) as driver:
        driver.arm(request_for("a"))
        box_under_test.set_interlock(False)
        assert driver.wait_done("a", 1.5).outcome is FireOutcome.NOT_FIRED
        with pytest.raises(InterlockError):
            driver.arm(request_for("b"))
        with pytest.raises(InterlockError):
            driver.reset()
        box_under_test.set_interlock(True)
        # Real contacts bounce: the firmware waits before it believes that it is closed.
        wait_until(lambda: driver.health().interlock_closed is True)
        driver.reset()
        driver.arm(request_for("c"))
        driver.fire("c")
        assert driver.wait_done("c", 2.0).outcome is FireOutcome.FIRED
    assert box_under_test.rises()[1] == 1


def test_a_reset_while_armed_is_noticed(box_under_test: AnyBox) -> None:
    with opened(box_under_test.url) as driver:
        driver.arm(request_for("a"))
        box_under_test.reset()
        report = driver.wait_done("a", 2.0)
        assert report.outcome is FireOutcome.NOT_FIRED
        # The box has forgotten its outputs: they must be sent again.
        driver.arm(request_for("b"))
        driver.fire("b")
        assert driver.wait_done("b", 2.0).outcome is FireOutcome.FIRED
        assert driver.health().counters["reboots"] == 1
    assert box_under_test.rises() == {1: 1, 2: 1, 13: 1}


def test_a_reset_while_firing_is_a_partial_capture(box_under_test: AnyBox) -> None:
    with opened(box_under_test.url) as driver:
        driver.arm(request_for("a", shots=2, late_us=400_000.0))
        driver.fire("a")
        box_under_test.reset()
        report = driver.wait_done("a", 2.0)
        assert report.outcome is FireOutcome.PARTIAL
        assert report.shots_done == 0
    assert box_under_test.rises()[3] == 0


def test_expiry(box_under_test: AnyBox) -> None:
    with opened(box_under_test.url) as driver:
        request = request_for("a")
        driver.arm(ArmRequest("a", request.pulses, lead_us=1000.0, expires_s=0.3))
        assert driver.wait_done("a", 2.0).outcome is FireOutcome.NOT_FIRED
        with pytest.raises(ConflictError, match="is over"):
            driver.fire("a")
    assert not box_under_test.rises()


def test_what_the_box_cannot_do_is_said_before_it_is_asked(box_under_test: AnyBox) -> None:
    with opened(box_under_test.url) as driver:
        limits = driver.capabilities
        for pulses in (
            {},
            {1: Pulse(0.0, 0.0)},
            {17: Pulse(0.0, 100.0)},
            {1: Pulse(limits.max_delay_us + 1.0, 100.0)},
            {1: Pulse(0.0, limits.max_width_us + 1.0)},
            {1: Pulse(0.0, 100.0), 2: Pulse(0.5, 100.0)},
        ):
            with pytest.raises(InputError):
                driver.arm(ArmRequest("a", pulses))
        assert driver.health().state is TriggerState.READY


@pytest.mark.parametrize("lost", ["request", "reply"])
def test_a_lost_fire_line_never_makes_two_pulses(
    box_under_test: AnyBox, lost: str, tmp_path: Path
) -> None:
    incident = {
        "request": Incident("to_box", "drop", containing="FIRE"),
        "reply": Incident("to_host", "drop", containing="OK cap=a t0="),
    }[lost]
    script = ProxyScript(incidents=(incident,))
    with _proxy(box_under_test, script, tmp_path) as proxy, opened(proxy.url) as driver:
        driver.arm(request_for("a"))
        driver.fire("a")
        report = driver.wait_done("a", 2.0)
        assert report.outcome is FireOutcome.FIRED
        assert proxy.done["drop"] == 1
        assert ("acknowledgement" in report.why) == (lost == "reply")
    assert box_under_test.rises() == {1: 1, 2: 1, 13: 1}


def test_unplugged_between_fire_and_its_answer(box_under_test: AnyBox, tmp_path: Path) -> None:
    incident = Incident("to_host", "unplug", containing="OK cap=a t0=", for_s=0.1)
    script = ProxyScript(incidents=(incident,))
    with _proxy(box_under_test, script, tmp_path) as proxy, opened(proxy.url) as driver:
        driver.arm(request_for("a"))
        with pytest.raises(DeviceError, match="cannot be reached"):
            driver.fire("a")
        report = driver.wait_done("a", 2.0)
        assert report.outcome is FireOutcome.FIRED
        assert len(report.edges) == 6
        assert driver.health().counters["reconnects"] >= 1
    assert box_under_test.rises() == {1: 1, 2: 1, 13: 1}


def test_some_fires_through_a_bad_line(box_under_test: AnyBox, tmp_path: Path) -> None:
    script = ProxyScript(FaultRates.all_at(0.05), FaultRates.all_at(0.05), seed=5)
    outcomes = []
    with _proxy(box_under_test, script, tmp_path) as proxy, opened(proxy.url) as driver:
        for number in range(8):
            try:
                driver.arm(request_for(f"a{number}"))
            except DeviceError:
                continue
            with contextlib.suppress(DeviceError):
                driver.fire(f"a{number}")
            outcomes.append(driver.wait_done(f"a{number}", 2.0).outcome)
        assert sum(proxy.done.values()) > 0
    fired = outcomes.count(FireOutcome.FIRED)
    assert fired >= 6
    assert fired <= box_under_test.rises()[1] <= len(outcomes)


def _proxy(box: AnyBox, script: ProxyScript, folder: Path) -> FaultProxy:
    return FaultProxy(box.url, PtyEndpoint(folder / "port"), script, box.reset)


def test_opening_twice_is_one_opening(box_under_test: AnyBox) -> None:
    driver = SerialTriggerBox(BoxAddress(box_under_test.url))
    driver.open()
    driver.open()
    driver.close()
    driver.close()
    driver.open()
    driver.arm(request_for("a"))
    driver.close()
    assert not box_under_test.rises()
