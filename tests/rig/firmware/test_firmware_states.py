"""What leads from one state to another, and that nothing but FIRE makes a pulse."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from firmware_pulses import ALL, Burst, arm, fire
from firmware_sim import CYCLES_PER_MS, CYCLES_PER_TICK, FirmwareSim, sealed, symbols

SHOT = Burst({1: (0, 200), 13: (100, 50)})
LONG = Burst({1: (0, 200), 2: (0, 2_000_000), 3: (1_900_000, 200)})
OVERFLOW_MS = 65_536 * CYCLES_PER_TICK / CYCLES_PER_MS
TIMSK1 = 0x6F


def state(box: FirmwareSim) -> str:
    return box.ask("STAT?").split(" ")[1].removeprefix("st=")


def result(box: FirmwareSim, capture: str) -> str:
    return box.ask(f"RES? cap={capture}").split(" ")[1].removeprefix("res=")


def highs(box: FirmwareSim) -> set[int]:
    levels = {edge.output: edge.level for edge in box.edges()}
    return {output for output, level in levels.items() if level}


def idle(box: FirmwareSim) -> None:
    box.ask("*CLS")


def armed(box: FirmwareSim) -> None:
    arm(box, "x", SHOT)


def firing(box: FirmwareSim) -> None:
    arm(box, "x", LONG)
    fire(box, "x")
    box.run(50.0)
    assert highs(box) == {2}


def fault(box: FirmwareSim) -> None:
    arm(box, "x", SHOT)
    box.interlock(closed=False)
    box.event("FAULT")


@pytest.mark.parametrize("order", ["ABORT", "*RST", "typed ABORT"])
@pytest.mark.parametrize(
    ("before", "outcome", "after"),
    [
        (idle, "", "IDLE"),
        (armed, "NOT_FIRED", "IDLE"),
        (firing, "PARTIAL", "IDLE"),
        (fault, "NOT_FIRED", "FAULT"),
    ],
)
def test_abort_and_reset_in_every_state(
    one_box: FirmwareSim,
    before: Callable[[FirmwareSim], None],
    outcome: str,
    after: str,
    order: str,
) -> None:
    before(one_box)
    asked = one_box.cycle
    reply = one_box.ask_raw("ABORT") if order == "typed ABORT" else one_box.ask(order)
    assert reply.endswith(f"OK st={after}")
    assert not highs(one_box)
    if before is firing:
        # The order's 14 characters take 1.3 ms on the line; the rest is the one_box's.
        assert one_box.edges()[-1].cycle - asked < 3 * CYCLES_PER_MS
    if outcome:
        assert result(one_box, "x") == outcome
    count = len(one_box.edges())
    one_box.run(1200.0)
    assert len(one_box.edges()) == count, "no pulse after it"
    assert state(one_box) == after


def test_an_abort_around_the_last_edge_is_told_as_it_was(box: FirmwareSim) -> None:
    burst = Burst({1: (0, 8000), 13: (4000, 2000)})
    outcomes = set()
    for number in range(24):
        arm(box, f"a{number}", burst, lead=14_000)
        begin = box.cycle
        fire(box, f"a{number}")
        # From 3 ms before the first edge to 5 ms behind the last one, in steps of 0.5 ms.
        box.at(box.cycle + number * CYCLES_PER_MS // 2, "send " + b"ABORT\n".hex())
        box.run(30.0)
        assert box.answer() == "- OK st=IDLE"
        made = box.edges(since=begin)
        whole = len(made) == 4 and made[3].cycle - made[0].cycle == 8000 * CYCLES_PER_TICK
        outcome = result(box, f"a{number}")
        assert outcome == ("FIRED" if whole else "PARTIAL")
        outcomes.add((outcome, len(made)))
    assert outcomes == {("PARTIAL", 0), ("PARTIAL", 2), ("PARTIAL", 4), ("FIRED", 4)}


def test_the_clock_of_expiry_is_the_box_s(box: FirmwareSim) -> None:
    box.ask("OUT ch=1 d=0 w=200")
    box.ask("ARM cap=a mask=0001 n=1 iv=0 lead=2000 ttl=1000")
    begin = box.cycle
    assert box.event("EXPIRED", 1200.0) == "EXPIRED cap=a why=ttl"
    # Looked at with every overflow of the timer; the reply to ARM took 5 ms, the event's line 4.
    passed = (box.cycle - begin) / CYCLES_PER_MS
    assert 990.0 < passed < 1000.0 + OVERFLOW_MS + 5.0


def test_a_fire_that_comes_too_late_is_refused_even_before_the_event(one_box: FirmwareSim) -> None:
    one_box.ask("OUT ch=1 d=0 w=200")
    one_box.ask("ARM cap=a mask=0001 n=1 iv=0 lead=2000 ttl=500")
    armed_at = one_box.cycle
    for _ in range(20):  # wherever in the timer's round the time is over
        one_box.run_cycles(CYCLES_PER_MS)
    late = (sealed("9 FIRE cap=a") + "\n").encode()
    one_box.at(armed_at + 500 * CYCLES_PER_MS, f"send {late.hex()}")
    one_box.run(520.0)
    assert one_box.answer().startswith("9 ERR 221 fired cap=a res=NOT_FIRED")
    assert not one_box.edges()


def test_silence_disarms_and_any_checked_request_is_no_silence(box: FirmwareSim) -> None:
    arm(box, "a", SHOT)
    for line in (sealed("1 STAT?"), sealed("2 OUT ch=99 d=0 w=0"), sealed("3 SYST:ERR?")):
        box.run(2900.0)
        assert box.ask_raw(line)
    box.run(2000.0)
    box.send(b"1 STAT? *0000\n\xff\xff\n")  # nothing of it can be trusted
    assert box.answer() == "? ERR -360 checksum"
    assert box.answer() == "? ERR -101 character"
    assert box.event("EXPIRED", 1200.0) == "EXPIRED cap=a why=silence"
    assert state(box) == "IDLE"


@pytest.mark.parametrize(
    "noise",
    [b"~{printable garbage}\n", b"STAT?\n", b"7 STAT?\n", b"ABORT *\n", b"4 OK\n"],
    ids=["garbage", "typed", "typed with a number", "nearly an abort", "a reply"],
)
@pytest.mark.parametrize("when", ["armed", "firing"])
def test_noise_is_no_sign_of_life(one_box: FirmwareSim, when: str, noise: bytes) -> None:
    arm(one_box, "x", Burst({1: (0, 200)}, shots=64, interval=1_000_000), dead_man_ms=3000)
    if when == "firing":
        fire(one_box, "x")
    for _ in range(33):
        one_box.send(noise)
        one_box.run(100.0)
    one_box.hush()
    assert one_box.ask("RES? cap=x").endswith("why=silence")
    assert state(one_box) == "IDLE"


def test_the_box_s_own_voice_is_no_sign_of_life(one_box: FirmwareSim) -> None:
    # A line that hands everything back: each answer is sealed, numbered, and answered again.
    armed(one_box)
    for _ in range(33):
        one_box.send((sealed("7 OK st=ARMED") + "\n" + sealed("! 7 ARMED cap=x") + "\n").encode())
        one_box.run(100.0)
    one_box.hush()
    assert one_box.ask("RES? cap=x").endswith("why=silence")


LATE_BY_MS = 100.0
"""docs/reference/trigger-protocol.md: how long after the dead man's time the last edge may come."""


