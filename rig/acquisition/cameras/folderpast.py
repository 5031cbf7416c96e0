"""What lay in a camera's folder when it was armed: none of it is a picture of now.

A share that is mounted again shows its files under new node numbers, and for a moment none at all:
what was there once is remembered, whatever the folder shows.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from common.words import as_text
from rig.acquisition.cameras.folderwatch import FolderWatch, Stamp


class FolderPast:
    """The files of before, of one camera. Used by one thread at a time."""

    def __init__(self, watch: FolderWatch, below: Path) -> None:
        self._watch, self._below = watch, below
        self._known: dict[Path, Stamp | None] = {}
        self._before: dict[Path, Stamp | None] = {}
        self._nodes: dict[Path, tuple[int, int]] = {}
        self._others: dict[Path, Stamp] = {}

    def look(self) -> dict[Path, Stamp | None]:
        """Files that are there now; None for those still being written. OSError: no folder."""
        files = self._watch.files(self._below)
        self._nodes = {path: stamp.node for path, stamp in files.items()}
        for path, stamp in files.items():
            with suppress(OSError):  # gone since
                self._watch.glimpse(path, stamp)
        return {p: s if self._watch.whole(p, s) else None for p, s in files.items()}

    def keep(self, present: Mapping[Path, Stamp | None]) -> None:
        """From now on these are of before, as is what was whole before and may be seen again."""
        gone = {p: s for p, s in self._known.items() if s is not None and p not in present}
        self._known = {**gone, **present}
        self._before = dict(self._known)
        self._others = self._watch.others(self._below)

    def take(self, path: Path, stamp: Stamp) -> None:
        """The file was looked at as it is."""
        self._known[path] = stamp

    def taken(self, path: Path, stamp: Stamp) -> bool:
        """Whether the file was looked at as it is, or was so before."""
        return self._known.get(path) == stamp

    def is_new(self, path: Path, stamp: Stamp) -> bool:
        """Whether a file has come, or was written anew, since what was kept."""
        # A file that was half there when the camera was armed is of an earlier shot, however
        # much it changes; one that was whole and changes has been written anew.
        if path not in self._known:
            return True
        known = self._known[path]
        if known is None or known == stamp:
            return False
        if known.written == stamp.written and self._same(path, known, stamp):
            # Its share was mounted again, or a copy of it put in its place.
            self._known[path] = stamp
            return False
        return True

    def _same(self, path: Path, known: Stamp, stamp: Stamp) -> bool:
        return self._watch.glimpse(path, known) == self._watch.glimpse(path, stamp)

    def renamed(self, path: Path, stamp: Stamp) -> str:
        """The name a file had when the camera was armed, empty for one that was not there."""
        for former, known in self._before.items():
            # Half there then, whole now under another name; or moved as it was.
            same = known == stamp or (known is None and self._nodes.get(former) == stamp.node)
            if same and former != path and not former.exists():
                return as_text(former.name)
        # A half under another name when the camera was armed is of an earlier shot.
        return next((as_text(p.name) for p, s in self._others.items() if s.node == stamp.node), "")

    def copied(self, path: Path, stamp: Stamp, content: str) -> str:
        """The name of a file of before with the same bytes, empty when there is none."""
        for former, known in self._before.items():
            if known is None or known.size != stamp.size:
                continue
            try:
                if former == path:
                    # Touched, or written again as it was: what it held is only known by glimpse.
                    if self._same(path, known, stamp):
                        return as_text(former.name)
                    continue
                if self._watch.content(former, known) == content:
                    return as_text(former.name)
            except OSError:  # gone since
                continue
        return ""

    def others(self) -> list[Path]:
        """Files that have come and are no pictures by their names. OSError: no folder."""
        now = self._watch.others(self._below)
        then = {path: stamp.written for path, stamp in self._others.items()}
        return sorted(path for path, stamp in now.items() if then.get(path) != stamp.written)
