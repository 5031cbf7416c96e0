"""The firmware passes the test vectors of the protocol, as driver and fake do."""

from __future__ import annotations

from typing import Any

import pytest
import serial
from firmware_sim import FirmwareSim

conformance = pytest.importorskip("rig.acquisition.trigger.conformance")

VECTORS: dict[str, Any] = conformance.load_vectors()


def named(vectors: list[dict[str, Any]]) -> list[Any]:
    return [pytest.param(vector, id=vector["name"]) for vector in vectors]


@pytest.mark.parametrize("vector", named(VECTORS["framing"]))
def test_framing(box: FirmwareSim, vector: dict[str, Any]) -> None:
    from firmware_line import SimulatedLine

    line = SimulatedLine(box)
    conformance.play_framing(vector, line, line.hands())


@pytest.mark.parametrize("dialogue", named(VECTORS["dialogues"]))
def test_dialogue(box: FirmwareSim, dialogue: dict[str, Any]) -> None:
    from firmware_line import SimulatedLine

    line = SimulatedLine(box)
    conformance.play_dialogue(dialogue, line, line.hands())


@pytest.mark.parametrize(
    "name", ["a capture", "a burst", "a capture fires once, under whatever number"]
)
def test_dialogue_over_the_port(device_url: str, name: str) -> None:
    dialogue = next(vector for vector in VECTORS["dialogues"] if vector["name"] == name)
    with serial.serial_for_url(device_url, baudrate=115200, timeout=0.05) as port:
        conformance.play_dialogue(dialogue, port, conformance.Hands())
