"""Simulated boxes: one for each test, on each simulator that is installed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from firmware_sim import FirmwareSim, Simulator
from firmware_started import started

SIMAVR = pytest.param(Simulator.SIMAVR, marks=pytest.mark.needs_avr, id="simavr")
AVR8JS = pytest.param(Simulator.AVR8JS, marks=pytest.mark.needs_node, id="avr8js")
# Half of what quick tests of the firmware take is that node starts anew for each of them.
AVR8JS_SLOWLY = pytest.param(
    Simulator.AVR8JS, marks=[pytest.mark.needs_node, pytest.mark.slow], id="avr8js"
)


@pytest.fixture(params=[SIMAVR, AVR8JS_SLOWLY])
def box(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[FirmwareSim]:
    """A stopped box after its start, on both simulators."""
    with started(request.param, tmp_path / "edges.log") as simulated:
        yield simulated


@pytest.fixture(params=[SIMAVR])
def one_box(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[FirmwareSim]:
    """The same on simavr only, for what no simulator sees differently."""
    with started(request.param, tmp_path / "edges.log") as simulated:
        yield simulated


@pytest.fixture(params=[AVR8JS])
def js_box(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[FirmwareSim]:
    """The same on avr8js only, for what simavr gets wrong."""
    with started(request.param, tmp_path / "edges.log") as simulated:
        yield simulated


@pytest.fixture(params=[SIMAVR, AVR8JS_SLOWLY])
def device_url(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    """The address of a box that runs with the wall clock, for whatever opens a serial port."""
    with started(request.param, tmp_path / "edges.log") as simulated:
        simulated.pace("real")
        yield simulated.url
