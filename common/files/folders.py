"""Folders written whole or not at all: beside their place first, then renamed."""

from __future__ import annotations

import secrets
import shutil
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from common.errors import ConflictError, InputError


@contextmanager
def whole_folder(out: Path) -> Iterator[Path]:
    """An empty folder that becomes ``out`` when all went well, and disappears when not.

    What was in ``out`` is replaced then. Raises :class:`InputError` where it cannot be written.
    """
    half = out.parent / f".{out.name}.{secrets.token_hex(4)}.part"
    try:
        half.mkdir(parents=True)
        yield half
        _put_in_place(half, out)
    except OSError as error:
        raise InputError(
            "out-unwritable",
            f"cannot write to {out} ({(error.strerror or 'unwritable').lower()})",
            "choose another --out folder",
        ) from error
    finally:
        shutil.rmtree(half, ignore_errors=True)


def refuse_others(out: Path, own: Collection[str]) -> None:
    """Raise :class:`ConflictError` where ``out`` is no folder, or holds files but ``own``."""
    if out.is_dir():
        held = (p for p in out.rglob("*") if p.is_symlink() or not p.is_dir())
        others = sorted({p.relative_to(out).as_posix() for p in held} - set(own))
        if others:
            raise ConflictError(
                "out-not-empty",
                f"the folder {out} holds other files ({others[0]})",
                "choose an empty or new folder",
            )
    elif out.exists() or out.is_symlink():
        raise ConflictError("out-not-a-folder", f"{out} is not a folder", "choose another place")


def _put_in_place(half: Path, out: Path) -> None:
    """Rename ``half`` to ``out``; what was there steps aside first and goes last."""
    former = half.with_suffix(".old")
    if out.exists():
        out.rename(former)
    try:
        half.rename(out)
    except OSError:
        if former.exists():
            former.rename(out)
        raise
    shutil.rmtree(former, ignore_errors=True)
