"""The catalogue as rows for a table, and one entry with the source of every figure."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import fields
from typing import Any

from common.errors import InputError
from common.words import did_you_mean
from rig.catalogue.catalogue import Catalogue
from rig.catalogue.items import Adapter, CatalogueCamera, Part
from rig.catalogue.model import ENTRIES

SEARCHED = ("id", "name", "maker", "kind", "mount", "shutter", "series", "thread", "interface")
COMPARISONS = {
    "=": lambda value, limit: value == limit,
    "<=": lambda value, limit: value <= limit,
    ">=": lambda value, limit: value >= limit,
}
_CONDITION = re.compile(r"^\s*(\w+)\s*(<=|>=|=)\s*(.+?)\s*$")
Row = dict[str, Any]


def _plain(value: object) -> object:
    """JSON data for one figure."""
    if isinstance(value, tuple):
        return [_plain(part) for part in value]
    if isinstance(value, Adapter):
        return {"lens": value.lens, "name": value.name}
    return value


def _row(table: str, part: Part) -> Row:
    row: Row = {"table": table, "id": part.id}
    for key in (f.name for f in fields(part) if f.name not in ("id", "sources")):
        value = getattr(part, key)
        if value is not None and value != ():
            row[key] = _plain(value)
    if isinstance(part, CatalogueCamera):
        # What follows from the published figures is listed too; the entry says so.
        row["pixel_pitch_um"] = part.pitch_um
    return row


def catalogue_rows(
    catalogue: Catalogue,
    words: str = "",
    tables: Iterable[str] = (),
    where: Sequence[str] = (),
) -> list[Row]:
    """Parts as JSON-able rows: ``table``, ``id``, ``name`` and every known figure.

    ``words``: each must occur in the id, name, maker, kind, mount or the like. ``tables`` keeps
    only some kinds (``camera``, ``lens``, ...). ``where`` holds conditions such as ``mount=C`` or
    ``mass_g<=100``; a part whose figure is not known does not meet one. Raises a one-line
    :class:`InputError` for a table or key that does not exist.
    """
    kinds = [_known(table, list(ENTRIES), "table") for table in tables] or list(ENTRIES)
    conditions = [_condition(text, kinds) for text in where]
    rows = [_row(table, part) for table, part in catalogue.parts() if table in kinds]
    wanted = words.lower().split()
    return [row for row in rows if _has(row, wanted) and all(_meets(row, c) for c in conditions)]


def _known(word: str, known: list[str], what: str) -> str:
    if word in known:
        return word
    raise InputError("value", f"the catalogue has no {what} {word!r}", did_you_mean(word, known))


def _condition(text: str, kinds: list[str]) -> tuple[str, str, str]:
    match = _CONDITION.match(text)
    if match is None:
        raise InputError(
            "value", f"{text!r} is not a condition", "write it like mount=C or mass_g<=100"
        )
    key, sign, limit = match.groups()
    known = sorted({name for kind in kinds for name in ENTRIES[kind].model_fields} - {"source"})
    _known(key, known, "figure")
    if sign != "=":
        try:
            float(limit)
        except ValueError as error:
            raise InputError(
                "value", f"{text!r} compares with no number", "write it like mass_g<=100"
            ) from error
    return key, sign, limit


def _has(row: Row, words: list[str]) -> bool:
    text = " ".join(str(row[key]) for key in SEARCHED if key in row).lower()
    return all(word in text for word in words)


def _meets(row: Row, condition: tuple[str, str, str]) -> bool:
    key, sign, limit = condition
    value = row.get(key)
    if isinstance(value, list):
        return sign == "=" and limit.lower() in (str(part).lower() for part in value)
    if isinstance(value, int | float) and not isinstance(value, bool):
        try:
            return bool(COMPARISONS[sign](float(value), float(limit)))
        except ValueError:
            return False
    return sign == "=" and value is not None and str(value).lower() == limit.lower()


def catalogue_entry(catalogue: Catalogue, wanted: str) -> dict[str, Any]:
    """One part by id or name with each figure's source, JSON-able.

    Raises :class:`common.errors.NotFoundError` with the nearest ones.
    """
    table, part = catalogue.find(wanted)
    row = _row(table, part)
    figures: dict[str, Any] = {}
    for key, value in row.items():
        source = part.sources.get(key)
        if source is not None:
            figures[key] = {"value": value, "source": source.title, "kind": source.kind}
        elif key == "pixel_pitch_um" and value is not None:
            title = "sensor_size_mm over image_size_px"
            figures[key] = {"value": value, "source": title, "kind": "derived"}
    document: Row = {"table": table, "id": part.id, "name": part.name, "maker": part.maker}
    document |= {"kind": part.kind, "figures": figures}
    return document if part.note is None else {**document, "note": part.note}