@pytest.mark.parametrize("dead_man_ms", [500, 3000, 5000])
def test_without_a_sign_of_life_a_burst_stops(box: FirmwareSim, dead_man_ms: int) -> None:
    burst = Burst({1: (0, 200_000), 2: (120_000, 200)}, shots=64, interval=600_000)
    arm(box, "a", burst, dead_man_ms=dead_man_ms)
    fire(box, "a")
    for _ in range(2):
        box.run(0.9 * dead_man_ms)
        assert state(box) == "FIRING"
    last = max(cycle for cycle, byte in box.received() if byte == ord("\n"))
    box.run(dead_man_ms + LATE_BY_MS)
    stopped_ms = (box.edges()[-1].cycle - last) / CYCLES_PER_MS
    # Not sooner than promised, less a shot's pause of 200 ms, in which nothing is there to stop.
    assert dead_man_ms - 200.0 < stopped_ms < dead_man_ms + LATE_BY_MS
    assert not highs(box)
    assert box.event("EXPIRED") == "EXPIRED cap=a why=silence"
    assert state(box) == "IDLE"
    assert box.ask("RES? cap=a").endswith("why=silence")
    assert result(box, "a") == "PARTIAL"


def test_the_dead_man_is_on_unless_told_otherwise(one_box: FirmwareSim) -> None:
    one_box.ask("OUT ch=1 d=0 w=200")
    assert one_box.ask("SAFE?").startswith("OK dm=3000 ")
    one_box.ask("ARM cap=a mask=0001 n=64 iv=2000000 lead=2000 ttl=5000")
    fire(one_box, "a")
    one_box.run(4000.0)
    # At 1, 1001 and 2001 ms; the time is over at 3000 ms.
    one_box.hush()
    assert "res=PARTIAL shots=3 " in one_box.ask("RES? cap=a")


def test_a_burst_may_be_left_alone(one_box: FirmwareSim) -> None:
    arm(one_box, "a", Burst({1: (0, 200), 2: (8_000_000, 200)}), dead_man_ms=0)
    fire(one_box, "a")
    one_box.run(4100.0)
    assert result(one_box, "a") == "FIRED"


