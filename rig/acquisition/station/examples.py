"""The station file that comes with the program."""

from __future__ import annotations

from importlib.resources import files


def example_station_text() -> str:
    """Seven simulated cameras and a box made of nothing, beside a ``design.json``."""
    return files("rig.acquisition.station").joinpath("example.toml").read_text(encoding="utf-8")
