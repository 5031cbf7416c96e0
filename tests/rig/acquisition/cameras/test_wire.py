from __future__ import annotations

import io

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.acquisition.cameras.workers import wire

HEADERS = st.dictionaries(
    st.text(max_size=8).filter(lambda key: key != "bytes"),
    st.integers() | st.text() | st.none() | st.lists(st.booleans()),
    max_size=5,
)
MESSAGES = st.lists(st.tuples(HEADERS, st.binary(max_size=300)), min_size=1, max_size=5)


def written(messages: list[tuple[wire.Header, bytes]]) -> bytes:
    stream = io.BytesIO()
    for header, payload in messages:
        wire.send(stream, header, payload)
    return stream.getvalue()


@given(MESSAGES)
def test_what_is_sent_is_what_is_received(messages: list[tuple[wire.Header, bytes]]) -> None:
    stream = io.BytesIO(written(messages))
    for header, payload in messages:
        assert wire.receive(stream) == ({**header, "bytes": len(payload)}, payload)
    assert wire.receive(stream) is None


@given(MESSAGES, st.integers(min_value=1, max_value=400))
def test_a_message_cut_off_is_an_end_never_a_message(
    messages: list[tuple[wire.Header, bytes]], cut: int
) -> None:
    last = len(written(messages[-1:]))
    stream = io.BytesIO(written(messages)[: -min(cut, last)])
    for _ in messages[:-1]:
        assert wire.receive(stream) is not None
    assert wire.receive(stream) is None


@given(st.binary(max_size=200))
def test_nonsense_is_named(noise: bytes) -> None:
    stream = io.BytesIO(noise)
    try:
        message = wire.receive(stream)
    except wire.WireError:
        return
    assert message is None or isinstance(message[0], dict)


@pytest.mark.parametrize("line", [b"[1]\n", b"hello\n", b'{"bytes":-1}\n', b'{"bytes":"x"}\n'])
def test_lines_that_are_no_header_are_refused(line: bytes) -> None:
    with pytest.raises(wire.WireError):
        wire.receive(io.BytesIO(line))


def test_a_header_without_end_does_not_fill_the_memory() -> None:
    with pytest.raises(wire.WireError, match=r"does not end"):
        wire.receive(io.BytesIO(b"x" * (wire.MAX_HEADER + 10)))
