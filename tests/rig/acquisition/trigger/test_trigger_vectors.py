"""The protocol's test vectors, played against the fake box with a clock that a test steps."""

from __future__ import annotations

from typing import Any

import pytest
from stepped_box import SteppedBox

from rig.acquisition.trigger.conformance import (
    VectorMismatch,
    fill,
    load_vectors,
    play_dialogue,
    play_framing,
)
from rig.acquisition.trigger.lines import MAX_ANSWER, ErrorCode, LineError, LineReader, crc16
from rig.acquisition.trigger.protocol import COMMANDS, Event, Reply, parse_answer

VECTORS = load_vectors()


def name_of(vector: dict[str, Any]) -> str:
    return str(vector["name"])


@pytest.mark.parametrize("dialogue", VECTORS["dialogues"], ids=name_of)
def test_fake_speaks_as_the_vectors_say(dialogue: dict[str, Any]) -> None:
    device = SteppedBox()
    play_dialogue(dialogue, device, device.hands())


@pytest.mark.parametrize("vector", VECTORS["framing"], ids=name_of)
def test_fake_cuts_lines_as_the_vectors_say(vector: dict[str, Any]) -> None:
    device = SteppedBox()
    play_framing(vector, device, device.hands())


@pytest.mark.parametrize(("text", "checksum"), VECTORS["crc"])
def test_checksums(text: str, checksum: str) -> None:
    assert f"{crc16(text.encode()):04X}" == checksum


@pytest.mark.parametrize(("line", "kind"), VECTORS["answers"])
def test_what_a_host_believes(line: str, kind: str) -> None:
    (raw,) = LineReader(MAX_ANSWER).feed(fill(line, {}).encode("latin-1") + b"\n")
    if kind == "broken":
        with pytest.raises(LineError):
            parse_answer(raw)
    else:
        answer = parse_answer(raw)
        assert isinstance(answer, Event if kind == "event" else Reply)
        assert answer.line() == raw.data + b"\n"


def test_vectors_cover_every_command_and_every_error() -> None:
    text = str(VECTORS["dialogues"])
    assert all(command in text for command in COMMANDS)
    codes = {
        step["expect"].get("code", 0)
        for dialogue in VECTORS["dialogues"]
        for step in dialogue["steps"]
        if "expect" in step
    }
    framing = {r.get("code", 0) for vector in VECTORS["framing"] for r in vector["replies"]}
    queued = {ErrorCode.OVERFLOW}
    assert codes | framing | queued == {0, *ErrorCode}


def test_the_player_notices_a_wrong_device() -> None:
    device = SteppedBox()
    device.box.limits = type(device.box.limits)(max_edges=2)
    capture = next(d for d in VECTORS["dialogues"] if d["name"] == "a capture")
    with pytest.raises(VectorMismatch, match="a capture, step 4"):
        play_dialogue(capture, device, device.hands())
