"""Cameras whose files another program fetches into folders: tethering software, card readers.

The program may write slowly and in pieces. A file counts when its size has not changed for a while
and it has all that its header promises.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from common.errors import DeviceError, InputError, NotFoundError
from common.files.strict import StrictModel
from rig.acquisition.cameras.base import (
    ArmSpec,
    CameraCapabilities,
    CameraHealth,
    CameraInfo,
    CameraSettings,
    ClockSample,
    Frame,
    FrameStatus,
    TimestampKind,
    TriggerKind,
)
from rig.acquisition.cameras.exif import TIME_TAGS, exposure_us
from rig.acquisition.cameras.folderwatch import FolderWatch, Stamp
from rig.acquisition.cameras.options import read_options
from rig.acquisition.cameras.reach import FolderReach, answered
from rig.acquisition.cameras.wholeness import MEDIA_TYPES
from rig.acquisition.imaging import same_pixels

POLL_S = 0.03
OLD_S = 60.0
"""A file last written so long before the camera was armed is of before; clocks of shares differ."""
LONGEST_DOUBT_S = 3.0
"""How long a file with empty sectors must not have changed; less where the deadline is shorter."""


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


def _require_different(options: FolderOptions) -> None:
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


class FolderCamera:
    """One camera whose files arrive in a folder; a :class:`CameraDevice`."""

    def __init__(
        self, watch: FolderWatch, options: FolderOptions, info: CameraInfo, key: str
    ) -> None:
        self._watch, self._options, self._info, self._key = watch, options, info, key
        self._below = watch.root / key if options.by == "folder" else watch.root
        self._reach = FolderReach(self._below)
        self._known: dict[Path, Stamp | None] = {}
        self._before: dict[Path, Stamp | None] = {}
        self._nodes: dict[Path, tuple[int, int]] = {}
        self._unfinished_then: dict[tuple[int, int], str] = {}
        self._settling: dict[Path, tuple[Stamp, float]] = {}
        self._doubted: set[str] = set()
        self._frames: list[Frame] = []
        self._armed = False
        self._closed = False
        self._tells_time = False
        self._spec, self._armed_at_s = ArmSpec("", 1, 0.0), 0.0
        self._counts: Counter[str] = Counter()
        self._known = self._look()

    @property
    def info(self) -> CameraInfo:
        """Which camera this is."""
        return self._info

    @property
    def capabilities(self) -> CameraCapabilities:
        """Nothing but files: the program that fetches them tells no more."""
        return CameraCapabilities(
            trigger=TriggerKind(self._options.trigger),
            timestamps=TimestampKind.NONE,
            frame_counter=False,
            by_files=True,
        )

    def configure(self, settings: CameraSettings) -> CameraSettings:
        """Nothing can be set from here; InputError when it is asked for."""
        if settings != CameraSettings():
            raise InputError(
                "camera-setting",
                f"camera {self._info.id} is only seen through its files",
                "set it in the program that fetches them, and leave the settings out here",
            )
        return CameraSettings()

    def _look(self) -> dict[Path, Stamp | None]:
        """Files that are there now; None for those still being written."""
        try:
            files = self._watch.files(self._below)
        except OSError as error:
            raise self._gone(error) from None
        self._nodes = {path: stamp.node for path, stamp in files.items()}
        for path, stamp in files.items():
            with suppress(OSError):  # gone since
                self._watch.glimpse(path, stamp)
        return {p: s if self._watch.whole(p, s) else None for p, s in files.items()}

    def _gone(self, error: OSError | None = None) -> DeviceError:
        why = "it was closed" if self._closed else f"its folder: {error and error.strerror}"
        return DeviceError(
            "camera-gone",
            f"camera {self._info.id} (folder) is gone: {why}",
            "see that the folder is there and can be read, then arm again",
        )

    def arm(self, spec: ArmSpec) -> None:
        """Remember what is there already; only what comes from now on counts."""
        if self._closed:
            raise self._gone()
        present = self._look()
        self._watch.see({f.metadata["sha256"]: f.metadata["file"] for f in self._frames})
        fetched = {frame.metadata["path"] for frame in self._frames}
        self._counts["stale_frames"] += sum(
            self._is_new(path, stamp) and str(path) not in fetched
            for path, stamp in present.items()
            if stamp is not None and self._is_mine(path, stamp)
        )
        self._tells_time = self._told_time(present)
        self._spec, self._armed_at_s = spec, time.time()
        self._known, self._frames, self._armed = present, [], True
        self._before = dict(present)
        self._unfinished_then = self._watch.unfinished(self._below)
        self._settling.clear()
        self._doubted.clear()

    def _told_time(self, present: Mapping[Path, Stamp | None]) -> bool:
        """Whether the pictures of before tell their times: those taken, else the newest there."""
        if self._frames:
            return any("DateTimeOriginal" in frame.metadata for frame in self._frames)
        if self._tells_time:
            return True
        mine = [(s, p) for p, s in present.items() if s is not None and self._is_mine(p, s)]
        stamp, path = max(mine, key=lambda one: one[0].modified_ns, default=(None, None))
        if stamp is None or path is None:
            return False
        return "DateTimeOriginal" in self._watch.tags(path, stamp)

    def _is_new(self, path: Path, stamp: Stamp) -> bool:
        # A file that was half there when the camera was armed is of an earlier shot, however
        # much it changes; one that was whole and changes has been written anew.
        if path not in self._known:
            return True
        known = self._known[path]
        return known is not None and known != stamp

    def _is_mine(self, path: Path, stamp: Stamp) -> bool:
        if self._options.by == "folder":
            return True
        return self._watch.tags(path, stamp).get("BodySerialNumber") == self._key

    def software_trigger(self) -> None:
        """Never: these cameras are fired by somebody else."""
        raise InputError(
            "camera-trigger",
            f"camera {self._info.id} is only seen through its files",
            "fire it by the trigger box or by the program that fetches its files",
        )

    def wait_frames(self, count: int, timeout_s: float) -> Sequence[Frame]:
        """The files that came since :meth:`arm`, whole ones only.

        Those that may yet be filled are waited for; asked with no time to wait, they are given as
        they are: a picture that is black somewhere looks the same, and nobody asks again.
        """
        deadline = time.monotonic() + timeout_s
        while self._armed:
            began = time.monotonic()
            try:
                self._collect(hasty=timeout_s <= 0.0)
            except OSError:  # the folder went; health and the next arm say so
                break
            left = deadline - time.monotonic()
            if len(self._frames) >= count or left <= 0:
                break
            # A large tree on a slow share must not be read without a pause.
            time.sleep(min(max(POLL_S, time.monotonic() - began), left))
        return tuple(self._frames)

    def _collect(self, *, hasty: bool) -> None:
        now = time.monotonic()
        files = self._watch.files(self._below)
        for path, stamp in sorted(files.items(), key=lambda item: (item[1].modified_ns, item[0])):
            if not self._is_new(path, stamp):
                continue
            seen, since = self._settling.get(path, (None, now))
            if seen != stamp:
                self._settling[path] = (stamp, now)
                since = now
            if self._is_steady(path, stamp, now - since, hasty=hasty):
                self._known[path] = stamp
                if self._is_mine(path, stamp):
                    self._take(path, stamp)

    def _is_steady(self, path: Path, stamp: Stamp, unchanged_s: float, *, hasty: bool) -> bool:
        """Whether a file is all there; one that may yet be filled is given longer."""
        if unchanged_s < self._options.settle_s or not self._watch.whole(path, stamp):
            return False
        if not self._watch.gaps(path, stamp):
            return True
        self._doubted.add(str(path))
        return hasty or unchanged_s >= min(LONGEST_DOUBT_S, self._spec.deadline_s / 2.0)

    def _take(self, path: Path, stamp: Stamp) -> None:
        frame = self._frame(path, stamp)
        for k, former in enumerate(self._frames):
            if former.metadata["path"] == str(path) and self._written_into(former, frame):
                self._frames[k] = replace(frame, arrived_host_ns=former.arrived_host_ns)
                self._doubted.discard(str(path))
                return
        self._frames.append(frame)
        self._counts["frames"] += 1

    def _written_into(self, former: Frame, now: Frame) -> bool:
        """Whether a file that has changed is still the same picture, and not the next by its name.

        Programs add ratings, rights and rotations to files that have come.
        """
        was, now_is = ([f.metadata.get(t) for t in TIME_TAGS] for f in (former, now))
        known, doubted = was[0] is not None, former.metadata["path"] in self._doubted
        if self._spec.shots == 1 and (known or doubted):
            return was == now_is or not known
        alike = doubted and known
        return was == now_is and (alike or same_pixels(former.encoded or b"", now.encoded or b""))

    def _frame(self, path: Path, stamp: Stamp) -> Frame:
        tags = self._watch.tags(path, stamp)
        content = self._watch.content(path, stamp)
        known_as = self._renamed(path, stamp) or self._watch.seen(content)
        known_as = known_as or self._copied(path, stamp, content)
        doubts = {"known_as": known_as} if known_as else {}
        if self._tells_time and "DateTimeOriginal" not in tags:
            doubts["unlikely"] = "it tells no time"
        written_s = stamp.modified_ns / 1e9
        if "DateTimeOriginal" not in tags and written_s < self._armed_at_s - OLD_S:
            at = datetime.fromtimestamp(written_s).astimezone()
            doubts["last_written"] = at.isoformat(" ", "seconds")
        return Frame(
            camera_id=self._info.id,
            arrived_host_ns=time.monotonic_ns(),
            status=FrameStatus.OK,
            encoded=path.read_bytes(),
            media_type=MEDIA_TYPES[path.suffix.lower()],
            exposure_us=exposure_us(tags),
            metadata={
                **tags,
                "file": path.name,
                "path": str(path),
                "sha256": content,
                **doubts,
            },
        )

    def _renamed(self, path: Path, stamp: Stamp) -> str:
        """The name a file had when the camera was armed, empty for one that was not there."""
        for former, known in self._before.items():
            if former == path or former.exists():
                continue
            # Half there then, whole now under another name; or moved as it was.
            if known == stamp or (known is None and self._nodes.get(former) == stamp.node):
                return former.name
        # A half under another name when the camera was armed is of an earlier shot.
        return self._unfinished_then.get(stamp.node, "")

    def _copied(self, path: Path, stamp: Stamp, content: str) -> str:
        """The name of a file of before with the same bytes, empty when there is none."""
        for former, known in self._before.items():
            if known is None or known.size != stamp.size:
                continue
            try:
                if former == path:
                    # Touched, or written again as it was: what it held is only known by glimpse.
                    if self._watch.glimpse(path, known) == self._watch.glimpse(path, stamp):
                        return former.name
                    continue
                if self._watch.content(former, known) == content:
                    return former.name
            except OSError:  # gone since
                continue
        return ""

    def disarm(self) -> None:
        """Look at the folder no more."""
        self._armed = False

    def clock_samples(self, count: int) -> Sequence[ClockSample]:  # noqa: ARG002
        """Files tell no clock finely enough."""
        return ()

    def health(self) -> CameraHealth:
        """Whether the folder is there and how many files are on their way."""
        problem = "it was closed" if self._closed else self._reach.problem()
        there = not problem
        counts = {**self._counts, "unfinished_files": self._unfinished()}
        return CameraHealth(there, self._armed and there, problem, counts)

    def _unfinished(self) -> int:
        return sum(self._known.get(path) != stamp for path, (stamp, _) in self._settling.items())

    def close(self) -> None:
        """Let go of it; the files stay as they are."""
        self._closed, self._armed = True, False


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
        _require_different(self._options)
        self._watch = FolderWatch(root, self._options.suffixes)
        self._open: list[FolderCamera] = []

    def _keys(self) -> Mapping[str, str]:
        if self._options.cameras:
            return self._options.cameras
        root = self._watch.root
        if self._options.by == "folder":
            names = [entry.name for entry in root.iterdir() if entry.is_dir()]
        else:
            files = self._watch.files(root).items()
            tags = [self._watch.tags(p, s) for p, s in files if self._watch.whole(p, s)]
            names = [tag["BodySerialNumber"] for tag in tags if "BodySerialNumber" in tag]
        return {name: name for name in names if not name.startswith(".")}

    def discover(self) -> Sequence[CameraInfo]:
        """Cameras named in the options, else the folders or the serial numbers that are there."""
        return tuple(self._info(name, key) for name, key in sorted(self._keys().items()))

    def _info(self, name: str, key: str) -> CameraInfo:
        root = self._watch.root
        address = root / key if self._options.by == "folder" else root
        return CameraInfo(name, "folder", address=str(address))

    def open(self, camera_id: str) -> FolderCamera:
        """Open one by its name."""
        keys = answered(self._keys, f"the folder {self._watch.root}")
        if camera_id not in keys:
            raise NotFoundError(
                "camera",
                f"there is no camera '{camera_id}' below {self._watch.root}",
                f"make its folder, or name it in 'cameras'; known: {', '.join(keys) or 'none'}",
            )
        key = keys[camera_id]
        info = self._info(camera_id, key)
        camera = answered(
            lambda: FolderCamera(self._watch, self._options, info, key),
            f"the folder {info.address}",
        )
        self._open.append(camera)
        return camera

    def close(self) -> None:
        """Close what is open."""
        for camera in self._open:
            camera.close()
        self._open.clear()
