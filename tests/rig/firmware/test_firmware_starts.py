"""Starts: outputs low from the first instruction, what is remembered, what is forgotten."""

from __future__ import annotations

import random
import re

import pytest
from firmware_pulses import ALL, Burst, arm, fire
from firmware_sim import CYCLES_PER_MS, FirmwareSim, Reset, sealed, symbols

SHOT = Burst({1: (0, 200), 13: (100, 50)})
DDRS = {0x24: 0x2F, 0x27: 0x3F, 0x2A: 0xFC}
BOOT_MS = 30.0


def boots(box: FirmwareSim) -> tuple[int, str]:
    words = box.ask("BOOT?").split(" ")
    return int(words[1].removeprefix("n=")), words[2].removeprefix("cause=")


def start_again(box: FirmwareSim, cause: Reset) -> None:
    box.reset(cause)
    box.run(BOOT_MS)


def test_outputs_are_driven_low_within_the_first_instructions(box: FirmwareSim) -> None:
    for cause in (Reset.POWER, Reset.EXTERNAL, Reset.BROWNOUT):
        begin = box.cycle
        box.reset(cause)
        box.run_cycles(40)
        assert {address: box.peek(address, 1)[0] for address in DDRS} == DDRS
        box.run(50.0)
        assert not [edge for edge in box.edges(since=begin) if edge.level]


@pytest.mark.parametrize("cause", [Reset.POWER, Reset.EXTERNAL, Reset.BROWNOUT])
def test_every_start_is_counted_and_gives_its_cause(box: FirmwareSim, cause: Reset) -> None:
    count, first = boots(box)
    assert (count, first) == (1, "POWER")
    start_again(box, cause)
    assert re.fullmatch(f"BOOT n=1 cause={first} id=[0-9A-F]{{4}}", box.event("BOOT"))
    assert re.fullmatch(f"BOOT n=2 cause={cause.name} id=[0-9A-F]{{4}}", box.event("BOOT"))
    assert boots(box) == (2, cause.name)
    assert "ev=1 " in box.ask("STAT?")


def test_power_up_outranks_the_flags_that_come_with_it(one_box: FirmwareSim) -> None:
    start_again(one_box, Reset.POWER | Reset.BROWNOUT | Reset.EXTERNAL)
    assert boots(one_box)[1] == "POWER"


def test_without_flags_memory_tells_a_reset_from_a_power_up(box: FirmwareSim) -> None:
    # What an old bootloader leaves: no flags at all.
    start_again(box, Reset(0))
    assert boots(box)[1] == "EXTERNAL"
    powered = symbols()["powered"]
    box.poke(powered, b"\xa5\xa5")
    start_again(box, Reset(0))
    assert boots(box)[1] == "POWER"


def test_the_count_survives_more_starts_than_it_has_places(one_box: FirmwareSim) -> None:
    for count in range(2, 140):
        start_again(one_box, Reset.POWER)
        if count % 23 == 0 or count > 125:
            assert boots(one_box)[0] == count


def test_a_power_loss_while_the_count_is_written_loses_no_start(js_box: FirmwareSim) -> None:
    # Cut 0 to 25 ms into each start. At worst a start that never said anything is not counted.
    # simavr is no help here: its EEPROM takes no time to write.
    count = boots(js_box)[0]
    for cut in range(26):
        js_box.reset(Reset.POWER)
        js_box.run(float(cut))
        start_again(js_box, Reset.POWER)
        now = boots(js_box)[0]
        assert count < now <= count + 2
        count = now


def test_a_count_that_was_said_never_comes_again(js_box: FirmwareSim) -> None:
    # Cut every 0.1 ms around the end of writing the count, when the banner goes out. Whatever
    # part of a banner got out before the power went, no later start may say the same count.
    said: list[int] = []
    for tenth in range(120, 220):
        js_box.reset(Reset.POWER)
        out = js_box.run(tenth / 10.0)
        said += [int(found) for found in re.findall(rb"BOOT n=(\d+) ", out)]
    assert len(said) > 10, "some starts got as far as their banner"
    assert len(set(said)) == len(said)
    start_again(js_box, Reset.POWER)
    assert boots(js_box)[0] > max(said)


