"""Things to practise with: files that fit together, places that follow the capture's number."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from calibration.acceptance import Volume
from calibration.acceptance.accepting import DIAGONAL_SHARE
from calibration.targets.files import read_targets
from calibration.targets.kinds import RingCarrier
from common.errors import InputError
from rig.acquisition.cameras.base import ArmSpec
from rig.acquisition.station.stationfile import read_station
from rig.devices.simulated import simulation_settings
from rig.simulation.flats import held_up, target
from rig.simulation.flatsettings import HeldSettings, PlaceSettings, TargetSettings
from service.cli import app
from service.practice import STATIONS, write_practice


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("practice")
    write_practice(place)
    return place


@pytest.mark.parametrize("name", STATIONS)
def test_the_stations_find_their_design_and_pictures(folder: Path, name: str) -> None:
    station = read_station(folder / name)
    scene = simulation_settings(station).scene
    assert len(station.cameras) == 4
    assert scene.targets
    for settings in scene.targets:
        assert settings.image is not None and settings.image.is_file()


def test_pictures_are_as_large_as_the_targets_say(folder: Path) -> None:
    targets = simulation_settings(read_station(folder / "station.toml")).scene.targets
    plate = next(t for t in targets if t.image and t.image.name == "plate.png")
    # Nine squares of 18 mm and a border of a quarter square on either side; a pixel is 1/12 mm.
    assert plate.size_mm == pytest.approx(9.5 * 18.0, abs=1.0 / 12.0)
    assert all(target(settings).size_mm[0] >= settings.size_mm for settings in targets)


@pytest.mark.parametrize("share", [0.05, -0.0526])
def test_a_wrong_guess_at_the_size_of_a_picture_is_told(folder: Path, share: float) -> None:
    plate, *_ = simulation_settings(read_station(folder / "station.toml")).scene.targets
    target(plate)
    with pytest.raises(InputError) as caught:
        target(replace(plate, size_mm=plate.size_mm * (1.0 + share)))
    assert "mm wide with its border, not" in caught.value.problem
    # The remedy is the size that is right, to the 0.05 mm that a name in a file may be rounded to.
    told = float(caught.value.remedy.removeprefix("give size_mm = "))
    assert told == pytest.approx(plate.size_mm, abs=0.05)


def test_the_bar_is_long_enough_for_the_default_volume(folder: Path) -> None:
    (bar,) = read_targets(folder / "bar.toml").carriers
    assert isinstance(bar, RingCarrier)
    places = np.array([place.position_mm for place in bar.places])
    needed = max(DIAGONAL_SHARE * Volume().diagonal_mm, Volume().shortest_mm)
    assert np.ptp(places[:, 0]) >= needed
    assert len(places) >= 6  # five lengths from its first target


def test_only_the_third_camera_is_knocked(folder: Path) -> None:
    before, after = (
        simulation_settings(read_station(folder / name))
        for name in ("station.toml", "knocked.toml")
    )
    moved = [n for n in ("cam01", "cam02", "cam03", "cam04") if after.faults_of(n).knocked(1)]
    assert moved == ["cam03"]
    assert not any(before.faults_of(n).knocked(1) for n in ("cam01", "cam02", "cam03", "cam04"))
    assert before.scene == after.scene


def test_no_two_sets_share_a_target(folder: Path) -> None:
    ids = [
        name
        for file in ("targets.toml", "bar.toml")
        for carrier in read_targets(folder / file).carriers
        for name in carrier.ids
    ]
    assert len(set(ids)) == len(ids)


def test_a_held_thing_has_another_place_in_each_capture_and_the_same_in_another_process() -> None:
    settings = TargetSettings("aruco", PlaceSettings((0.0, 0.0, 0.0)), 50.0)
    flat, held = target(settings), HeldSettings(seed=3)
    places = [held_up(flat, held, number).centre_rig_mm for number in (1, 2, 3, 1)]
    assert len({tuple(place) for place in places}) == 3
    assert tuple(places[0]) == tuple(places[3])


def test_a_capture_outside_a_session_has_no_number() -> None:
    assert ArmSpec("self-test", 1, 1.0).number == 0


@pytest.mark.slow
def test_the_command_writes_them_and_says_what_comes_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["practice"])
    assert done.exit_code == 0, done.output
    assert (
        "  rigwright capture --station practice/station.toml --session sessions/monday --count 12\n"
        in (done.stdout)
    )
    assert CliRunner().invoke(app, ["practice"]).exit_code == 2
    assert CliRunner().invoke(app, ["practice", "--force"]).exit_code == 0
