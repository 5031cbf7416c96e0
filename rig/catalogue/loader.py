"""Reads the catalogue: the files that come with the program, then the user's, key by key."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from common.errors import InputError
from common.files.strict import StrictModel, validated
from common.files.toml import parsed, read_text
from rig.catalogue.catalogue import Catalogue
from rig.catalogue.items import (
    Adapter,
    Bracket,
    CatalogueCamera,
    CatalogueLens,
    Fastener,
    Head,
    LensMount,
    Part,
    Profile,
    Source,
)
from rig.catalogue.model import ENTRIES, NOT_FIGURES, Entry, MountEntry

LARGEST_FILE_BYTES = 5_000_000
Tables = dict[str, dict[str, dict[str, Any]]]
"""Raw entries by table and id."""

_ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9\-]{0,39}")

PARTS: dict[str, type[Part]] = {
    "camera": CatalogueCamera,
    "lens": CatalogueLens,
    "mount": LensMount,
    "head": Head,
    "profile": Profile,
    "bracket": Bracket,
    "fastener": Fastener,
}


Entries = dict[str, dict[str, Any]]


class _Outline(StrictModel):
    """A file's tables, before its entries are looked at one by one."""

    schema_: Literal["rigwright.catalogue/1"] = Field(alias="schema")
    camera: Entries = Field(default_factory=dict)
    lens: Entries = Field(default_factory=dict)
    mount: Entries = Field(default_factory=dict)
    head: Entries = Field(default_factory=dict)
    profile: Entries = Field(default_factory=dict)
    bracket: Entries = Field(default_factory=dict)
    fastener: Entries = Field(default_factory=dict)


def load_catalogue(user_files: Iterable[Path] = ()) -> Catalogue:
    """The catalogue that comes with the program, with ``user_files`` laid over it in turn.

    An entry of a file that is there already changes the keys it gives and keeps the others; a
    new one is added. Raises a one-line :class:`InputError` that names file, entry and key.
    """
    paths = tuple(user_files)
    if not paths:
        return built_in()
    tables: Tables = {table: dict(entries) for table, entries in _built_in_tables().items()}
    origins: dict[tuple[str, str], str] = {}
    for path in paths:
        for table, entries in _read(path).items():
            for part_id, entry in entries.items():
                former = tables[table].get(part_id)
                tables[table][part_id] = _laid_over(former, entry, path.name)
                origins[table, part_id] = path.name
    return _catalogue(tables, origins)


@cache
def built_in() -> Catalogue:
    """The catalogue that comes with the program."""
    return _catalogue(_built_in_tables(), {})


@cache
def _built_in_tables() -> Tables:
    tables: Tables = {table: {} for table in ENTRIES}
    folder = files("rig.catalogue.data")
    for name in sorted(entry.name for entry in folder.iterdir() if entry.name.endswith(".toml")):
        text = folder.joinpath(name).read_text(encoding="utf-8")
        for table, entries in _parse(text, name).items():
            tables[table] |= entries
    return tables


def _read(path: Path) -> Tables:
    return _parse(read_text(path, "catalogue", "catalogue file", LARGEST_FILE_BYTES), path.name)


def _parse(text: str, name: str) -> Tables:
    data = parsed(text, name, "catalogue", "catalogue file")
    outline = validated(_Outline, data, name)
    return {table: dict(getattr(outline, table)) for table in ENTRIES}


def _laid_over(former: dict[str, Any] | None, entry: dict[str, Any], name: str) -> dict[str, Any]:
    """The entry with the user's keys over the former ones, and a source for each of them."""
    given = [key for key in entry if key not in NOT_FIGURES]
    own = entry.get("source", [])
    if not _are_sources(own):
        # Left as it is for the models to refuse in their own words.
        return {**(former or {}), **entry}
    told = {key for source in own for key in source.get("figures", given)}
    own = [{**source, "figures": list(source.get("figures", given))} for source in own]
    rest = [key for key in given if key not in told]
    if rest:
        own.append({"title": name, "kind": "user", "figures": rest})
    kept = []
    for source in (former or {}).get("source", []):
        figures = source.get("figures")
        left = None if figures is None else [key for key in figures if key not in given]
        if left is None:
            kept.append(source)
        elif left:
            kept.append({**source, "figures": left})
    return {**(former or {}), **entry, "source": kept + own}


def _are_sources(value: object) -> bool:
    if not isinstance(value, list) or not all(isinstance(source, Mapping) for source in value):
        return False
    lists = [source.get("figures", []) for source in value]
    return all(isinstance(keys, list) and all(isinstance(k, str) for k in keys) for keys in lists)


def _catalogue(tables: Tables, origins: Mapping[tuple[str, str], str]) -> Catalogue:
    made: dict[str, dict[str, Part]] = {table: {} for table in ENTRIES}
    owners: dict[str, str] = {}
    for table, entries in tables.items():
        for part_id, raw in entries.items():
            where = f"{origins.get((table, part_id), 'catalogue')}: {table}.{part_id}"
            made[table][part_id] = _part(table, part_id, raw, where)
            if part_id in owners:
                raise InputError(
                    "value", f"{where} has the id of a {owners[part_id]}", "choose another id"
                )
            owners[part_id] = table
    catalogue = Catalogue(*made.values())  # type: ignore[arg-type]
    _check_references(catalogue, origins)
    return catalogue


def _part(table: str, part_id: str, raw: dict[str, Any], where: str) -> Part:
    entry = validated(ENTRIES[table], raw, where)
    if _ID.fullmatch(part_id) is None:
        raise InputError("value", f"{where} is no id", "use letters, digits and hyphens")
    values: dict[str, Any] = {
        key: tuple(value) if isinstance(value, list) else value
        for key, value in entry.model_dump(exclude={"source", "adapters"}).items()
    }
    if isinstance(entry, MountEntry):
        values["adapters"] = tuple(Adapter(lens=a.lens, name=a.name) for a in entry.adapters)
    return PARTS[table](id=part_id, sources=_sources(entry), **values)


def _sources(entry: Entry) -> dict[str, Source]:
    """Each figure's source: the last that names it, else the first that names none."""
    found: dict[str, Source] = {}
    for source in entry.source:
        for key in source.figures:
            found[key] = Source(source.title, source.kind)
    rest = next((s for s in entry.source if not s.figures), None)
    if rest is not None:
        for key in entry.figures():
            found.setdefault(key, Source(rest.title, rest.kind))
    return found


def _check_references(catalogue: Catalogue, origins: Mapping[tuple[str, str], str]) -> None:
    """Mounts and built-in lenses that entries name must be there."""

    def fail(table: str, part: Part, key: str, value: str, known: Iterable[str]) -> InputError:
        where = f"{origins.get((table, part.id), 'catalogue')}: {table}.{part.id}.{key}"
        return InputError("value", f"{where} is {value!r}", f"give one of {', '.join(known)}")

    mounts = (*catalogue.mounts, "fixed")
    for table, part in catalogue.parts():
        if isinstance(part, CatalogueCamera | CatalogueLens) and part.mount not in mounts:
            raise fail(table, part, "mount", part.mount, mounts)
        if isinstance(part, CatalogueCamera) and part.fixed_lens is not None:
            built = [lens.id for lens in catalogue.lenses.values() if lens.mount == "fixed"]
            if part.mount != "fixed" or part.fixed_lens not in built:
                raise fail(table, part, "fixed_lens", part.fixed_lens, built)