def test_no_two_starts_have_the_same_id(box: FirmwareSim) -> None:
    ids = set()
    for _ in range(12):
        start_again(box, Reset.EXTERNAL)
        box.hush()
        ids.add(box.ask("BOOT?").rpartition("id=")[2])
    assert len(ids) == 12


def test_boxes_whose_memory_comes_up_otherwise_have_other_ids(one_box: FirmwareSim) -> None:
    # A start without flags, so that what is poked stands for how RAM came up with the power.
    ids = set()
    for noise in (b"\x00", b"\x01", b"\x80"):
        one_box.poke(symbols()["id"], b"\x00\x00")
        one_box.poke(symbols()["powered"], b"\xa5\xa5")
        one_box.poke(symbols()["_end"] + 20, noise)
        start_again(one_box, Reset(0))
        one_box.hush()
        ids.add(one_box.ask("BOOT?").rpartition("id=")[2])
    assert len(ids) == 3


def test_the_watchdog_ends_a_hanging_program(box: FirmwareSim) -> None:
    # The line's transmitter held for ever: the program waits for room that never comes.
    arm(box, "a", Burst({2: (0, 2_000_000)}))
    fire(box, "a")
    box.hush()
    assert box.edges()[-1].level == 1
    box.poke(symbols()["tx_held"], b"\x01")
    hung = box.cycle
    box.send(b"STAT?\nSTAT?\n")
    box.run(400.0)
    fell = box.edges()[-1]
    assert fell.level == 0
    assert [cause for _, cause in box.resets()] == [Reset.POWER, Reset.WATCHDOG]
    # 250 ms, and 10 % that simulators and the processor's own oscillator may take.
    assert (fell.cycle - hung) / CYCLES_PER_MS < 280.0
    assert box.event("BOOT", 50.0).startswith("BOOT n=2 cause=WATCHDOG ")
    assert "res=PARTIAL shots=0 of=1" in box.ask("RES? cap=a")


@pytest.mark.parametrize("cause", [Reset.EXTERNAL, Reset.BROWNOUT])
def test_results_survive_a_reset(box: FirmwareSim, cause: Reset) -> None:
    arm(box, "fired", SHOT)
    start = fire(box, "fired")
    box.run(20.0)
    arm(box, "left", SHOT)
    box.ask("DISARM cap=left")
    arm(box, "armed", SHOT)
    start_again(box, cause)
    box.hush()
    fired = f"res=FIRED shots=1 of=1 t0={start:012X} late=0 boot=1"
    assert box.ask("RES? cap=fired") == f"OK {fired}"
    for capture, why in (("left", "disarm"), ("armed", "reset")):
        none = f"res=NOT_FIRED shots=0 of=1 t0=000000000000 late=0 boot=1 why={why}"
        assert box.ask(f"RES? cap={capture}") == f"OK {none}"
    assert "cap=armed " in box.ask("STAT?")
    assert box.ask("FIRE cap=armed").startswith("ERR 221")
    assert box.ask("EDGE? cap=armed i=0") == "ERR 250 unknown"
    box.ask("OUT ch=1 d=0 w=200")
    assert box.ask("ARM cap=fired mask=0001 n=1 iv=0 lead=2000 ttl=5000") == "ERR 223 used"


def test_power_loss_forgets_results_and_only_those(box: FirmwareSim) -> None:
    arm(box, "a", SHOT)
    fire(box, "a")
    box.run(20.0)
    start_again(box, Reset.POWER)
    box.hush()
    assert box.ask("RES? cap=a") == "ERR 250 unknown"
    assert "cap=- " in box.ask("STAT?")
    assert box.ask("FIRE cap=a") == "ERR 210 not-armed"


def test_a_result_gone_bad_is_forgotten_not_believed(one_box: FirmwareSim) -> None:
    arm(one_box, "a", SHOT)
    fire(one_box, "a")
    one_box.run(20.0)
    at = symbols()["results"]
    one_box.poke(at, bytes([one_box.peek(at, 1)[0] ^ 1]))
    start_again(one_box, Reset.EXTERNAL)
    one_box.hush()
    assert one_box.ask("RES? cap=a") == "ERR 250 unknown"


