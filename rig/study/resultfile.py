"""``study.json`` and ``study.csv``: what a study found, for machines and for a spreadsheet."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Literal

from pydantic import Field

from common.errors import InputError
from common.files.reading import read_limited
from common.files.strict import StrictModel, Vector, parsed
from rig.study.grid import Choice
from rig.study.studyfile import Study
from rig.study.unit import Figure, HeadFigures, Place

SCHEMA: Literal["rigwright.study-result/1"] = "rigwright.study-result/1"


class Row(StrictModel):
    """One design of a study. Figures are null where there is none.

    With several heads the sigmas are of the head where they are greatest, the shares of the one
    where they are least.
    """

    choice: Choice
    key: str = Field(description="Under which its file stands in `units/`.")
    reason: str = Field(description="Why it cannot be had; empty: every limit holds.")
    cameras: int = Field(description="Cameras of the rig, fixed ones included; 0: there is no rig.")
    sigma_median_mm: Figure
    sigma_p95_mm: Figure
    seen_twice_share: Figure
    seen_thrice_share: Figure
    holds_on: int = Field(description="Heads on which every limit holds.")
    size_mm: Vector = Field(description="The array with its bodies: across, in depth, in height.")
    price: float | None = Field(description="Of all cameras and lenses, where it is known.")
    on_front: bool = Field(
        description="No other rig of the study is better in one respect and as good in all."
    )
    centre_mm: Vector = Field(description="Centre of the points that were designed for.")
    places: list[Place]
    heads: list[HeadFigures]

    def extent_mm(self) -> float:
        """The longest side of the array."""
        return max(self.size_mm)


class Recurring(StrictModel):
    """A place of the recommended rig, and how often the best rigs have a camera there."""

    name: str
    azimuth_deg: float = Field(description="Seen from the face: positive to the subject's left.")
    elevation_deg: float = Field(description="Positive upwards.")
    distance_mm: float
    recurs_in: int = Field(description="Of the best rigs, those with a camera within reach.")
    spread_deg: float = Field(description="Mean angle of those cameras to this place.")


class StudyFindings(StrictModel):
    """What all designs say together."""

    front: list[int] = Field(description="Rows of the Pareto front.")
    recommended: int | None = Field(description="The row to build; null: no rig holds its limits.")
    why: str
    best: list[int] = Field(description="Rows that the places were compared over.")
    consensus: list[Recurring]


class StudyResultFile(StrictModel):
    """The root of ``study.json``."""

    schema_: Literal["rigwright.study-result/1"] = Field(alias="schema")
    study: Study
    identity: str = Field(description="Hash of what was asked: rigs, heads, choices.")
    rigs: list[str]
    heads: list[str]
    rows: list[Row]
    findings: StudyFindings


def study_json(result: StudyResultFile) -> str:
    """The file as text."""
    return result.model_dump_json(by_alias=True, indent=1) + "\n"


def read_study_result(path: Path) -> StudyResultFile:
    """A study's result; raises a one-line :class:`InputError`."""
    return parsed(StudyResultFile, read_limited(path), path.name)


def identity_in(path: Path) -> str | None:
    """What the study in ``path`` was asked; None where there is none that can be read."""
    try:
        return read_study_result(path).identity
    except InputError:
        return None


_COLUMNS = (
    *("rig", "head", "cameras_asked", "design_distance_mm", "neighbour_base_height", "form"),
    *("lens", "f_number", "strategy", "seed", "feasible", "cameras", "sigma_median_mm"),
    *("sigma_p95_mm", "seen_twice_share", "seen_thrice_share", "holds_on", "across_mm"),
    *("in_depth_mm", "in_height_mm", "price", "on_front", "recommended", "reason", "key"),
)


def study_csv(result: StudyResultFile) -> str:
    """A line for each design; an empty field: as the rig file has it, or not known."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_COLUMNS)
    for number, row in enumerate(result.rows):
        c, recommended = row.choice, number == result.findings.recommended
        asked = (c.rig, c.head, c.cameras, c.design_distance_mm, c.neighbour_base_height, c.form)
        more = (c.lens, c.f_number, c.strategy, c.seed, not row.reason, row.cameras)
        found = (row.sigma_median_mm, row.sigma_p95_mm, row.seen_twice_share, row.seen_thrice_share)
        size = row.size_mm if row.cameras else ("", "", "")
        end = (row.price, row.on_front, recommended, row.reason, row.key)
        writer.writerow([_cell(v) for v in (*asked, *more, *found, row.holds_on, *size, *end)])
    return text.getvalue()


def _cell(value: object) -> object:
    """A text that a spreadsheet would take for a formula is kept a text."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str) and value[:1] in ("=", "+", "-", "@"):
        return "'" + value
    return value
