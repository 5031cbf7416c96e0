"""Finished units on the disk, each in a file that bears its key."""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path

from common.errors import RigwrightError
from common.files.reading import plain_bytes
from common.files.strict import parsed
from common.files.writing import remove_unfinished, write_whole
from rig.study.unit import UnitResult

_UNIT = re.compile(r"[0-9a-f]{64}\.json")


def is_unit(path: Path) -> bool:
    """Whether a file bears the name of a unit, and not one that somebody gave to theirs."""
    return _UNIT.fullmatch(path.name) is not None


class UnitCache:
    """A folder of units, each there whole or not at all: whatever is killed, the rest stays."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def get(self, key: str) -> UnitResult | None:
        """The result of the unit with this key; None where there is none that can be used."""
        path = self._path(key)
        with suppress(OSError, RigwrightError):
            found = parsed(UnitResult, plain_bytes(path), path.name)
            return found if found.key == key else None
        return None

    def put(self, result: UnitResult) -> None:
        """Keep a result. Raises :class:`InputError` where it cannot be written."""
        self._folder.mkdir(parents=True, exist_ok=True)
        text = result.model_dump_json(by_alias=True, indent=1) + "\n"
        write_whole(self._path(result.key), text.encode(), overwrite=True)

    def clean(self) -> None:
        """Remove what a killed process left half written."""
        remove_unfinished(self._folder)

    def _path(self, key: str) -> Path:
        return self._folder / f"{key}.json"
