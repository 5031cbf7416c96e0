"""What a camera's folder tells beside its pictures: of late files, and of files that are none."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from common.words import as_text
from rig.acquisition.cameras.folderwatch import Stamp
from rig.acquisition.cameras.wholeness import MEDIA_TYPES

NAMED = 5
"""So many files are named in a sentence, and the others counted."""


def newest(files: Mapping[Path, Stamp | None]) -> list[tuple[Path, Stamp]]:
    """The whole files, those last written first."""
    whole = [(path, stamp) for path, stamp in files.items() if stamp is not None]
    return sorted(whole, key=lambda one: one[1].modified_ns, reverse=True)


def kinds_of_one(files: Iterable[tuple[Path, Stamp]]) -> frozenset[str]:
    """Media types of the files that have the first one's name; empty where there are none."""
    paths = [path for path, _ in files]
    stems = [path.stem.casefold() for path in paths]
    return frozenset(
        MEDIA_TYPES[path.suffix.lower()]
        for path, stem in zip(paths, stems, strict=True)
        if stem == stems[0]
    )


def why_no_picture(path: Path, stamp: Stamp | None = None) -> str:
    """Why a file cannot be filed. ``stamp``: of one that is a picture by its name."""
    if stamp is None:
        known = path.suffix.lower() in MEDIA_TYPES
        return "not of the kinds in 'suffixes'" if known else "no picture by its name"
    if not stamp.size:
        return "empty"
    try:
        with path.open("rb"):
            return "not whole, or not what its name says"
    except OSError as error:
        return error.strerror or "cannot be read"


def in_words(reasons: Mapping[Path, str]) -> str:
    """The files with their reasons, the first of them by name."""
    told = [f"{as_text(path.name)} ({why})" for path, why in list(reasons.items())[:NAMED]]
    more = len(reasons) - len(told)
    return ", ".join(told) + (f" and {more} more" if more else "")
