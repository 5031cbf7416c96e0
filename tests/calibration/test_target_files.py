"""Target files: what is written is what is read, and mistakes are named."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibration.observations import Distance
from calibration.targets.files import read_targets, targets_from, targets_text, write_targets
from calibration.targets.kinds import (
    CharucoPlate,
    MarkerCarrier,
    RingCarrier,
    TargetPlace,
    TargetPlan,
)
from calibration.targets.ringcodes import RingCodeFamily
from calibration.targets.rulers import Ruler
from calibration.targets.sheets import marker_sheet, ring_sheet, scale_bar
from common.errors import ConflictError, InputError

lengths = st.floats(-500.0, 500.0)
sigmas = st.one_of(st.floats(0.0, 10.0), st.just(float("inf")))
known = st.builds(
    TargetPlace, st.just(1), st.tuples(lengths, lengths, lengths), st.tuples(sigmas, sigmas, sigmas)
)
names = st.text(st.characters(codec="utf-8", exclude_categories=("C",)), min_size=1, max_size=12)
rulers = st.one_of(st.none(), st.builds(Ruler, st.just(100.0), st.floats(90.0, 110.0)))


@settings(max_examples=12, deadline=None)
@given(names, known, rulers, st.booleans())
def test_what_is_written_is_read(
    name: str, place: TargetPlace, ruler: Ruler | None, flag: bool
) -> None:
    bar, distances = scale_bar("bar", (40, 41), (200.0,), 3.0)
    plan = TargetPlan(
        name,
        (
            CharucoPlate(
                "plate", 8, 6, 20.5, 15.0, "DICT_5X5_100", 3, flag, ruler=ruler, back_mm=4.0
            ),
            MarkerCarrier("tags", "DICT_4X4_50", 30.0, (place,), dot=flag, inverted=not flag),
            RingCarrier("stand", 3.0, (place,), RingCodeFamily(14), fixed=flag),
            bar,
        ),
        distances,
    )
    again = targets_from(targets_text(plan))
    assert again == plan


def test_places_may_be_unknown() -> None:
    plan = targets_from(
        'schema = "rigwright.targets/1"\nname = "stand"\n'
        '[[rings]]\nname = "stand"\ndot_radius_mm = 3\nfixed = true\n'
        "targets = [{ number = 1 }, { number = 2, position_mm = [1, 2, 3] }]\n"
    )
    (carrier,) = plan.target_set().carriers
    assert carrier.ids == ("ring12-001", "ring12-002")
    assert carrier.sigma_mm.tolist() == [[float("inf")] * 3, [0.1] * 3]
    assert targets_text(plan).count("number") == 2


def test_a_print_of_another_scale_scales_the_plate() -> None:
    ruler = Ruler(100.0, 97.0)
    plate = CharucoPlate("plate", 4, 3, 20.0, 15.0, "DICT_4X4_50", ruler=ruler)
    assert plate.carrier().nominal_mm[0].tolist() == pytest.approx([19.4, 19.4, 0.0])


GOOD = targets_text(TargetPlan("set", (marker_sheet("tags", "DICT_4X4_50", (0, 1), 20.0),)))


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("name = ", "is not a target file"),
        (
            GOOD.replace("size_mm", "sise_mm"),
            r"markers\[0\]\.sise_mm is not known.*did you mean size_mm",
        ),
        (GOOD.replace("size_mm = 20.0\n", ""), r"markers\[0\]\.size_mm is missing; add it"),
        (GOOD.replace("20.0", "0.02", 1), "size_mm = 0.02 of carrier 'tags' cannot be millimetres"),
        (GOOD.replace("20.0", '"big"', 1), "size_mm is 'big'; it should be a valid number"),
        (GOOD.replace("DICT_4X4_50", "DICT_9X9"), "no marker dictionary 'DICT_9X9'"),
        (
            GOOD.replace("targets/1", "targets/7"),
            "schema is 'rigwright.targets/7'; it should be 'rigwright.targets/1'",
        ),
        (GOOD.split("[[markers]]")[0], "has no targets"),
        (GOOD + GOOD[GOOD.index("[[markers]]") :], "have one name"),
        (GOOD.replace("number = 1", "number = 99"), "shows marker 99, but DICT_4X4_50 has none"),
    ],
)
def test_mistakes_are_named_in_one_line(text: str, problem: str) -> None:
    with pytest.raises(InputError, match=problem) as caught:
        targets_from(text, "set.toml")
    assert "\n" not in str(caught.value)


def test_files_are_written_whole_or_not_at_all(tmp_path: Path) -> None:
    plan = TargetPlan("set", (ring_sheet("rings", (1, 2), 3.0),))
    path = tmp_path / "set.toml"
    write_targets(plan, path)
    assert read_targets(path) == plan
    with pytest.raises(ConflictError):
        write_targets(plan, path)
    write_targets(plan, path, overwrite=True)
    with pytest.raises(InputError, match="cannot be written"):
        write_targets(plan, tmp_path / "none" / "set.toml")
    with pytest.raises(InputError, match=r"cannot read the target file .*gone\.toml"):
        read_targets(tmp_path / "gone.toml")
    assert [p.name for p in tmp_path.iterdir()] == ["set.toml"]


def test_bars_say_their_lengths() -> None:
    bar, distances = scale_bar("bar", (1, 2, 3), (100.0, 250.0), 3.0, sigma_mm=0.02)
    assert distances == (
        Distance("ring12-001", "ring12-002", 100.0, 0.02),
        Distance("ring12-001", "ring12-003", 250.0, 0.02),
    )
    assert bar.carrier().nominal_mm[:, 0].tolist() == [0.0, 100.0, 250.0]
    with pytest.raises(InputError, match="2 targets for 2 rising lengths"):
        scale_bar("bar", (1, 2), (100.0, 250.0), 3.0)