@pytest.mark.parametrize("dead_man_ms", [1, 499, 30_001])
def test_a_dead_man_s_time_beyond_the_limits_is_refused(
    one_box: FirmwareSim, dead_man_ms: int
) -> None:
    assert arm(one_box, "a", SHOT, dead_man_ms=dead_man_ms) == "ERR -222 range key=dm"


@pytest.mark.parametrize(
    ("width", "interval", "sound"),
    [(50, 8_050, True), (50, 8_049, False), (4_000, 16_000, True), (4_000, 15_999, False)],
)
def test_a_strobe_rests_between_its_pulses(
    one_box: FirmwareSim, width: int, interval: int, sound: bool
) -> None:
    # 4 ms after a short pulse; after a long one as long as leaves it on for a quarter of the time.
    reply = arm(one_box, "a", Burst({13: (0, width)}, shots=3, interval=interval))
    assert reply.startswith("OK") if sound else reply == "ERR -222 range key=iv"


def test_a_strobe_rests_between_captures(one_box: FirmwareSim) -> None:
    # 100 ms on ask for 300 ms off. What has no strobe, or a late one, need not wait.
    arm(one_box, "a", Burst({13: (0, 200_000)}))
    fire(one_box, "a")
    one_box.run(110.0)
    reply = arm(one_box, "b", Burst({13: (0, 100)}))
    assert reply.startswith("ERR 231 rest ms=")
    wait_ms = int(reply.rpartition("=")[2])
    assert 200 < wait_ms < 300
    assert arm(one_box, "c", Burst({1: (0, 100)})).startswith("OK")
    assert arm(one_box, "d", Burst({13: (600_000, 100)})).startswith("OK")
    one_box.ask("DISARM cap=d")
    one_box.run(wait_ms)
    assert arm(one_box, "e", Burst({13: (0, 100)})).startswith("OK")


def test_the_interlock_lowers_everything_at_once(box: FirmwareSim) -> None:
    arm(box, "a", Burst(dict.fromkeys((o for o in ALL if o not in (13, 14)), (0, 2_000_000))))
    fire(box, "a")
    box.run(50.0)
    assert len(highs(box)) == 14
    opened = box.cycle
    box.interlock(closed=False)
    assert box.event("FAULT") == "FAULT cap=a why=interlock"
    assert not highs(box)
    # 4 us to tell it from a glitch, and what one interrupt may take.
    assert max(edge.cycle for edge in box.edges()) - opened < 20 * 16
    assert "res=PARTIAL shots=0" in box.ask("RES? cap=a")
    box.interlock(closed=True)
    box.run(50.0)
    assert state(box) == "FAULT"
    assert box.ask("*RST") == "OK st=IDLE"


def test_a_glitch_of_the_interlock_is_none(box: FirmwareSim) -> None:
    arm(box, "a", LONG)
    fire(box, "a")
    now = box.cycle + 10 * CYCLES_PER_MS
    for number in range(50):
        box.at(now + number * 10_000, "interlock open")
        box.at(now + number * 10_000 + 2 * 16, "interlock closed")
        box.run_cycles(10_000)
    assert state(box) == "FIRING"
    assert "il=CLOSED" in box.ask("STAT?")


def test_a_bouncing_interlock_is_open_until_it_rests(one_box: FirmwareSim) -> None:
    one_box.interlock(closed=False)
    one_box.event("INTERLOCK")
    for _ in range(20):
        one_box.interlock(closed=True)
        one_box.run(4.0)
        one_box.interlock(closed=False)
        one_box.run(0.5)
    assert "il=OPEN" in one_box.ask("STAT?")
    one_box.interlock(closed=True)
    assert one_box.event("INTERLOCK") == "INTERLOCK il=CLOSED"


@pytest.mark.parametrize(("output", "limit_ms"), [(13, 100.0), (1, 8000.0)])
def test_the_supervisor_ends_what_the_edges_do_not(
    box: FirmwareSim, output: int, limit_ms: float
) -> None:
    # Its interrupt switched off, the edge that ends the pulse never comes.
    arm(box, "a", Burst({output: (0, 200_000), 2: (150_000, 100)}))
    fire(box, "a")
    box.run(20.0)
    rose = box.edges()[-1]
    assert (rose.output, rose.level) == (output, 1)
    box.poke(TIMSK1, b"\x01")
    assert box.event("FAULT", limit_ms + 200.0) == "FAULT cap=a why=overtime"
    held_ms = (box.edges()[-1].cycle - rose.cycle) / CYCLES_PER_MS
    assert not highs(box)
    assert limit_ms < held_ms < limit_ms + 3.5 * OVERFLOW_MS
    assert result(box, "a") == "PARTIAL"
    assert box.ask("*RST") == "OK st=IDLE"


