"""From results of units to what a study says: rows, findings, files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import tomlkit

from rig.specification.rigfile import RigFile
from rig.study.findings import findings
from rig.study.grid import Choice
from rig.study.page import study_page
from rig.study.resultfile import (
    SCHEMA,
    Row,
    StudyResultFile,
    study_csv,
    study_json,
)
from rig.study.studyfile import PricesSection, Study
from rig.study.unit import HeadFigures, UnitResult

RECOMMENDED = "recommended.toml"


def row_of(choice: Choice, rig: RigFile, result: UnitResult, prices: PricesSection) -> Row:
    """A design as a line of the study."""
    heads = result.heads
    return Row(
        choice=choice,
        key=result.key,
        reason=result.reason,
        cameras=len(result.places),
        sigma_median_mm=_worst(heads, "sigma_median_mm"),
        sigma_p95_mm=_worst(heads, "sigma_p95_mm"),
        seen_twice_share=min((h.seen_twice_share for h in heads), default=None),
        seen_thrice_share=min((h.seen_thrice_share for h in heads), default=None),
        holds_on=result.holds_on(),
        size_mm=result.size_mm,
        price=_price(rig, prices, len(result.places)),
        on_front=False,
        centre_mm=result.centre_mm,
        places=result.places,
        heads=heads,
    )


def _worst(heads: Sequence[HeadFigures], name: str) -> float | None:
    values = [
        {"sigma_median_mm": h.sigma_median_mm, "sigma_p95_mm": h.sigma_p95_mm}[name] for h in heads
    ]
    known = [v for v in values if v is not None]
    return max(known) if known and len(known) == len(values) else None


def _price(rig: RigFile, prices: PricesSection, cameras: int) -> float | None:
    if not cameras:
        return None
    if prices.camera is not None:
        return cameras * prices.camera
    parts = [part for part in (rig.camera.model, rig.camera.lens) if part is not None]
    if rig.camera.model is None or not all(part in prices.each for part in parts):
        return None
    return cameras * sum(prices.each[part] for part in parts)


def study_result(
    study: Study, identity: str, rigs: Sequence[str], heads: Sequence[str], rows: Sequence[Row]
) -> StudyResultFile:
    """All rows with what they say together."""
    found = findings(rows, study)
    marked = [
        row.model_copy(update={"on_front": number in set(found.front)})
        for number, row in enumerate(rows)
    ]
    return StudyResultFile(
        schema=SCHEMA, study=study, identity=identity, rigs=list(rigs), heads=list(heads),
        rows=marked, findings=found,
    )  # fmt: skip


def write_study(folder: Path, result: StudyResultFile, recommended: RigFile | None) -> None:
    """``study.json``, ``study.csv``, ``report.html`` and the recommended rig file."""
    (folder / "study.json").write_text(study_json(result), encoding="utf-8")
    (folder / "study.csv").write_text(study_csv(result), encoding="utf-8")
    (folder / "report.html").write_text(study_page(result), encoding="utf-8")
    if recommended is not None:
        data = recommended.model_dump(mode="json", by_alias=True, exclude_none=True)
        (folder / RECOMMENDED).write_text(tomlkit.dumps(data), encoding="utf-8")
