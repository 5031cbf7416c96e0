"""The catalogue as an object: parts by kind and id, and how to find one by what a user wrote."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from types import MappingProxyType
from typing import TypeVar

from common.errors import NotFoundError
from rig.catalogue.items import (
    Bracket,
    CatalogueCamera,
    CatalogueLens,
    Fastener,
    Head,
    LensMount,
    Part,
    Profile,
)

PartT = TypeVar("PartT", bound=Part)
NO_PARTS: Mapping[str, Part] = MappingProxyType({})


def _plain(text: str) -> str:
    return "".join(c for c in text.lower() if c.isalnum())


def nearest(wanted: str, parts: Mapping[str, Part]) -> str:
    """A remedy that names the parts whose id or name comes close to ``wanted``."""
    spelt = {_plain(part.name): part.id for part in parts.values()}
    spelt |= {_plain(part.id): part.id for part in parts.values()}
    close = difflib.get_close_matches(_plain(wanted), spelt, 3, 0.5)
    found = list(dict.fromkeys(spelt[word] for word in close))
    if not found:
        words = wanted.lower().replace("-", " ").split()
        found = [p.id for p in parts.values() if any(w in p.name.lower() for w in words)][:3]
    if not found:
        return "choose one that `rigwright catalogue` lists, or add it in a file of your own"
    return f"did you mean {' or '.join(found)}?"


def pick(wanted: str, parts: Mapping[str, PartT], what: str) -> PartT:
    """The part with this id or name, whatever its case and punctuation.

    Raises :class:`NotFoundError` that names the nearest ones.
    """
    if wanted in parts:
        return parts[wanted]
    plain = _plain(wanted)
    same = [p for p in parts.values() if plain and plain in (_plain(p.id), _plain(p.name))]
    if len(same) == 1:
        return same[0]
    raise NotFoundError(
        "catalogue-part", f"{what} {wanted!r} is not in the catalogue", nearest(wanted, parts)
    )


@dataclass(frozen=True, eq=False)
class Catalogue:
    """All parts by id, kind by kind."""

    cameras: Mapping[str, CatalogueCamera] = field(default_factory=dict)
    lenses: Mapping[str, CatalogueLens] = field(default_factory=dict)
    mounts: Mapping[str, LensMount] = field(default_factory=dict)
    heads: Mapping[str, Head] = field(default_factory=dict)
    profiles: Mapping[str, Profile] = field(default_factory=dict)
    brackets: Mapping[str, Bracket] = field(default_factory=dict)
    fasteners: Mapping[str, Fastener] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for kind in fields(self):
            parts = MappingProxyType(dict(getattr(self, kind.name)))
            object.__setattr__(self, kind.name, parts)

    def tables(self) -> dict[str, Mapping[str, Part]]:
        """Parts by the name of their table in a file (``camera``, ``lens``, ...)."""
        names = ("camera", "lens", "mount", "head", "profile", "bracket", "fastener")
        return dict(zip(names, (getattr(self, kind.name) for kind in fields(self)), strict=True))

    def parts(self) -> Iterator[tuple[str, Part]]:
        """Every part with the name of its table."""
        for table, parts in self.tables().items():
            for part in parts.values():
                yield table, part

    def camera(self, wanted: str) -> CatalogueCamera:
        """The camera of this id or name; raises :class:`NotFoundError`."""
        return pick(wanted, self.cameras, "camera")

    def lens(self, wanted: str) -> CatalogueLens:
        """The lens of this id or name; raises :class:`NotFoundError`."""
        return pick(wanted, self.lenses, "lens")

    def find(self, wanted: str) -> tuple[str, Part]:
        """Any part by id or name, with its table; raises :class:`NotFoundError`."""
        found = pick(wanted, self._by_id, "part")
        return self._table_of[found.id], found

    @cached_property
    def _by_id(self) -> dict[str, Part]:
        return {part.id: part for _, part in self.parts()}

    @cached_property
    def _table_of(self) -> dict[str, str]:
        return {part.id: table for table, part in self.parts()}

    def parts_of(self, camera_name: str) -> tuple[CatalogueCamera, CatalogueLens] | None:
        """Body and lens of a kind of camera whose name is ``MODEL LENS``; None for others.

        Rig files that name ``model`` and ``lens`` give their kind of camera this name.
        """
        model, _, lens = camera_name.partition(" ")
        if model in self.cameras and lens in self.lenses:
            return self.cameras[model], self.lenses[lens]
        return None
