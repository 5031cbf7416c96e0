"""What lies in a folder of pictures, and what was read of it."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from stat import S_ISREG

from rig.acquisition.cameras.exif import read_exif
from rig.acquisition.cameras.wholeness import MEDIA_TYPES, has_gaps, is_whole

PLACES = 16
PLACE_BYTES = 4096
SET_APART = frozenset({"thumbs", "thumbnails", "previews", "proxies", "cache", "lost+found"})
"""Folders in which programs keep what is no picture of a camera, in small letters."""


def is_apart(path: Path, below: Path) -> bool:
    """Whether a file lies in a folder that is hidden or set apart."""
    folders = path.relative_to(below).parts[:-1]
    return any(f[0] in ".@#$" or f.lower() in SET_APART for f in folders)


@dataclass(frozen=True)
class Stamp:
    """What changes when a file is written to, and what stays when it is renamed."""

    size: int
    modified_ns: int
    node: tuple[int, int] = (0, 0)

    @property
    def written(self) -> tuple[int, int]:
        """The same without what changes where a share is mounted again."""
        return self.size, self.modified_ns


def _glimpse(path: Path, size: int) -> str:
    told = hashlib.sha256(str(size).encode())
    with path.open("rb") as file:
        for k in range(PLACES):
            file.seek(max(0, size - PLACE_BYTES) * k // (PLACES - 1))
            told.update(file.read(PLACE_BYTES))
    return told.hexdigest()


class FolderWatch:
    """The files below a folder, looked at by name and time; remembers what it read of them."""

    def __init__(self, root: Path, suffixes: Sequence[str]) -> None:
        self.root = root
        self._suffixes = tuple(s.lower() for s in suffixes) or tuple(MEDIA_TYPES)
        self._whole: dict[tuple[Path, Stamp], bool] = {}
        self._tags: dict[tuple[Path, Stamp], Mapping[str, str]] = {}
        self._contents: dict[tuple[Path, Stamp], str] = {}
        self._glimpses: dict[tuple[Path, Stamp], str] = {}
        self._gaps: dict[tuple[Path, Stamp], bool] = {}
        self._seen: dict[str, str] = {}
        self._lock = threading.Lock()

    def content(self, path: Path, stamp: Stamp) -> str:
        """The checksum of a file's bytes."""
        with self._lock:
            if (path, stamp) not in self._contents:
                self._contents[path, stamp] = hashlib.sha256(path.read_bytes()).hexdigest()
            return self._contents[path, stamp]

    def glimpse(self, path: Path, stamp: Stamp) -> str:
        """A checksum of places all over a file: quickly read, and no two pictures have the same."""
        with self._lock:
            if (path, stamp) not in self._glimpses:
                self._glimpses[path, stamp] = _glimpse(path, stamp.size)
            return self._glimpses[path, stamp]

    def seen(self, content: str) -> str:
        """The file that had this content in an earlier shot, empty when none did."""
        with self._lock:
            return self._seen.get(content, "")

    def see(self, contents: Mapping[str, str]) -> None:
        """Remember contents, and the names of their files, as those of earlier shots."""
        with self._lock:
            for content, name in contents.items():
                self._seen.setdefault(content, name)

    def files(self, below: Path) -> dict[Path, Stamp]:
        """Picture files and their stamps. OSError when the folder is not there."""
        below.stat()
        found = {}
        for path in below.rglob("*"):
            if not self._counts(path, below):
                continue
            try:
                stat = path.stat()
            except OSError:  # renamed or removed by its program just now
                continue
            if not S_ISREG(stat.st_mode):
                # Reading a pipe or a socket waits for ever.
                continue
            found[path] = Stamp(stat.st_size, stat.st_mtime_ns, (stat.st_dev, stat.st_ino))
        return found

    def _counts(self, path: Path, below: Path) -> bool:
        """Whether a file is a picture by its name, and in no folder that is hidden or set apart."""
        if path.suffix.lower() not in self._suffixes or path.name.startswith("."):
            return False
        return not is_apart(path, below)

    def others(self, below: Path) -> dict[Path, Stamp]:
        """Files of other names: pictures that are to be, and what is none."""
        found = {}
        for path in below.rglob("*"):
            if not self._counts(path, below):
                with suppress(OSError):
                    stat = path.lstat()
                    if S_ISREG(stat.st_mode):
                        node = stat.st_dev, stat.st_ino
                        found[path] = Stamp(stat.st_size, stat.st_mtime_ns, node)
        return found

    def whole(self, path: Path, stamp: Stamp) -> bool:
        """Whether the file is all there; what is not is looked at again."""
        with self._lock:
            if self._whole.get((path, stamp)):
                return True
            self._whole[path, stamp] = is_whole(path)
            return self._whole[path, stamp]

    def gaps(self, path: Path, stamp: Stamp) -> bool:
        """Whether a whole file has room that may still be filled."""
        with self._lock:
            if (path, stamp) not in self._gaps:
                self._gaps[path, stamp] = has_gaps(path)
            return self._gaps[path, stamp]

    def tags(self, path: Path, stamp: Stamp) -> Mapping[str, str]:
        """The EXIF of a whole file. OSError when it is gone."""
        with self._lock:
            if (path, stamp) not in self._tags:
                tags = read_exif(path)
                path.stat()  # that of a file that went meanwhile says nothing
                self._tags[path, stamp] = tags
            return self._tags[path, stamp]