def test_the_supervisor_lets_every_allowed_pulse_be(one_box: FirmwareSim) -> None:
    # The longest pulses there are; and short ones that are high each time it looks.
    box = one_box
    arm(box, "a", Burst({1: (0, 16_000_000), 13: (0, 200_000), 14: (15_800_000, 200_000)}))
    fire(box, "a")
    box.run(8400.0)  # 300 ms more for the strobe to rest
    assert result(box, "a") == "FIRED"
    arm(box, "b", Burst({1: (0, 40_000), 13: (0, 16_000)}, shots=60, interval=65_536))
    box.run(7.0)
    fire(box, "b")
    box.run(2100.0)
    assert result(box, "b") == "FIRED"


def test_an_output_that_is_high_by_itself_is_lowered(one_box: FirmwareSim) -> None:
    one_box.poke(0x28, b"\x01")  # PORTC0, output 1
    assert highs(one_box) == {1}
    assert one_box.event("FAULT", 9000.0) == "FAULT why=overtime"
    assert not highs(one_box)


def test_the_first_edge_comes_lead_behind_fire(one_box: FirmwareSim) -> None:
    for capture, lead in (("a", 2000), ("b", 60_000)):
        arm(one_box, capture, SHOT, lead=lead)
        begin = one_box.cycle
        one_box.ask(f"FIRE cap={capture}")
        one_box.run(50.0)
        first = one_box.edges(since=begin)[0].cycle - begin
        # The 18 characters of the line take 1.6 ms, reading them less than 1 ms.
        assert 0 < first - lead * CYCLES_PER_TICK - 1.5 * CYCLES_PER_MS < 1.2 * CYCLES_PER_MS


def test_sixty_four_shots_are_told_one_by_one(one_box: FirmwareSim) -> None:
    # Faster than their events can be sent: none is lost, FIRED comes last.
    burst = Burst({1: (0, 200)}, shots=64, interval=2200)
    arm(one_box, "a", burst)
    one_box.hush()
    start = fire(one_box, "a")
    for k in range(64):
        instant = start + k * burst.interval
        assert one_box.event("DONE") == f"DONE cap=a shot={k + 1} of=64 t0={instant:012X} late=0"
    assert one_box.event("FIRED") == f"FIRED cap=a shots=64 t0={start:012X}"


def test_arming_again_before_all_is_told_says_what_counts(one_box: FirmwareSim) -> None:
    arm(one_box, "a", Burst({1: (0, 200)}, shots=64, interval=2200))
    fire(one_box, "a")
    one_box.run(90.0)
    assert one_box.ask("ARM cap=b mask=0001 n=1 iv=0 lead=2000 ttl=5000").startswith("OK")
    assert one_box.event("FIRED").startswith("FIRED cap=a shots=64")
    assert one_box.event("ARMED") == "ARMED cap=b"


def test_event_numbers_skip_zero(one_box: FirmwareSim) -> None:
    one_box.poke(symbols()["last_number"], (65_533).to_bytes(2, "little"))
    arm(one_box, "a", SHOT)
    one_box.hush()
    fire(one_box, "a")
    one_box.run(30.0)
    numbers = [int(line.split(" ")[1]) for line in one_box.lines(20.0) if line.startswith("!")]
    assert numbers == [65_535, 1]
    assert "name=ARMED" in one_box.ask("LOG? n=65534")
    assert "name=DONE" in one_box.ask("LOG? n=65535")
    assert one_box.ask("LOG? n=0") == "ERR 250 unknown"
    assert "name=FIRED" in one_box.ask("LOG? n=1")


def test_the_log_tells_the_last_sixteen_as_they_were_sent(one_box: FirmwareSim) -> None:
    sent = {}
    for number in range(10):
        one_box.ask("OUT ch=1 d=0 w=200")
        one_box.ask(f"ARM cap=c{number} mask=0001 n=1 iv=0 lead=2000 ttl=5000")
        one_box.ask(f"DISARM cap=c{number}")
    one_box.run(20.0)
    for line in [*one_box.events, *(line.rpartition(" *")[0] for line in one_box.lines(1.0))]:
        _, number, rest = line.split(" ", 2)
        sent[int(number)] = rest
    last = max(sent)
    for number in range(last - 15, last + 1):
        name, _, fields = sent[number].partition(" ")
        assert one_box.ask(f"LOG? n={number}") == f"OK ev={number} name={name} {fields}"
    assert one_box.ask(f"LOG? n={last - 16}") == "ERR 250 unknown"
    assert one_box.ask(f"LOG? n={last + 1}") == "ERR 250 unknown"
