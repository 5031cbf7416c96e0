"""Lines: any bytes in any pieces, and what a flipped bit can do."""

from __future__ import annotations

import contextlib
import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import InputError
from rig.acquisition.trigger.lines import (
    MAX_ANSWER,
    MAX_REQUEST,
    Checksum,
    ErrorCode,
    LineError,
    LineReader,
    crc16,
    seal,
    unseal,
)
from rig.acquisition.trigger.protocol import (
    Event,
    Reply,
    Request,
    instant_text,
    instant_ticks,
    parse_answer,
    parse_request,
)

WORD = st.text("abcdefghijklmnopqrstuvwxyzABCXYZ0123456789._-", min_size=1, max_size=8)
KEY = st.text("abcdefghijklmnopqrstuvwxyz", min_size=1, max_size=5)
FIELDS = st.dictionaries(KEY, WORD, max_size=3)
NOISE = st.lists(
    st.one_of(st.binary(max_size=30), st.just(b"\n"), st.just(b"12 STAT? *0BCA\n")), max_size=30
).map(b"".join)


def pieces(data: bytes, cuts: list[int]) -> list[bytes]:
    at = sorted({0, len(data), *(cut % (len(data) + 1) for cut in cuts)})
    return [data[a:b] for a, b in itertools.pairwise(at)]


@given(NOISE, st.lists(st.integers(0, 10_000), max_size=20))
def test_lines_do_not_depend_on_how_the_bytes_come(data: bytes, cuts: list[int]) -> None:
    whole = LineReader().feed(data)
    reader = LineReader()
    assert [line for piece in pieces(data, cuts) for line in reader.feed(piece)] == whole


@given(NOISE)
def test_after_any_noise_the_next_line_is_read(noise: bytes) -> None:
    reader = LineReader()
    reader.feed(noise)
    line = Request(7, "STAT?").line()
    *_, last = reader.feed(b"\n" + line)
    assert parse_request(last).command == "STAT?"


@given(NOISE)
def test_any_bytes_give_a_request_or_a_line_error(noise: bytes) -> None:
    for raw in LineReader().feed(noise + b"\n"):
        with contextlib.suppress(LineError):
            parse_request(raw)
        with contextlib.suppress(LineError):
            parse_answer(raw)


def test_a_flood_without_end_takes_no_memory() -> None:
    reader = LineReader()
    for _ in range(100):
        assert reader.feed(b"x" * 10_000) == []
    assert len(reader._line) <= MAX_REQUEST + 2
    (line,) = reader.feed(b"\n")
    assert not line.sound
    assert len(line.data) == MAX_REQUEST


@given(st.integers(0, 65535), WORD, FIELDS)
def test_requests_replies_and_events_survive_the_line(
    number: int, name: str, fields: dict[str, str]
) -> None:
    reader = LineReader(MAX_ANSWER)
    for said in (
        Reply(str(number), 0, "", fields),
        Reply("?", ErrorCode.CHECKSUM, ErrorCode.CHECKSUM.word, fields),
        Event(number, name, fields),
    ):
        (raw,) = reader.feed(said.line())
        assert parse_answer(raw) == said


@given(st.integers(0, 65535), st.integers(0, 10_000), st.integers(1, 7))
def test_one_or_two_flipped_bits_never_make_another_checked_request(
    number: int, place: int, apart: int
) -> None:
    line = bytearray(Request(number, "FIRE", {"cap": "4f2a"}).line()[:-1])
    bits = len(line) * 8
    for at in {place % bits, (place + apart) % bits}:
        line[at // 8] ^= 1 << (at % 8)
    for raw in LineReader().feed(bytes(line) + b"\n"):
        with contextlib.suppress(LineError):
            request = parse_request(raw)
            # A CRC-16 finds every error of two bits in so short a line. What is left is a line
            # whose mark of a checksum was hit: it is unchecked, and FIRE is refused then.
            assert request.checksum is None
            assert request.query


@given(st.binary(max_size=40).filter(lambda data: b"\n" not in data))
def test_a_sealed_body_is_recognised(data: bytes) -> None:
    body = data.hex()
    assert unseal(seal(body, 127)[:-1].decode()) == (body, Checksum.GOOD)


def test_the_known_checksum() -> None:
    assert crc16(b"123456789") == 0x29B1


@pytest.mark.parametrize("body", ["x" * 90, "käse", "two\nlines"])
def test_what_does_not_fit_a_line_is_refused(body: str) -> None:
    with pytest.raises(InputError, match="does not fit a line"):
        seal(body)


@given(st.integers(0, (1 << 48) - 1))
def test_instants(ticks: int) -> None:
    assert instant_ticks(instant_text(ticks)) == ticks


@pytest.mark.parametrize("text", ["", "12345", "00001a2b3c4d", "00001A2B3C4D0"])
def test_what_is_no_instant(text: str) -> None:
    with pytest.raises(LineError):
        instant_ticks(text)
