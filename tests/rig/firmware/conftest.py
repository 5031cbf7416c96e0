"""Simulated boxes: one for each test, on each simulator that is installed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from firmware_sim import FirmwareSim, Simulator, SimulatorMissing, built

BOOT_MS = 30.0


def started(simulator: Simulator, log: Path) -> FirmwareSim:
    """A box that has just started and has said so; skips the test where there is none."""
    try:
        built(simulator)
    except SimulatorMissing as reason:
        pytest.skip(str(reason))
    box = FirmwareSim(simulator, log)
    box.run(BOOT_MS)
    return box


@pytest.fixture(
    params=[
        pytest.param(Simulator.SIMAVR, marks=pytest.mark.needs_avr, id="simavr"),
        pytest.param(Simulator.AVR8JS, marks=pytest.mark.needs_node, id="avr8js"),
    ]
)
def box(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[FirmwareSim]:
    """A stopped box after its start, on both simulators."""
    with started(request.param, tmp_path / "edges.log") as simulated:
        yield simulated


@pytest.fixture
def one_box(tmp_path: Path) -> Iterator[FirmwareSim]:
    """The same on simavr only, for what no simulator sees differently."""
    with started(Simulator.SIMAVR, tmp_path / "edges.log") as simulated:
        yield simulated


@pytest.fixture
def js_box(tmp_path: Path) -> Iterator[FirmwareSim]:
    """The same on avr8js only, for what simavr gets wrong."""
    with started(Simulator.AVR8JS, tmp_path / "edges.log") as simulated:
        yield simulated
