"""Pictures in a ZIP archive, which may come from anybody.

Names in the archive are never used as paths as they are: a picture is unpacked to
``CAMERA/FRAME.ext`` made of its last two parts, both checked.
"""

from __future__ import annotations

import lzma
import re
import shutil
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from common.errors import InputError, TooLargeError
from service.kinds.imports import PictureFacts
from service.pictures.listing import LAYOUT, is_picture

MOST_PICTURES = 20_000
MOST_GROWTH = 200
"""Pictures hardly shrink in an archive; one that grows more than this is meant to fill a disk."""
KEPT_FREE = 1 << 30
"""Bytes that unpacking leaves on the disk: captures are written to it too."""

_BROKEN = (zipfile.BadZipFile, EOFError, zlib.error, lzma.LZMAError, NotImplementedError)
"""What reading a picture of a broken archive, or of one packed in an unknown way, may raise."""

_NAME = re.compile(r"\w[\w .+-]{0,99}")


def archive_facts(path: Path) -> PictureFacts:
    """What an archive holds.

    Raises :class:`InputError` for anything but a ZIP archive with a folder per camera.
    """
    with _opened(path) as archive:
        entries = list(_pictures(archive, path.name))
    cameras: dict[str, int] = {}
    for camera, _, _ in entries:
        cameras[camera] = cameras.get(camera, 0) + 1
    return PictureFacts(
        cameras=cameras,
        frames=len({PurePosixPath(name).stem for _, name, _ in entries}),
        bytes=sum(info.file_size for _, _, info in entries),
    )


def unpack(path: Path, folder: Path) -> None:
    """Unpack the pictures of an archive into ``folder``, a folder per camera.

    Raises :class:`InputError` for a broken one, :class:`TooLargeError` where there is no room.
    """
    with _opened(path) as archive:
        pictures = list(_pictures(archive, path.name))
        _require_room(sum(info.file_size for _, _, info in pictures), folder, path.name)
        for camera, name, info in pictures:
            target = folder / camera / name
            target.parent.mkdir(exist_ok=True)
            try:
                with archive.open(info) as source, target.open("wb") as out:
                    shutil.copyfileobj(source, out)
            except _BROKEN as error:
                raise _damaged(path.name) from error
            except OSError as error:
                # bz2 says so of a broken stream, without a number; the disk's troubles have one.
                if error.errno is not None:
                    raise
                raise _damaged(path.name) from error


def _require_room(needed: int, folder: Path, name: str) -> None:
    free = shutil.disk_usage(folder).free
    if needed > free - KEPT_FREE:
        raise TooLargeError(
            "pictures",
            f"{name} takes {needed / 1e9:.1f} GB when unpacked, and {free / 1e9:.1f} GB are free",
            "make room, or send fewer pictures",
        )


@contextmanager
def _opened(path: Path) -> Iterator[zipfile.ZipFile]:
    try:
        archive = zipfile.ZipFile(path)
    except (zipfile.BadZipFile, OSError) as error:
        raise _damaged(path.name) from error
    with archive:
        yield archive


def _damaged(name: str) -> InputError:
    return InputError("pictures-archive", f"{name} is no sound ZIP archive", "pack it again")


def _pictures(archive: zipfile.ZipFile, name: str) -> Iterator[tuple[str, str, zipfile.ZipInfo]]:
    """Camera, file name and entry of each picture."""
    seen: set[tuple[str, str]] = set()
    for info in archive.infolist():
        if info.is_dir() or not is_picture(info.filename):
            continue
        parts = PurePosixPath(info.filename.replace("\\", "/")).parts
        if len(parts) < 2:
            problem = f"{parts[-1][:80]!r} in {name} is of no camera"
            raise InputError("pictures-none", problem, LAYOUT)
        camera, file = parts[-2:]
        if not (_NAME.fullmatch(camera) and _NAME.fullmatch(file)):
            raise InputError(
                "pictures-archive",
                f"{name} holds a picture with the odd name {info.filename[:80]!r}",
                "use letters, digits, dots, dashes and spaces",
            )
        if (camera, file) in seen:
            raise InputError(
                "pictures-twice", f"{name} holds {camera}/{file} twice", "pack one of them"
            )
        seen.add((camera, file))
        _refuse_bomb(info, len(seen), f"{camera}/{file}", name)
        yield camera, file, info
    if not seen:
        raise InputError("pictures-none", f"{name} holds no pictures", LAYOUT)


def _refuse_bomb(info: zipfile.ZipInfo, count: int, picture: str, name: str) -> None:
    if count > MOST_PICTURES:
        raise TooLargeError(
            "pictures", f"{name} holds more than {MOST_PICTURES} pictures", "send it in parts"
        )
    if info.flag_bits & 1:
        raise InputError("pictures-archive", f"{name} is encrypted", "pack it without a password")
    if info.file_size > MOST_GROWTH * max(info.compress_size, 1) + (1 << 20):
        raise TooLargeError(
            "pictures",
            f"{picture} in {name} grows {MOST_GROWTH} times when unpacked",
            "send pictures as PNG, JPEG or TIFF files",
        )
