"""The sheets of a stand say what is done with them."""

from __future__ import annotations

import csv

import numpy as np

from calibration.targets.kinds import RingCarrier, TargetPlace, TargetPlan
from service.tasks.sheets import sheets_of

PLACES = tuple(
    TargetPlace(k, position_mm=(40.0 * k, -34.3, 20.0 * k), sigma_mm=(np.inf,) * 3)
    for k in range(1, 4)
)
STAND = RingCarrier("stand", 1.5, PLACES, fixed=True)
FLAT = RingCarrier("bar", 1.5, tuple(TargetPlace(k, (30.0 * k, 0.0, 0.0)) for k in (4, 5)))


def test_a_stand_is_cut_out_and_put_up_where_its_list_says() -> None:
    """The finding was a sheet of rings to be put on flat board, and a list that it never named."""
    sheets = sheets_of(TargetPlan("face", (STAND, FLAT)))
    drawn = {name: sheet.make().decode() for name, sheet in sheets.items() if name.endswith("svg")}
    assert "Cut the targets out" in drawn["stand.svg"]
    assert "stand-places.csv" in drawn["stand.svg"] and "stand-places.csv" in sheets
    assert "Cut the targets" not in drawn["bar.svg"] and "bar-places.csv" not in sheets


def test_the_list_of_places_names_its_frame() -> None:
    sheets = sheets_of(TargetPlan("face", (STAND,)))
    rows = list(csv.DictReader(sheets["stand-places.csv"].make().decode().splitlines()))
    assert [float(row["z_rig_mm"]) for row in rows] == [20.0, 40.0, 60.0]
    assert {row["y_rig_mm"] for row in rows} == {"-34.3"}
