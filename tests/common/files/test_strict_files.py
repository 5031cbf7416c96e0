"""One kit for every strict file: what each kind of mistake is called."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import pytest
from pydantic import Field

from common.errors import InputError
from common.files.strict import StrictModel, as_json, parsed, section_of, validated
from common.files.writing import write_whole


class Lens(StrictModel):
    focal_length_mm: float


class Rig(StrictModel):
    schema_: Literal["kind/1"] = Field(alias="schema")
    lenses: list[Lens] = Field(default_factory=list)
    corner: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Fault:
    lag_us: float = 0.0


@dataclass(frozen=True)
class Simulation:
    trigger: str = "edge"
    faults: dict[str, Fault] | None = None


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("{", "a.json is not JSON"),
        ('{"schema": "kind/2", "lenss": []}', "schema is 'kind/2'"),
        ('{"schema": "kind/1", "lenss": []}', "lenss is not known; did you mean lenses?"),
        (
            '{"schema": "kind/1", "lenses": [{"focal_lenght_mm": 1.0}]}',
            "lenses[0].focal_lenght_mm is not known (1 more to mend after it); "
            "did you mean focal_length_mm?",
        ),
        ('{"schema": "kind/1", "lenses": [{}]}', "lenses[0].focal_length_mm is missing; add it"),
        ('{"schema": "kind/1", "lenses": [{"focal_length_mm": "8"}]}', "is '8'; it should be"),
        ('{"schema": "kind/1", "zzz": 1}', "the keys here are schema, lenses, corner"),
    ],
)
def test_every_mistake_has_its_line(text: str, line: str) -> None:
    with pytest.raises(InputError) as error:
        parsed(Rig, text, "a.json")
    assert line in str(error.value) and "\n" not in str(error.value)


def test_lists_of_a_toml_file_serve_for_tuples() -> None:
    data = {"schema": "kind/1", "corner": [1.0, 2.0]}
    assert as_json(Rig, data, "a.toml").corner == (1.0, 2.0)
    with pytest.raises(InputError, match="corner"):
        validated(Rig, data, "a.toml")


@pytest.mark.parametrize(
    ("data", "line"),
    [
        ({"triger": "edge"}, "simulation.triger is not known; did you mean trigger?"),
        (
            {"faults": {"cam1": {"lag_ms": 1.0}}},
            "simulation.faults.cam1.lag_ms is not known; did you mean lag_us?",
        ),
        ({"faults": {"cam1": {"lag_us": "x"}}}, "simulation.faults.cam1.lag_us is 'x'"),
    ],
)
def test_sections_of_dataclasses_are_as_strict(data: dict[str, object], line: str) -> None:
    with pytest.raises(InputError) as error:
        section_of(Simulation, data, "simulation")
    assert str(error.value).startswith(line)


def test_what_is_replaced_keeps_its_permissions(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"old")
    path.chmod(0o640)
    write_whole(path, b"new", overwrite=True)
    assert path.read_bytes() == b"new" and path.stat().st_mode & 0o777 == 0o640
    assert list(tmp_path.iterdir()) == [path]
