"""Folders written whole or not at all: beside their place first, then renamed."""

from __future__ import annotations

import errno
import os
import shutil
import stat
import tempfile
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from common.errors import ConflictError, InputError
from common.files.lock import KernelLock, LockHeldError, lock_folder
from common.files.ownership import MARKER, files_of, foreign, mark
from common.files.placing import NOT_REPLACED, put_in_place
from common.files.writing import FULL, missing, remove_empty, with_parents

_OF_THE_DISK = (*FULL, errno.EIO, errno.EROFS)
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
    with _told(out):
        _refuse_place(out)
        _refuse_loss(out, spare)
        _refuse_here(out)
        held = _holds_something(out)
        if held and not force:
            raise ConflictError("out-not-empty", f"the folder {out} is not empty", NOT_REPLACED)
        if held:
            _refuse_foreign(out, out, renewed)

    def may_go(old: Path) -> None:
        _refuse_foreign(old, out, renewed)

    with _half_made(out) as half:
        with _told(out, only=_OF_THE_DISK):
            yield half
        with _told(out):
            mark(half)
            put_in_place(half, out, may_go if force else None)


@contextmanager
def whole_folder(out: Path, may_go: Callable[[Path], None]) -> Iterator[Path]:
    """An empty folder that becomes ``out`` when all went well, and disappears when not.

    What was in ``out`` is replaced then, where ``may_go`` raises nothing when it looks through it
    (:func:`refuse_others`). Raises :class:`ConflictError` where something that must stay is
    there, :class:`InputError` where it cannot be written.
    """

    def asked(old: Path) -> None:
        try:
            may_go(old)
        except ConflictError as error:
            problem = error.problem.replace(str(old), str(out))
            raise ConflictError(error.detail, problem, error.remedy) from error

    with _told(out):
        _refuse_place(out)
    with _half_made(out) as half, _told(out):
        yield half
        put_in_place(half, out, asked)


@contextmanager
def grown_folder(
    out: Path,
    kept: str,
    *,
    force: bool,
    ours: Callable[[Path], bool],
    same: Callable[[], bool],
    spare: Callable[[], Iterable[Path]] = tuple,
) -> Iterator[Path]:
    """An empty folder whose files join ``out`` when all went well, and disappear when not.

    What is in ``out/kept`` stays, whatever happens, and may grow meanwhile; the rest of ``out`` is
    replaced. Only files there that are ``ours`` are listed as this program's. Results are replaced
    without ``force`` where ``same`` says that they are of the same work, or where there are none
    yet. Raises as :func:`new_folder` does, and where another process is at work in ``out``.
    """
    with _told(out):
        _refuse_place(out)
        existed, held, made = out.exists(), _holds_something(out), missing(out.parent)
        if held:
            _refuse_other_work(out, kept, force=force, same=same)
        _refuse_loss(out, spare())
        lock = _begun(out)
    try:
        with _half_made(out) as half:
            with _told(out, only=_OF_THE_DISK):
                yield half
            with _told(out):
                # Looked at again: it was in plain view for long.
                _refuse_foreign(out, out, _all_in(out / kept))
                _clear(out, kept)
                for path in sorted(half.iterdir()):
                    path.replace(out / path.name)
                mark(out, [path for path in _all_in(out / kept) if not ours(path)])
    finally:
        lock.release()
        if not held and not files_of(out):
            (out / MARKER).unlink(missing_ok=True)
            remove_empty([] if existed else [out, *made])


def _begun(out: Path) -> KernelLock:
    """A marked folder, and the lock of whoever works in it."""
    try:
        with with_parents(out):
            if not (out / MARKER).exists():
                mark(out)
            return lock_folder(out)
    except LockHeldError as error:
        remedy = "wait until it has ended, or give another --out"
        raise ConflictError("out-busy", f"another process works in {out}", remedy) from error


def _refuse_other_work(out: Path, kept: str, *, force: bool, same: Callable[[], bool]) -> None:
    """Refuse a folder that is not ours, or holds results of another work."""
    begun = (out / MARKER).is_file() and (not files_of(out) or (out / kept).is_dir())
    if not force and not (begun and same()):
        raise ConflictError("out-not-empty", f"the folder {out} is not empty", NOT_REPLACED)
    _refuse_foreign(out, out, _all_in(out / kept))


def _all_in(folder: Path) -> list[Path]:
    """A folder and all that is below it; nothing where there is none."""
    return [folder, *folder.rglob("*")] if folder.is_dir() else []


def _clear(out: Path, kept: str) -> None:
    """Remove all files and folders of ``out`` but ``kept``."""
    for path in sorted(out.rglob("*"), reverse=True):
        if path.relative_to(out).parts[0] != kept and path.name != MARKER:
            path.rmdir() if path.is_dir() else path.unlink()


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


@contextmanager
def _told(out: Path, only: Collection[int] = ()) -> Iterator[None]:
    """What the system refuses, in one line; ``only`` where it can be of nothing but the disk."""
    try:
        yield
    except OSError as error:
        if only and error.errno not in only:
            raise
        raise InputError(
            "out-unwritable",
            f"cannot write to {out} ({(error.strerror or 'unwritable').lower()})",
            "free space on the disk, or give another --out"
            if error.errno in FULL
            else "give another --out",
        ) from error


@contextmanager
def _half_made(out: Path) -> Iterator[Path]:
    """A new folder in a hidden one beside ``out``; both are gone afterwards.

    Of the hidden folder nothing but what stands in the new one is ever removed: what was in
    ``out`` may be there, where it could not be put back.
    """
    with _told(out):
        made = missing(out.parent)
        partial = _beside(out)
    try:
        (partial / "files").mkdir()
        yield partial / "files"
    finally:
        shutil.rmtree(partial / "files", ignore_errors=True)
        remove_empty([partial, *([] if out.exists() else made)])


def _refuse_place(out: Path) -> None:
    """Refuse what is no folder of its own, or one that this user may not replace."""
    if out.is_symlink():
        raise ConflictError("out-not-a-folder", f"{out} is a link", "give another --out")
    if out.exists() and not out.is_dir():
        kind = "a file" if out.is_file() else "no folder"
        raise InputError("out-not-a-folder", f"{out} is {kind}", "give another --out")
    for parent in out.parents:
        if parent.is_symlink() and not parent.exists():
            raise InputError(
                "out-not-a-folder",
                f"cannot write into {parent} (a link to nothing)",
                "give another --out",
            )
        if parent.exists() and not parent.is_dir():
            raise InputError(
                "out-not-a-folder",
                f"cannot write into {parent} (not a folder)",
                "give another --out",
            )
    if out.exists():
        _refuse_protected(out)


def _refuse_protected(out: Path) -> None:
    """Refuse at once what the system would refuse when all the work is done."""
    if os.path.ismount(out):
        raise ConflictError(
            "out-not-ours", f"{out} is a place where a disk is mounted", "give a folder in it"
        )
    beside = out.absolute().parent.stat()
    owners = (0, beside.st_uid, out.stat().st_uid)
    if beside.st_mode & stat.S_ISVTX and os.geteuid() not in owners:
        raise ConflictError("out-not-ours", f"{out} is another user's", "give another --out")


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
    out.parent.mkdir(parents=True, exist_ok=True)
    # Not named after it: a name that is nearly as long as names may be would not fit.
    return Path(tempfile.mkdtemp(prefix=f".{out.name[:40]}-", dir=out.parent))
