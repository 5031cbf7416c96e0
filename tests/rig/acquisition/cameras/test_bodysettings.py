from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import InputError
from rig.acquisition.cameras.workers.bodysettings import nearest, read_value

SHUTTERS = ["bulb", "30", "1.3", "1/3", "1/125", "1/160", "1/200", "1/4000"]


@pytest.mark.parametrize(
    ("field", "spelt", "value"),
    [
        ("exposure_us", "1/125", 8000.0),
        ("exposure_us", "0.0080s", 8000.0),
        ("exposure_us", "30", 30e6),
        ("f_number", "f/5.6", 5.6),
        ("f_number", "F11", 11.0),
        ("iso", "400", 400.0),
        ("iso", "Auto", None),
        ("exposure_us", "bulb", None),
        ("exposure_us", "1/0", None),
        ("exposure_us", "nan", None),
        ("exposure_us", "-1", None),
    ],
)
def test_menu_entries_are_read(field: str, spelt: str, value: float | None) -> None:
    assert read_value(field, spelt) == (None if value is None else pytest.approx(value))


@given(st.sampled_from(["exposure_us", "iso", "f_number"]), st.text(max_size=12))
def test_no_entry_breaks_the_reader(field: str, spelt: str) -> None:
    value = read_value(field, spelt)
    assert value is None or (math.isfinite(value) and value > 0)


@given(st.floats(min_value=1e6 / 4000, max_value=30e6))
def test_what_is_chosen_is_within_a_sixth_of_a_stop(wanted: float) -> None:
    try:
        chosen = read_value("exposure_us", nearest("exposure_us", wanted, SHUTTERS))
    except InputError:
        values = [read_value("exposure_us", spelt) for spelt in SHUTTERS]
        assert all(v is None or abs(math.log2(v / wanted)) > 1 / 6 for v in values)
        return
    assert chosen is not None
    assert abs(math.log2(chosen / wanted)) <= 1 / 6 + 1e-5


@pytest.mark.parametrize("wanted", [0.0, -1.0])
def test_nothing_and_less_cannot_be_set(wanted: float) -> None:
    with pytest.raises(InputError, match=r"manual mode"):
        nearest("iso", wanted, ["100", "200"])


def test_a_body_in_automatic_mode_has_nothing_to_choose() -> None:
    with pytest.raises(InputError, match=r"manual mode"):
        nearest("exposure_us", 8000.0, ["auto"])
