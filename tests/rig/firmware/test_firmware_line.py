"""The line itself: noise, floods, repeats, and a host that speaks over the real port."""

from __future__ import annotations

import random
from collections.abc import Iterator

import pytest
import serial
from firmware_sim import FirmwareSim, Simulator, sealed
from firmware_started import started
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st


@pytest.fixture(scope="module")
def noisy_box(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FirmwareSim]:
    with started(Simulator.SIMAVR, tmp_path_factory.mktemp("noise") / "edges.log") as box:
        yield box


WORDS = st.sampled_from(
    b"1 |FIRE|ARM|OUT|ABORT|STAT?| cap=a| ch=1| *0000|\n|=|*| |\r|\x00|\xff|LOG? n=1".split(b"|")
)


@pytest.mark.slow
@pytest.mark.needs_avr
@settings(
    max_examples=150,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(st.lists(st.one_of(WORDS, st.binary(max_size=40)), max_size=12).map(b"".join))
def test_no_noise_makes_a_pulse_or_stops_the_box(noisy_box: FirmwareSim, noise: bytes) -> None:
    noisy_box.send(noise)
    noisy_box.hush()
    assert "st=IDLE" in noisy_box.ask("STAT?")
    assert not noisy_box.edges()
    assert noisy_box.ask("BOOT?").startswith("OK n=1 cause=POWER id=")


def test_a_sound_line_gets_one_reply_whatever_was_before(box: FirmwareSim) -> None:
    draw = random.Random(7)  # noqa: S311 - repeatable noise, not a secret
    for number in range(30):
        noise = bytes(draw.randrange(256) for _ in range(draw.randrange(60)))
        box.send(noise.replace(b"\n", b" ") + b"\n")
        box.hush()
        assert box.ask_raw(sealed(f"{number} STAT?")).startswith(f"{number} OK")
        assert not list(box.lines(20.0))


def test_no_flipped_bit_is_obeyed(one_box: FirmwareSim) -> None:
    line = sealed("7 OUT ch=1 d=0 w=200").encode()
    for bit in range(8 * len(line)):
        broken = bytearray(line)
        broken[bit // 8] ^= 1 << bit % 8
        one_box.send(bytes(broken) + b"\n")
        one_box.hush()
    assert one_box.ask("ARM cap=a mask=0001 n=1 iv=0 lead=2000 ttl=9") == "ERR 260 nothing"


def test_lines_end_to_end_are_all_answered(box: FirmwareSim) -> None:
    # As many as the receiver's ring holds while the longest reply is sent.
    box.send(b"".join(sealed(f"{n} STAT?").encode() + b"\n" for n in range(1, 7)))
    answers = [box.answer(200.0).split(" ")[0] for _ in range(6)]
    assert answers == ["1", "2", "3", "4", "5", "6"]


def test_what_is_lost_in_a_flood_is_never_half_believed(box: FirmwareSim) -> None:
    # Requests at the line's full rate, replies eight times as long: most must be lost. Each one
    # that is answered was answered whole, and nothing else was understood. In the time of 2000
    # requests of 15 bytes the line carries 250 replies of 120; a quarter of them is asked for,
    # as what was cut off gets replies too.
    requests = 2000
    box.send(b"".join(sealed(f"{n} CAP?").encode() + b"\n" for n in range(requests)))
    box.run(3000.0)
    heads = [line.split(" ")[0] for line in box.lines(1.0)]
    numbers = [int(head) for head in heads if head.isdigit()]
    assert numbers == sorted(set(numbers)), "each once, in order"
    assert len(numbers) > 60
    assert set(heads) - {str(n) for n in numbers} <= {"?", "!"}
    assert "?" in heads, "nothing was lost: this test tests nothing"
    box.hush()
    assert "st=IDLE" in box.ask("STAT?")


def test_a_repeat_is_known_by_number_and_checksum(one_box: FirmwareSim) -> None:
    first = sealed("9 OUT ch=1 d=0 w=200")
    assert one_box.ask_raw(first) == "9 OK ch=1 d=0 w=200"
    assert one_box.ask_raw(sealed("9 OUT ch=1 d=0 w=400")) == "9 OK ch=1 d=0 w=400"
    assert one_box.ask_raw(first) == "9 OK ch=1 d=0 w=200"
    reply = one_box.ask("ARM cap=a mask=0001 n=1 iv=0 lead=2000 ttl=9")
    assert reply.endswith("dur=400"), "the repeat was answered, not done"


def test_the_longest_replies_are_stored_whole(one_box: FirmwareSim) -> None:
    one_box.ask("OUT ch=1 d=60000000 w=16000000")
    longest = sealed("65535 ARM cap=abcdefghijkl mask=0001 n=1 iv=0 lead=2000 ttl=300000")
    reply = one_box.ask_raw(longest)
    assert reply == "65535 OK st=ARMED cap=abcdefghijkl edges=2 dur=76000000"
    assert one_box.ask_raw(longest) == reply
    one_box.ask("DISARM cap=abcdefghijkl")
    refused = sealed("65534 FIRE cap=abcdefghijkl")
    reply = one_box.ask_raw(refused)
    assert reply == "65534 ERR 221 fired cap=abcdefghijkl res=NOT_FIRED t0=000000000000"
    assert one_box.ask_raw(refused) == reply


@pytest.mark.parametrize("line", ["CAP?", "STAT?", "RES? cap=a", "*IDN?"])
def test_no_line_of_the_box_is_longer_than_agreed(one_box: FirmwareSim, line: str) -> None:
    one_box.ask("SERIAL sn=0123456789abcdef")
    reply = one_box.ask_raw(sealed(f"65535 {line}"))
    assert len(sealed(reply)) <= 127


def test_a_host_on_the_port(device_url: str) -> None:
    with serial.serial_for_url(device_url, baudrate=115200, timeout=2.0) as port:
        port.write(b"\n")
        for number in range(20):
            port.write(sealed(f"{number} STAT?").encode() + b"\n")
            while (line := port.readline()).startswith((b"!", b"\n")):
                pass
            assert line.startswith(f"{number} OK st=IDLE".encode())


def test_a_running_simulator_ends_with_its_owner(box: FirmwareSim) -> None:
    box.pace("full")
    box.close()
    assert box.ended
