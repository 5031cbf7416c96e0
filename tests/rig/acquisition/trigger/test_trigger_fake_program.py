"""The fake box as a program and as a device on a line."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest
import serial
from trigger_boxes import opened, wait_until

from common.errors import InputError
from rig.acquisition.trigger.conformance import Hands, load_vectors, play_dialogue, play_framing
from rig.acquisition.trigger.driver import BoxAddress
from rig.acquisition.trigger.esper import EsperTriggerBox
from rig.acquisition.trigger.fake.faults import FakeFaults
from rig.acquisition.trigger.fake.program import FakeOptions, run_fake, start_fake

DIALOGUES = {d["name"]: d for d in load_vectors()["dialogues"]}
CHOSEN = (
    "who and what it is",
    "typed by hand: queries and ABORT go without checksum and number",
    "a burst",
    "a repeated line gets the stored reply and is not done again",
)


@pytest.mark.parametrize("name", CHOSEN)
@pytest.mark.parametrize("over", ["pty", "tcp"])
def test_vectors_over_a_real_line(name: str, over: str) -> None:
    with (
        start_fake(port=0 if over == "tcp" else None) as fake,
        serial.serial_for_url(fake.url, timeout=0.05) as port,
    ):
        play_dialogue(DIALOGUES[name], port, Hands())
        for vector in load_vectors()["framing"]:
            play_framing(vector, port, Hands())


@pytest.mark.parametrize("where", ["pty", "link", "port"])
def test_the_program_says_where_it_is_and_ends_when_told(where: str, tmp_path: Path) -> None:
    said: list[str] = []
    options = FakeOptions(
        serial_number="bench-1",
        link=tmp_path / "box" if where == "link" else None,
        port=0 if where == "port" else None,
        drift_ppm=100.0,
        jitter_us=1.0,
        faults="lost=0.01",
    )
    thread = threading.Thread(target=run_fake, args=(options, said.append))
    thread.start()
    wait_until(lambda: bool(said))
    with opened(said[0].split(" at ")[1].split(" ")[0]) as driver:
        assert driver.health().serial_number == "bench-1"
    options.stop.set()
    thread.join()
    assert not (tmp_path / "box").exists()


def test_the_program_can_be_an_esper_box() -> None:
    said: list[str] = []
    options = FakeOptions(serial_number="34", esper=True, port=0)
    thread = threading.Thread(target=run_fake, args=(options, said.append))
    thread.start()
    wait_until(lambda: bool(said))
    box = EsperTriggerBox(BoxAddress(said[0].split(" at ")[1].split(" ")[0]))
    box.open()
    assert box.health().serial_number == "34"
    box.close()
    options.stop.set()
    thread.join()


def test_faults_in_words() -> None:
    faults = FakeFaults.parse("lost=0.05,silent_after=3,reset_in=FIRING")
    assert faults == FakeFaults(lost=0.05, silent_after=3, reset_in="FIRING")
    assert FakeFaults.parse("") == FakeFaults()


@pytest.mark.parametrize("words", ["lost", "lost=often", "wobble=1", "silent_after=0.5"])
def test_faults_that_are_none(words: str) -> None:
    with pytest.raises(InputError, match="is no fault of the fake box"):
        FakeFaults.parse(words)


def test_places_that_cannot_be(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("a file of somebody")
    with pytest.raises(InputError, match="no link of a fake box"):
        start_fake(link=tmp_path / "taken")
    assert (tmp_path / "taken").read_text() == "a file of somebody"
    with pytest.raises(InputError, match="either a link or a port"):
        start_fake(link=tmp_path / "box", port=0)
    with start_fake(port=0) as fake:
        taken = int(fake.url.rsplit(":", 1)[1])
        with pytest.raises(InputError, match="is taken"):
            start_fake(port=taken)


def test_a_second_client_is_turned_away() -> None:
    with start_fake(port=0) as fake:
        with serial.serial_for_url(fake.url, timeout=1.0) as first:
            first.write(b"*IDN?\n")
            assert b"Rigwright" in first.readline() + first.readline()
            second = serial.serial_for_url(fake.url, timeout=1.0)
            with pytest.raises((serial.SerialException, OSError)):
                second.read(1)
            second._socket.close()
            first.write(b"*IDN?\n")
            assert b"Rigwright" in first.readline()
        # And after the first has gone, the next one is served.
        with opened(fake.url) as driver:
            assert driver.health().identity
