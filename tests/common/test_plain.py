"""Objects in JSON's own types."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from enum import Enum, StrEnum
from types import MappingProxyType

import numpy as np
import pytest

from common.files.plain import plain


class Light(StrEnum):
    GREEN = "green"


class Level(Enum):
    HIGH = 3


@dataclass(frozen=True)
class Inner:
    value: float
    light: Light


@dataclass(frozen=True)
class Outer:
    inner: tuple[Inner, ...]
    by_name: MappingProxyType[int, Level]


def test_everything_that_has_a_json_form_gets_it() -> None:
    given = Outer((Inner(math.nan, Light.GREEN),), MappingProxyType({1: Level.HIGH}))
    assert plain(given) == {
        "inner": [{"value": None, "light": "green"}],
        "by_name": {"1": 3},
    }


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (np.float64(0.5), 0.5),
        (np.float64("inf"), None),
        (np.float32(0.5), 0.5),
        (np.int64(7), 7),
        (np.bool_(True), True),
        (np.array([[1.0, np.nan]]), [[1.0, None]]),
        ((1, [2, (3,)]), [1, [2, [3]]]),
        (-math.inf, None),
    ],
)
def test_numbers_and_arrays_become_those_of_json(value: object, expected: object) -> None:
    found = plain({"v": value})["v"]
    assert found == expected
    assert json.loads(json.dumps(found, allow_nan=False)) == expected
    # What a reader gets must not depend on which library wrote the number.
    assert type(found) is type(expected)


def test_what_has_no_json_form_is_left_for_the_writer_to_refuse() -> None:
    with pytest.raises(TypeError):
        json.dumps(plain({"v": object()}))
