"""Another box, or the same one started anew, that looks in its count like the one before."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import pytest
from trigger_boxes import ONE_EACH, fire_whole, opened, request_for, rises, wait_until

from common.errors import ConflictError, InterlockError
from rig.acquisition.trigger import protocol
from rig.acquisition.trigger.box import TriggerState
from rig.acquisition.trigger.captures import RESET
from rig.acquisition.trigger.driver import SerialTriggerBox
from rig.acquisition.trigger.fake import commands
from rig.acquisition.trigger.fake.device import FakeBox, FakeSettings
from rig.acquisition.trigger.fake.program import FakeTrigger, start_fake


@contextmanager
def replaced(start_id: str | None = None) -> Iterator[tuple[SerialTriggerBox, FakeTrigger]]:
    """A driver whose box was replaced by one of equal name and count, after a capture.

    With ``start_id`` both boxes have that one, so that nothing of ``BOOT?`` tells them apart.
    """
    with start_fake(FakeSettings(start_ticks=20_000_000), port=0) as first:
        port = int(first.url.rpartition(":")[2])
        first.box.start_id = start_id or first.box.start_id
        with opened(first.url) as driver:
            fire_whole(driver, "before")
            first.close()
            with start_fake(port=port) as second:
                second.box.start_id = start_id or second.box.start_id
                assert second.box.permanent.boots == first.box.permanent.boots
                wait_until(lambda: driver.health().state is TriggerState.READY, 6.0)
                yield driver, second


@pytest.mark.parametrize("start_id", [None, "0000"], ids=["by its id", "by its clock"])
def test_a_replaced_box_is_armed_and_fired(start_id: str | None) -> None:
    with replaced(start_id) as (driver, second):
        fire_whole(driver, "after")
        assert rises(second) == ONE_EACH
        assert driver.health().counters["reboots"] == 1


def test_a_box_that_lost_its_outputs_unseen_gets_them_again() -> None:
    with start_fake() as fake, opened(fake.url) as driver:
        fire_whole(driver, "before")
        fake.box.pulses.clear()
        fire_whole(driver, "after")
        assert rises(fake)[1] == 2


def test_what_the_refusal_names_as_remedy_works(monkeypatch: pytest.MonkeyPatch) -> None:
    """A box that forgets its outputs as soon as they are set, until it is reset."""
    broken = [True]
    keep = commands._HANDLERS["OUT"]

    def forgets(box: FakeBox, fields: Mapping[str, str]) -> Mapping[str, str]:
        said = keep(box, fields)
        if broken[0]:
            box.pulses.clear()
        return said

    def heals(box: FakeBox, fields: Mapping[str, str]) -> Mapping[str, str]:
        broken[0] = False
        return reset(box, fields)

    reset = commands._HANDLERS["*RST"]
    handlers = {**commands._HANDLERS, "OUT": forgets, "*RST": heals}
    monkeypatch.setattr(commands, "_HANDLERS", handlers)
    with start_fake() as fake, opened(fake.url) as driver:
        with pytest.raises(ConflictError, match="260") as caught:
            driver.arm(request_for("a"))
        assert caught.value.remedy == f"{RESET}, then try again"
        driver.reset()
        fire_whole(driver, "b")


def test_a_box_with_firmware_of_before_is_used_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    before = {name: args for name, args in protocol.COMMANDS.items() if name != "SAFE?"}
    before["ARM"] = tuple(name for name in before["ARM"] if name != "dm")
    monkeypatch.setattr(protocol, "COMMANDS", before)

    def boot(box: FakeBox, _: Mapping[str, str]) -> Mapping[str, str]:
        return {"n": str(box.permanent.boots), "cause": box.cause}

    monkeypatch.setattr(commands, "_HANDLERS", {**commands._HANDLERS, "BOOT?": boot})
    with start_fake() as fake, opened(fake.url) as driver:
        assert not driver.capabilities.dead_man
        fire_whole(driver, "a")
        fake.box.reset()
        fake.server.wake()
        fire_whole(driver, "b")


def test_a_box_that_has_stopped_for_safety_says_by_which_command_it_is_reset() -> None:
    with start_fake() as fake, opened(fake.url) as driver:
        driver.arm(request_for("a"))
        fake.box.set_interlock(False)
        fake.server.wake()
        wait_until(lambda: driver.health().interlock_closed is False)
        with pytest.raises(InterlockError) as opened_up:
            driver.arm(request_for("b"))
        fake.box.set_interlock(True)
        fake.server.wake()
        wait_until(lambda: driver.health().interlock_closed is True)
        with pytest.raises(ConflictError, match="stopped for safety") as stopped:
            driver.arm(request_for("c"))
        for error in (opened_up.value, stopped.value):
            assert "rigwright trigger reset --station STATION.toml" in error.remedy
