"""JSON schemas and key tables of the files, generated from the models that read them.

``python -m service.reference.schemas FOLDER`` writes the schemas of rig files, design files,
stations, sessions, captures, catalogues, mounts, plans and studies to FOLDER (``docs/reference``)
and renews the tables between the marks in ``rig-file.md``, ``design-file.md``, ``station-file.md``,
``catalogue.md``, ``mounts.md`` and ``study-file.md``.
"""

from __future__ import annotations

import json
import re
import sys
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from common.files.strict import child_model, key_of
from rig.acquisition.session.marks import MarksFile
from rig.acquisition.session.records import CaptureRecord, SessionFile
from rig.acquisition.station.stationfile import StationFile
from rig.build.mounts.planmodel import PlanFile
from rig.build.mounts.systemfile import SystemFile
from rig.catalogue.model import CatalogueFile
from rig.design.designmodel import DesignFile
from rig.specification.rigfile import RigFile
from rig.study.resultfile import StudyResultFile
from rig.study.studyfile import StudyFile

BEGIN, END = "<!-- keys -->", "<!-- end of keys -->"
DIALECT = "https://json-schema.org/draft/2020-12/schema"


def schema_text(model: type[BaseModel], title: str) -> str:
    """The JSON schema (draft 2020-12) of a file."""
    schema = model.model_json_schema(by_alias=True)
    document = {"$schema": DIALECT, **schema, "title": title}
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"


def _is_list_of(info: FieldInfo, model: type[BaseModel]) -> bool:
    return model in _flatten(info.annotation) and list in _origins(info.annotation)


def _origins(annotation: object) -> set[Any]:
    found = {typing.get_origin(annotation)}
    for part in typing.get_args(annotation):
        found |= _origins(part)
    return found


def _flatten(annotation: object) -> set[Any]:
    parts = typing.get_args(annotation)
    return set().union(*(_flatten(p) for p in parts)) if parts else {annotation}


def keys(
    model: type[BaseModel], prefix: str = "", told: dict[type[BaseModel], str] | None = None
) -> Iterator[tuple[str, str, str]]:
    """Every key of a file: dotted name (``[]`` marks lists of tables), default, description.

    The keys of a table that occurs again are told only the first time.
    """
    told = {RigFile: "a rig file"} if told is None else told
    for name, info in model.model_fields.items():
        key, words = prefix + key_of(name, model), info.description or ""
        child = child_model(model, key_of(name, model))
        if child is None:
            yield key, _default(model, name), words
            continue
        key += "[]" if _is_list_of(info, child) else ""
        if child in told:
            yield key, _default(model, name), f"{words} Keys as in {told[child]}."
            continue
        yield key, _default(model, name), words
        told[child] = f"`{key}`"
        yield from keys(child, f"{key}.", told)


def _default(model: type[BaseModel], name: str) -> str:
    info = model.model_fields[name]
    if info.is_required():
        stand_in = getattr(model, "stand_ins", {}).get(name)
        return "required" if stand_in is None else f"required, or from `{stand_in}`"
    value = info.get_default(call_default_factory=True)
    if value is None or value == [] or isinstance(value, BaseModel):
        return ""
    return f"`{json.dumps(value)}`"


def key_table(model: type[BaseModel]) -> str:
    """The keys as a Markdown table."""
    rows = [f"| `{key}` | {default} | {text} |" for key, default, text in keys(model)]
    return "\n".join(["| Key | Default | Meaning |", "| --- | --- | --- |", *rows])


def with_key_table(text: str, model: type[BaseModel]) -> str:
    """``text`` with the table between the marks renewed."""
    block = f"{BEGIN}\n{key_table(model)}\n{END}"
    return re.sub(f"{BEGIN}.*?{END}", lambda _: block, text, flags=re.DOTALL)


def documents(folder: Path) -> dict[Path, str]:
    """What each generated file in the folder ``folder`` should hold."""
    rig_file, design_file = folder / "rig-file.md", folder / "design-file.md"
    station_file, parts_file = folder / "station-file.md", folder / "catalogue.md"
    mounts, study_file = folder / "mounts.md", folder / "study-file.md"
    return {
        folder / "rig.schema.json": schema_text(RigFile, "Rigwright rig file"),
        folder / "design.schema.json": schema_text(DesignFile, "Rigwright design file"),
        folder / "station.schema.json": schema_text(StationFile, "Rigwright station file"),
        folder / "session.schema.json": schema_text(SessionFile, "Rigwright session"),
        folder / "capture.schema.json": schema_text(CaptureRecord, "Rigwright capture"),
        folder / "marks.schema.json": schema_text(MarksFile, "Rigwright marks of a session"),
        folder / "catalogue.schema.json": schema_text(CatalogueFile, "Rigwright catalogue file"),
        folder / "mount.schema.json": schema_text(SystemFile, "Rigwright mount file"),
        folder / "plan.schema.json": schema_text(PlanFile, "Rigwright mount plan"),
        folder / "study.schema.json": schema_text(StudyFile, "Rigwright study file"),
        folder / "study-result.schema.json": schema_text(StudyResultFile, "Rigwright study result"),
        study_file: with_key_table(study_file.read_text(encoding="utf-8"), StudyFile),
        station_file: with_key_table(station_file.read_text(encoding="utf-8"), StationFile),
        rig_file: with_key_table(rig_file.read_text(encoding="utf-8"), RigFile),
        design_file: with_key_table(design_file.read_text(encoding="utf-8"), DesignFile),
        parts_file: with_key_table(parts_file.read_text(encoding="utf-8"), CatalogueFile),
        mounts: with_key_table(mounts.read_text(encoding="utf-8"), SystemFile),
    }


def main(folder: Path) -> None:
    """Write the generated files."""
    for path, text in documents(folder).items():
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/reference"))