@pytest.mark.slow
def test_a_reset_at_any_moment_of_a_burst_tells_the_truth(box: FirmwareSim) -> None:
    # What the box says afterwards against what a logic analyser saw.
    draw = random.Random(5)  # noqa: S311 - repeatable moments, not secrets
    burst = Burst({1: (0, 300), 16: (200, 400)}, shots=4, interval=4000)
    seen = set()
    for number in range(25):
        arm(box, f"r{number}", burst)
        begin = box.cycle
        box.send(_line(9000 + number, f"FIRE cap=r{number}"))
        box.run_cycles(draw.randrange(2 * CYCLES_PER_MS, 13 * CYCLES_PER_MS))
        start_again(box, draw.choice([Reset.EXTERNAL, Reset.BROWNOUT]))
        box.hush()
        made = [edge for edge in box.edges(since=begin) if edge.level]
        words = box.ask(f"RES? cap=r{number}").split(" ")
        outcome, shots = words[1].removeprefix("res="), int(words[2].removeprefix("shots="))
        seen.add(outcome)
        complete = len(made) // 2
        assert complete - 1 <= shots <= complete
        if outcome == "FIRED":
            assert shots == 4
        elif outcome == "NOT_FIRED":
            assert not made
        else:
            assert outcome == "PARTIAL"
    assert seen == {"FIRED", "PARTIAL", "NOT_FIRED"}


def _line(number: int, command: str) -> bytes:
    return sealed(f"{number} {command}").encode() + b"\n"


def test_the_name_survives_power_loss(box: FirmwareSim) -> None:
    assert ",unnamed," in box.ask("*IDN?")
    assert box.ask("SERIAL sn=north-rig.2") == "OK sn=north-rig.2"
    assert ",north-rig.2," in box.ask("*IDN?")
    box.run(100.0)
    start_again(box, Reset.POWER)
    box.hush()
    assert ",north-rig.2," in box.ask("*IDN?")


@pytest.mark.slow
def test_a_power_loss_while_a_name_is_written_leaves_a_whole_one(js_box: FirmwareSim) -> None:
    box = js_box
    names = ["first", "the-second.name", "3"]
    box.ask(f"SERIAL sn={names[0]}")
    box.run(100.0)
    found = set()
    for cut in range(0, 90, 6):
        old, new = names[cut % 3], names[(cut + 1) % 3]
        box.ask(f"SERIAL sn={old}")
        box.run(150.0)
        box.ask(f"SERIAL sn={new}")
        box.run(float(cut))
        start_again(box, Reset.POWER)
        box.hush()
        name = box.ask("*IDN?").split(",")[2]
        assert name in (old, new)
        found.add(name == new)
    assert found == {True, False}


def test_two_names_in_a_row(one_box: FirmwareSim) -> None:
    one_box.ask("SERIAL sn=one")
    one_box.ask("SERIAL sn=two")
    one_box.run(150.0)
    start_again(one_box, Reset.POWER)
    one_box.hush()
    assert ",two," in one_box.ask("*IDN?")


def test_the_stack_never_comes_near_the_variables(one_box: FirmwareSim) -> None:
    # Everything that nests deepest: ARM with 32 edges, the longest refusals, events and a flood
    # while firing, the interlock's interrupt on top.
    box = one_box
    burst = Burst({o: ((o - 1) * 50, 1000) for o in ALL}, shots=60, interval=9000)
    arm(box, "abcdefghijkl", burst)
    fire(box, "abcdefghijkl")
    box.send(b"TIME? pad=xxxxxxxx\nRES? cap=abcdefghijkl\nCAP?\nEDGE? cap=abcdefghijkl i=31\n" * 9)
    for number in range(40):
        box.at(box.cycle + number * 7001, "interlock open")
        box.at(box.cycle + number * 7001 + 16, "interlock closed")
        box.run_cycles(7001)
    box.hush()
    arm(box, "b", SHOT)
    box.ask("FIRE cap=abcdefghijkl")
    box.ask("SERIAL sn=0123456789abcdef")
    box.interlock(closed=False)
    box.hush()
    assert box.stack_left() >= 96
