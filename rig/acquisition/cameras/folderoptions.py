"""Options of cameras whose files arrive in folders."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from common.errors import InputError
from common.files.strict import StrictModel


class FolderOptions(StrictModel):
    """Options of folder cameras."""

    root: str
    by: Literal["folder", "serial"] = "folder"
    """Which camera a file is of: the one its folder is named after, or the body whose serial
    number stands in its EXIF."""
    cameras: Annotated[dict[str, str], Field(default_factory=dict)]
    """Names of cameras and their folder below ``root``, or their serial number; empty: every
    folder, or every number seen, is a camera."""
    suffixes: tuple[str, ...] = ()
    """Files wanted, such as ``[".jpg"]``; empty: all kinds of pictures."""
    settle_s: Annotated[float, Field(ge=0, le=60)] = 0.3
    """How long a file must not have changed."""
    trigger: Literal["edge", "none"] = "none"
    """``edge`` where the trigger box fires these cameras by cable."""


def owned(options: FolderOptions, camera_id: str) -> str:
    """What a camera has to itself, in words: its folder, or a body's files below the root."""
    root = Path(options.root).expanduser()
    key = options.cameras.get(camera_id, camera_id)
    if options.by == "folder":
        return f"folder {(root / key).resolve()}"
    return f"files of body {key} in folder {root.resolve()}"


def below(root: Path, options: FolderOptions, key: str) -> Path:
    """Where a camera's files are."""
    return root / key if options.by == "folder" else root


def require_different(options: FolderOptions) -> None:
    """Raise :class:`InputError` where one folder, or one body, is two cameras."""
    seen: dict[str, str] = {}
    for name in options.cameras:
        other = seen.setdefault(owned(options, name), name)
        if other != name:
            raise InputError(
                "camera-option",
                f"cameras '{other}' and '{name}' have the same {owned(options, name)}",
                "give each its own in the option 'cameras'",
            )
