"""A finished folder put in its place, so that at no moment nothing, or half of it, stands there."""

from __future__ import annotations

import ctypes
import errno
import os
import shutil
from collections.abc import Callable
from pathlib import Path

from common.errors import ConflictError, InputError
from common.files.ownership import foreign
from common.files.writing import give_owner

NOT_REPLACED = "give another --out, or --force to replace results that are in it"

_RENAME_EXCHANGE = 2
"""Of ``renameat2(2)``."""
_HERE = -100
"""``AT_FDCWD``: relative paths are those of this process."""
_NOT_SUPPORTED = (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP)


def put_in_place(new: Path, out: Path, may_go: Callable[[Path], None] | None) -> None:
    """Rename the folder ``new`` to ``out``, which keeps its owner, group and permissions.

    What stood in ``out`` is removed where ``may_go`` agrees. It is asked once that is out of
    everybody's sight, with the place where it is now, and raises where it has to stay: then it
    stands in ``out`` again. Without ``may_go`` nothing but an empty folder is replaced. Raises
    :class:`ConflictError` then, and :class:`OSError`. What cannot be moved back, for whatever
    reason, is left beside ``new`` under the name ``old``, and so is what cannot be removed;
    :class:`InputError` says where.
    """
    _dress(new, out)
    if not (out.is_dir() and any(out.iterdir())):
        # Onto a folder that is no longer empty this fails.
        new.rename(out)
        return
    if may_go is None:
        raise ConflictError("out-not-empty", f"the folder {out} is not empty", NOT_REPLACED)
    _exchange(new, out)
    old = new.rename(new.with_name("old"))
    try:
        may_go(old)
    except BaseException:
        _put_back(old, out)
        # Both were in plain view for a moment: what somebody laid into the new one is kept too.
        if foreign(old) is None:
            old.rename(new)
        raise
    try:
        shutil.rmtree(old)
    except OSError as error:
        raise InputError(
            "out-remains",
            f"{out} holds the new results, but of the former ones some cannot be removed"
            f" ({(error.strerror or str(error)).lower()})",
            f"remove {old.parent} yourself",
        ) from error


def _put_back(old: Path, out: Path) -> None:
    try:
        _exchange(old, out)
    except OSError as error:
        raise InputError(
            "out-unwritable",
            f"what stood in {out} could not be put back ({(error.strerror or str(error)).lower()})",
            f"it is whole in {old}: move it where you want it",
        ) from error


def _dress(new: Path, out: Path) -> None:
    """Give ``new`` what a folder that stands in ``out`` has, as far as this process may."""
    if not out.is_dir():
        return
    standing = out.stat()
    give_owner(new, standing)
    # After the owner: a change of owner takes the set-group bit away.
    shutil.copystat(out, new)


def _exchange(one: Path, other: Path) -> None:
    """Let two folders change places, at once where the file system can."""
    libc = ctypes.CDLL(None, use_errno=True)
    names = os.fsencode(one), os.fsencode(other)
    if not hasattr(libc, "renameat2"):
        _exchange_by_steps(one, other)
    elif libc.renameat2(_HERE, names[0], _HERE, names[1], _RENAME_EXCHANGE) != 0:
        number = ctypes.get_errno()
        if number not in _NOT_SUPPORTED:
            raise OSError(number, os.strerror(number), str(other))
        _exchange_by_steps(one, other)


def _exchange_by_steps(one: Path, other: Path) -> None:
    aside = one.with_name("aside")
    other.rename(aside)
    try:
        one.rename(other)
    except OSError:
        aside.rename(other)
        raise
    aside.rename(one)
