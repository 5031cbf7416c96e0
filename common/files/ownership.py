"""Which files of a folder this program wrote: a list with checksums that stands in the folder.

A folder is replaced only where this list accounts for all that is in it, so that nothing of
anybody else's is ever removed: no source folder, no note that somebody put beside the results, no
result that was changed by hand.
"""

from __future__ import annotations

import hashlib
import json
import os
import stat
from collections.abc import Collection, Iterator
from pathlib import Path

from common.errors import ConflictError
from common.files.reading import json_in
from common.files.writing import is_unfinished, put_whole

MARKER = ".rigwright.json"
"""The name of the list."""

SCHEMA = "rigwright.folder/1"


def files_of(folder: Path) -> dict[str, Path]:
    """The files below ``folder`` by their relative names, in order; the list itself left out."""
    found = {path.relative_to(folder).as_posix(): path for path in sorted(folder.rglob("*"))}
    return {name: path for name, path in found.items() if path.is_file() and name != MARKER}


def mark(folder: Path, but: Collection[Path] = ()) -> None:
    """Write the list of all files that are in ``folder`` now, ``but`` those of somebody else.

    Raises :class:`ConflictError` where something else stands in the place of the list, and
    :class:`OSError`.
    """
    _write_list(folder, {name: _sha256(p) for name, p in files_of(folder).items() if p not in but})


def mark_also(folder: Path, path: Path) -> None:
    """Put one more file in ``folder`` on its list, which is begun where there is none.

    Raises as :func:`mark` does.
    """
    name = path.relative_to(folder).as_posix()
    _write_list(folder, (_listed(folder) or {}) | {name: _sha256(path)})


def refuse_other_list(folder: Path) -> None:
    """Raise :class:`ConflictError` where what stands in the place of the list is no such list."""
    marker = folder / MARKER
    if os.path.lexists(marker) and _listed(folder) is None:
        raise ConflictError(
            "list-not-ours",
            f"{marker} was not written by this program, or is damaged",
            "move it away, or give another folder",
        )


def _write_list(folder: Path, files: dict[str, str]) -> None:
    refuse_other_list(folder)
    document = {"schema": SCHEMA, "sha256": files}
    text = json.dumps(document, indent=1, ensure_ascii=False) + "\n"
    marker = folder / MARKER
    put_whole(marker, text.encode(), overwrite=marker.exists())


def foreign(folder: Path, but: Collection[Path] = ()) -> str | None:
    """Why ``folder`` must not be removed, as the end of a sentence; None where all in it is ours.

    Files to leave out of account, ``but``, may have been changed since they were written; so may
    folders, which are ours with nothing in them too.
    """
    if os.path.ismount(folder):
        return "is a place where a disk is mounted"
    listed = _listed(folder)
    if listed is None:
        return "was not written by this program"
    exempt = {path.resolve() for path in but}
    try:
        for name, path in _entries(folder):
            reason = _why_foreign(name, path, listed, exempt)
            if reason:
                return f"holds {name}, which {reason}"
    except OSError as error:
        return f"cannot be looked through ({(error.strerror or 'unreadable').lower()})"
    return None


def unchanged(path: Path) -> bool | None:
    """Whether a file is as the list in its folder says; None where there is no list."""
    listed = _listed(path.parent)
    if listed is None:
        return None
    plain = path.is_file() and not path.is_symlink()
    return plain and listed.get(path.name) == _sha256(path)


def _listed(folder: Path) -> dict[str, str] | None:
    """The list; None where there is none, or one that is not whole."""
    marker = folder / MARKER
    try:
        if marker.is_symlink():
            return None
        document = json_in(marker)
        if document["schema"] != SCHEMA:
            return None
        return {str(name): str(digest) for name, digest in document["sha256"].items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def _entries(folder: Path, prefix: str = "") -> Iterator[tuple[str, Path]]:
    """All that is below a folder, no link followed; the folder itself is not named."""
    with os.scandir(folder) as entries:
        for entry in sorted(entries, key=lambda e: e.name):
            name = prefix + entry.name
            yield name, Path(entry.path)
            if entry.is_dir(follow_symlinks=False):
                yield from _entries(Path(entry.path), f"{name}/")


def _why_foreign(
    name: str, path: Path, listed: dict[str, str], exempt: Collection[Path]
) -> str | None:
    mode = path.lstat().st_mode
    if stat.S_ISLNK(mode):
        return "is a link"
    if stat.S_ISDIR(mode):
        ours = any(known.startswith(f"{name}/") for known in listed) or path.resolve() in exempt
        if not ours or os.path.ismount(path):
            return "is not ours"
        return None if mode & stat.S_IWUSR else "is write-protected"
    if not stat.S_ISREG(mode):
        return "is no plain file"
    if not mode & stat.S_IWUSR:
        return "is write-protected"
    if name == MARKER or path.resolve() in exempt or is_unfinished(path):
        return None
    if name not in listed:
        return "this program did not put there"
    return None if _sha256(path) == listed[name] else "was changed since it was written"


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
