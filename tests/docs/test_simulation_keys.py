"""Every key of the simulated scene stands on its page."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import pytest

from rig.simulation.flatsettings import BoardSettings, HeldSettings, PlaceSettings, TargetSettings
from rig.simulation.settings import (
    BackdropSettings,
    HeadSettings,
    LightSettings,
    MotionSettings,
    SceneSettings,
    SensorSettings,
    SimulationSettings,
)

PAGE = Path(__file__).resolve().parents[2] / "docs" / "explanation" / "simulation.md"
ROWS = {
    SimulationSettings: "simulation.",
    SensorSettings: "simulation.sensor",
    SceneSettings: "simulation.scene",
    HeadSettings: "simulation.scene.head",
    MotionSettings: "simulation.scene.motion",
    LightSettings: "simulation.scene.lights[]",
    BackdropSettings: "simulation.scene.backdrop",
    TargetSettings: "targets[]",
    PlaceSettings: "targets[].place",
    HeldSettings: "targets[].held",
    BoardSettings: "simulation.scene.board",
}


@pytest.mark.parametrize("settings", ROWS, ids=lambda kind: kind.__name__)
def test_every_key_of_the_simulation_is_on_its_page(settings: type) -> None:
    keys = PAGE.read_text(encoding="utf-8").partition("## Keys")[2].partition("\n## ")[0]
    rows = [row for row in keys.splitlines() if row.startswith(f"| `{ROWS[settings]}")]
    told = {word for row in rows for word in re.findall(r"\w+", row)}
    assert rows
    assert {field.name for field in dataclasses.fields(settings)} <= told
