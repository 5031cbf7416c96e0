"""Starting simulated boxes for tests."""

from __future__ import annotations

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
