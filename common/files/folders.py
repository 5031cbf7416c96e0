"""Folders written whole or not at all: beside their place first, then renamed."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from common.errors import ConflictError, InputError
from common.files.lock import LockHeldError, lock_folder
from common.files.ownership import MARKER, files_of, foreign, mark

_ANOTHER = "give another --out, or move it away yourself"


@contextmanager
def new_folder(
    out: Path, *, force: bool, spare: Iterable[Path] = (), renewed: Collection[Path] = ()
) -> Iterator[Path]:
    """An empty folder that becomes ``out`` when all went well, and disappears when not.

    What is in it then is listed in the folder (:mod:`common.files.ownership`). With ``force`` a
    folder that holds files is replaced, but only where all of them are such results, unchanged:
    files ``renewed`` may have been changed. Raises :class:`ConflictError` for any other folder
    that is not empty, for links, and where ``out`` holds one of the files and folders to
    ``spare``, which would be lost; :class:`InputError` where nothing can be written.
    """
    _refuse_place(out)
    _refuse_loss(out, spare)
    _refuse_here(out)
    if _holds_something(out):
        if not force:
            raise ConflictError(
                "out-not-empty",
                f"the folder {out} is not empty",
                "give another --out, or --force to replace results that are in it",
            )
        _refuse_foreign(out, out, renewed)
    made = _missing_parents(out)
    partial = _beside(out)
    try:
        (partial / "files").mkdir()
        yield partial / "files"
        mark(partial / "files")
        _put_in_place(partial, out, renewed)
    finally:
        shutil.rmtree(partial, ignore_errors=True)
        if not out.exists():
            _remove_empty(made)


@contextmanager
def whole_folder(out: Path) -> Iterator[Path]:
    """An empty folder that becomes ``out`` when all went well, and disappears when not.

    What was in ``out`` is replaced then: whoever calls made sure (:func:`refuse_others`) that it
    may be. Raises :class:`InputError` where it cannot be written.
    """
    partial = _beside(out)
    try:
        (partial / "files").mkdir()
        yield partial / "files"
        if _holds_something(out):
            out.rename(partial / "old")
        _rename_new(partial, out)
    except OSError as error:
        raise InputError(
            "out-unwritable",
            f"cannot write to {out} ({(error.strerror or 'unwritable').lower()})",
            "choose another --out folder",
        ) from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)


@contextmanager
def grown_folder(
    out: Path, kept: str, *, force: bool, spare: Iterable[Path] = (), same: Callable[[], bool]
) -> Iterator[Path]:
    """An empty folder whose files join ``out`` when all went well, and disappear when not.

    What is in ``out/kept`` stays, whatever happens, and may grow meanwhile; the rest of ``out`` is
    replaced. Its results are replaced without ``force`` where ``same`` says that they are of the
    same work, or where there are none yet. Raises as :func:`new_folder` does, and where another
    process is at work in ``out``.
    """
    _refuse_place(out)
    _refuse_loss(out, spare)
    held, made = _holds_something(out), _missing_parents(out)
    if held:
        _refuse_other_work(out, kept, force=force, same=same)
    try:
        out.mkdir(parents=True, exist_ok=True)
        if not (out / MARKER).exists():
            mark(out)
        lock = lock_folder(out)
    except LockHeldError as error:
        remedy = "wait until it has ended, or give another --out"
        raise ConflictError("out-busy", f"another process works in {out}", remedy) from error
    except OSError as error:
        problem = f"cannot write into {out} ({(error.strerror or 'unwritable').lower()})"
        raise InputError("out-unwritable", problem, "give another --out") from error
    partial = _beside(out)
    try:
        (partial / "files").mkdir()
        yield partial / "files"
        # Looked at again: it was in plain view for long.
        _refuse_foreign(out, out, _all_in(out / kept))
        _clear(out, kept)
        for path in sorted((partial / "files").iterdir()):
            path.replace(out / path.name)
        mark(out)
    finally:
        lock.release()
        shutil.rmtree(partial, ignore_errors=True)
        if not held and not files_of(out):
            shutil.rmtree(out, ignore_errors=True)
            _remove_empty(made)


def _refuse_other_work(out: Path, kept: str, *, force: bool, same: Callable[[], bool]) -> None:
    """Refuse a folder that is not ours, or holds results of another work."""
    begun = (out / MARKER).is_file() and (not files_of(out) or (out / kept).is_dir())
    if not force and not (begun and same()):
        raise ConflictError(
            "out-not-empty",
            f"the folder {out} is not empty",
            "give another --out, or --force to replace results that are in it",
        )
    _refuse_foreign(out, out, _all_in(out / kept))


def _all_in(folder: Path) -> list[Path]:
    """A folder and all that is below it; nothing where there is none."""
    return [folder, *folder.rglob("*")] if folder.is_dir() else []


def _clear(out: Path, kept: str) -> None:
    """Remove all files and folders of ``out`` but ``kept``."""
    for path in sorted(out.rglob("*"), reverse=True):
        if path.relative_to(out).parts[0] != kept and path.name != MARKER:
            path.rmdir() if path.is_dir() else path.unlink()


def _missing_parents(out: Path) -> list[Path]:
    return [parent for parent in out.parents if not parent.exists()]


def _remove_empty(folders: Iterable[Path]) -> None:
    for folder in folders:
        with suppress(OSError):
            folder.rmdir()


def refuse_others(out: Path, own: Collection[str]) -> None:
    """Raise :class:`ConflictError` where ``out`` is no folder, or holds files but ``own``."""
    if out.is_symlink():
        raise ConflictError("out-not-a-folder", f"{out} is a link", "choose another place")
    if out.is_dir():
        held = (p for p in out.rglob("*") if p.is_symlink() or not p.is_dir())
        others = sorted({p.relative_to(out).as_posix() for p in held} - set(own))
        if others:
            raise ConflictError(
                "out-not-empty",
                f"the folder {out} holds other files ({others[0]})",
                "choose an empty or new folder",
            )
    elif out.exists():
        raise ConflictError("out-not-a-folder", f"{out} is not a folder", "choose another place")


def _refuse_place(out: Path) -> None:
    """Refuse what is no folder of its own."""
    if out.is_symlink():
        raise ConflictError("out-not-a-folder", f"{out} is a link", "give another --out")
    if out.exists() and not out.is_dir():
        raise InputError("out-not-a-folder", f"{out} is a file", "give another --out")


def _refuse_here(out: Path) -> None:
    """Refuse to rename away the folder that the user stands in."""
    if out.exists() and Path.cwd().is_relative_to(out.resolve()):
        raise ConflictError(
            "out-here", f"{out} is the folder you are in, or above it", "name a new folder"
        )


def _refuse_foreign(held: Path, out: Path, renewed: Collection[Path]) -> None:
    """Refuse to replace ``out``, whose content is at ``held`` now, where it is not all ours."""
    reason = foreign(held, [held / path.relative_to(out) for path in renewed])
    if reason is not None:
        raise ConflictError("out-not-ours", f"the folder {out} {reason}", _ANOTHER)
    if not held.stat().st_mode & 0o200:
        raise ConflictError("out-not-ours", f"the folder {out} is write-protected", _ANOTHER)


def _refuse_loss(out: Path, spare: Iterable[Path]) -> None:
    for path in spare:
        if path.exists() and path.resolve().is_relative_to(out.resolve()):
            raise ConflictError(
                "out-holds-input",
                f"the folder {out} holds {path}, which would be lost",
                "give another --out",
            )


def _holds_something(out: Path) -> bool:
    try:
        return out.is_dir() and any(out.iterdir())
    except OSError as error:
        raise InputError(
            "out-not-readable", f"cannot look into {out} ({error.strerror})", "give another --out"
        ) from error


def _beside(out: Path) -> Path:
    """A new folder in the folder that ``out`` is to stand in."""
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        return Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.parent))
    except OSError as error:
        raise InputError(
            "out-unwritable",
            f"cannot write into {out.parent} ({error.strerror})",
            "give another --out",
        ) from error


def _put_in_place(partial: Path, out: Path, renewed: Collection[Path]) -> None:
    """Rename the new folder to ``out``; what was there steps aside first and is removed last."""
    old = partial / "old"
    try:
        if _holds_something(out):
            out.rename(old)
            # Looked at again now that nobody else knows where it is: it was in plain view for long.
            _refuse_foreign(old, out, renewed)
        _rename_new(partial, out)
    except OSError as error:
        raise InputError(
            "out-unwritable",
            f"cannot write to {out} ({(error.strerror or 'unwritable').lower()})",
            "give another --out",
        ) from error
    finally:
        if old.exists() and not out.exists():
            old.rename(out)


def _rename_new(partial: Path, out: Path) -> None:
    """A rename onto a folder that is empty replaces it; onto any other it fails."""
    old = partial / "old"
    try:
        (partial / "files").rename(out)
    except OSError:
        if old.exists() and not out.exists():
            old.rename(out)
        raise
