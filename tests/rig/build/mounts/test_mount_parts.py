"""Parts that go together: of a profile's series, with a profile's thread, or named as missing."""

from __future__ import annotations

from dataclasses import replace

import pytest

from common.errors import InputError
from rig.build.mounts.systems.heads import HeadKind
from rig.build.mounts.systems.parts import (
    bracket_for,
    outrigger_of,
    plate_of,
    profile_named,
    screw_for,
    stand_named,
    t_nut_for,
)
from rig.catalogue import load_catalogue

CATALOGUE = load_catalogue()
PROFILES = tuple(CATALOGUE.profiles.values())
SINGLE = tuple(p for p in PROFILES if p.height_mm == p.width_mm)


@pytest.mark.parametrize("profile", PROFILES, ids=lambda p: p.id)
@pytest.mark.parametrize("kind", ["corner", "pivot", "head-plate"])
def test_every_profile_has_brackets_of_its_own_series(profile, kind: str) -> None:  # noqa: ANN001
    found = bracket_for(profile, kind, CATALOGUE)
    assert found.kind == kind
    assert profile.series in found.series
    assert found.size_mm is not None


def test_a_bracket_of_unknown_size_is_not_taken() -> None:
    corner = CATALOGUE.brackets["corner-3030"]
    without = replace(
        CATALOGUE, brackets={**CATALOGUE.brackets, corner.id: replace(corner, size_mm=None)}
    )
    with pytest.raises(InputError, match=r"no corner bracket for profile 3030.*2020"):
        bracket_for(CATALOGUE.profiles["3030"], "corner", without)


@pytest.mark.parametrize("profile", PROFILES, ids=lambda p: p.id)
def test_nut_and_screw_have_the_profile_s_thread(profile) -> None:  # noqa: ANN001
    nut = CATALOGUE.fasteners[t_nut_for(profile, CATALOGUE)]
    screw = CATALOGUE.fasteners[screw_for(profile.bolt, CATALOGUE)]
    assert nut.kind == "t-nut"
    assert nut.thread == screw.thread == profile.bolt


def test_a_nut_of_another_series_with_the_same_thread_will_do() -> None:
    double = CATALOGUE.profiles["2040"]
    assert "2040" not in {f.series for f in CATALOGUE.fasteners.values()}
    assert t_nut_for(double, CATALOGUE) == "t-nut-2020"
    odd = replace(double, series="9999", bolt="M12")
    with pytest.raises(InputError, match="no T-nut for profile 2040"):
        t_nut_for(odd, CATALOGUE)


def test_a_cap_screw_is_taken_before_a_stud() -> None:
    assert screw_for("M5", CATALOGUE) == "cap-screw-m5"
    assert screw_for("5/16-18", CATALOGUE) == "stud-5-16-18"
    with pytest.raises(InputError, match="no screw with the thread M9"):
        screw_for("M9", CATALOGUE)


@pytest.mark.parametrize("profile", SINGLE, ids=lambda p: p.id)
def test_a_post_on_one_screw_would_turn(profile) -> None:  # noqa: ANN001
    with pytest.raises(InputError, match=r"would turn on its one screw.*choose 2040"):
        plate_of(profile, 8.0, "aluminium", CATALOGUE)


def test_a_plate_has_the_parts_of_its_double_profile() -> None:
    plate = plate_of(CATALOGUE.profiles["2040"], 8.0, "aluminium", CATALOGUE)
    assert plate.profile.id == "2040"
    assert plate.corner.id == "corner-2020"
    assert (plate.t_nut, plate.screw) == ("t-nut-2020", "cap-screw-m5")
    assert (plate.thickness_mm, plate.material) == (8.0, "aluminium")


@pytest.mark.parametrize("profile", SINGLE, ids=lambda p: p.id)
def test_an_outrigger_is_of_one_series(profile) -> None:  # noqa: ANN001
    head = HeadKind.named("generic-ball-25", CATALOGUE)
    made = outrigger_of(profile, head, CATALOGUE)
    for bracket, kind in (
        (made.plate, "head-plate"),
        (made.corner, "corner"),
        (made.pivot, "pivot"),
    ):
        assert bracket.kind == kind
        assert profile.series in bracket.series
    assert made.head is head


def test_names_are_found_and_strange_ones_named() -> None:
    assert profile_named("2040", CATALOGUE).height_mm == 40.0
    assert stand_named("tripod-1800", CATALOGUE).kind == "stand"
    for ask, name in ((profile_named, "2041"), (stand_named, "corner-2020")):
        with pytest.raises(Exception, match=name):
            ask(name, CATALOGUE)
