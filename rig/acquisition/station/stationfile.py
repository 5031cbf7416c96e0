"""The station file: which devices stand on the bench, as a person writes it.

TOML in files, the same structure as JSON over HTTP. ``docs/reference/station-file.md`` lists the
keys.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from common.errors import InputError
from common.files.strict import StrictModel, validated
from common.files.toml import parsed, read_text
from rig.acquisition.station.sections import (
    CaptureSection,
    LedSection,
    StationCameraSection,
    StrobeSection,
    TriggerSection,
)
from rig.acquisition.station.spec import Station

SCHEMA: Literal["rigwright.station/1"] = "rigwright.station/1"
"""A station file is a page or two; a larger one is another file given by mistake."""


class StationFile(StrictModel):
    """The root of a station file."""

    schema_: Literal["rigwright.station/1"] = Field(
        alias="schema", description='Version of the format: `"rigwright.station/1"`.'
    )
    name: str = Field(
        default="station", min_length=1, max_length=200, description="What to call the station."
    )
    design: str | None = Field(
        default=None,
        min_length=1,
        description="Path to the `design.json` the rig was built from, seen from this file. Poses "
        "and calibration then travel with every session.",
    )
    trigger: TriggerSection | None = Field(
        default=None, description="The trigger box. Without it: cameras that need none."
    )
    camera: list[StationCameraSection] = Field(
        min_length=1, max_length=500, description="The cameras."
    )
    strobe: list[StrobeSection] = Field(default_factory=list, description="Flashes.")
    led: LedSection | None = Field(default=None, description="Lines of an LED timing board.")
    capture: CaptureSection = Field(
        default_factory=CaptureSection, description="How captures are taken."
    )
    backend: dict[str, dict[str, Any]] = Field(
        default_factory=dict,
        description="Options of a backend, in a table named after it: `[backend.genicam]`. Which "
        "there are stands in `docs/how-to/cameras.md`.",
    )
    simulation: dict[str, Any] | None = Field(
        default=None,
        description="What the simulated cameras see and how they fail. Which keys there are stands "
        "in `docs/explanation/simulation.md`; they are checked when the station is opened.",
    )

    def to_station(self, folder: Path | None = None) -> Station:
        """The station as the rest of the program sees it; ``folder`` is where the file stands."""
        design = None if self.design is None else (folder or Path()) / self.design
        return Station(
            name=self.name,
            cameras=tuple(section.to_plan() for section in self.camera),
            trigger=None if self.trigger is None else self.trigger.to_plan(),
            strobes=tuple(section.to_plan() for section in self.strobe),
            leds=() if self.led is None else self.led.to_plans(),
            board=None if self.led is None else self.led.to_board(),
            policy=self.capture.to_policy(),
            design=design,
            backend_options=self.backend,
            simulation=self.simulation,
        )


def station_from_mapping(
    data: Mapping[str, object], name: str = "station", folder: Path | None = None
) -> Station:
    """A station from parsed TOML or JSON; ``name`` stands in front of every error."""
    file = validated(StationFile, data, name)
    try:
        return file.to_station(folder)
    except InputError as error:
        raise InputError(error.detail, f"{name}: {error.problem}", error.remedy) from error


def parse_station(text: str, name: str = "station", folder: Path | None = None) -> Station:
    """A station from the text of a station file; raises a one-line :class:`InputError`."""
    data = parsed(text, name, "station", "station file")
    return replace(station_from_mapping(data, name, folder), text=text)


def read_station(path: Path) -> Station:
    """A station from a file; raises a one-line :class:`InputError`."""
    text = read_text(path, "station", "station file")
    return replace(parse_station(text, path.name, path.parent), path=path)
