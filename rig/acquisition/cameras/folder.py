"""Cameras whose files another program fetches into folders: tethering software, card readers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from common.errors import DeviceError, InputError, NotFoundError
from rig.acquisition.cameras.base import (
    CameraInfo,
)
from rig.acquisition.cameras.foldercamera import FolderCamera
from rig.acquisition.cameras.folderoptions import FolderOptions, below, require_different
from rig.acquisition.cameras.folderpast import FolderPast
from rig.acquisition.cameras.folderwatch import FolderWatch
from rig.acquisition.cameras.options import read_options
from rig.acquisition.cameras.reach import answered, patiently


class FolderBackend:
    """Cameras behind a tree of folders; a :class:`~rig.acquisition.cameras.base.CameraBackend`."""

    name = "folder"

    def __init__(self, **options: object) -> None:
        self._options = read_options("folder", FolderOptions, options)
        root = Path(self._options.root).expanduser()
        if not answered(root.is_dir, f"the folder {root}"):
            raise InputError(
                "camera-option", f"there is no folder {root}", "correct the option 'root'"
            )
        require_different(self._options)
        self._watch = FolderWatch(root, self._options.suffixes)
        self._open: list[FolderCamera] = []
        self._pasts: dict[str, FolderPast] = {}

    def _keys(self) -> Mapping[str, str]:
        if self._options.cameras:
            return self._options.cameras
        root = self._watch.root
        if self._options.by == "folder":
            names = [
                entry.name for entry in patiently(lambda: list(root.iterdir())) if entry.is_dir()
            ]
        else:
            files = self._watch.files(root).items()
            tags = [self._watch.tags(p, s) for p, s in files if self._watch.whole(p, s)]
            names = [tag["BodySerialNumber"] for tag in tags if "BodySerialNumber" in tag]
        return {name: name for name in names if not name.startswith(".")}

    def discover(self) -> Sequence[CameraInfo]:
        """Cameras named in the options, else the folders or the serial numbers that are there."""
        return tuple(self._info(name, key) for name, key in sorted(self._keys().items()))

    def _info(self, name: str, key: str) -> CameraInfo:
        return CameraInfo(name, "folder", address=str(below(self._watch.root, self._options, key)))

    def open(self, camera_id: str) -> FolderCamera:
        """Open one by its name."""
        keys = answered(self._found, f"the folder {self._watch.root}")
        if camera_id not in keys and camera_id not in self._pasts:
            raise NotFoundError(
                "camera",
                f"there is no camera '{camera_id}' below {self._watch.root}",
                f"make its folder, or name it in 'cameras'; known: {', '.join(keys) or 'none'}",
            )
        key = keys.get(camera_id, camera_id)
        info = self._info(camera_id, key)
        place = below(self._watch.root, self._options, key)
        past = self._pasts.setdefault(camera_id, FolderPast(self._watch, place))
        camera = answered(
            lambda: FolderCamera(self._watch, self._options, info, key, past),
            f"the folder {info.address}",
        )
        self._open.append(camera)
        return camera

    def _found(self) -> Mapping[str, str]:
        """The cameras there are. DeviceError where the root cannot be looked through."""
        try:
            return self._keys()
        except OSError as error:
            raise DeviceError(
                "camera-gone",
                f"the folder {self._watch.root} cannot be read: {error.strerror}",
                "see to its network share or disk, then try again",
            ) from None

    def close(self) -> None:
        """Close what is open."""
        for camera in self._open:
            camera.close()
        self._open.clear()
