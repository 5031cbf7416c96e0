"""One camera whose files another program fetches into a folder.

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

from common.errors import DeviceError, InputError
from common.words import as_text
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
from rig.acquisition.cameras.foldernotes import in_words, kinds_of_one, newest, why_no_picture
from rig.acquisition.cameras.folderoptions import FolderOptions, below
from rig.acquisition.cameras.folderpast import FolderPast
from rig.acquisition.cameras.folderwatch import FolderWatch, Stamp, is_apart
from rig.acquisition.cameras.reach import FolderReach, patiently
from rig.acquisition.cameras.wholeness import MEDIA_TYPES
from rig.acquisition.imaging import same_pixels

POLL_S = 0.03
OLD_S = 60.0
"""A file last written so long before the camera was armed is of before; clocks of shares differ."""
RECENT_S = 600.0
"""A file of before the camera was first armed, and younger than that, may be of a capture that a
program of before took."""
MOST_BETWEEN = 100
"""More files than that are no late pictures of one capture."""
LONGEST_DOUBT_S = 3.0
"""How long a file with empty sectors must not have changed; less where the deadline is shorter."""


class FolderCamera:
    """One camera whose files arrive in a folder; a :class:`CameraDevice`."""

    def __init__(
        self,
        watch: FolderWatch,
        options: FolderOptions,
        info: CameraInfo,
        key: str,
        past: FolderPast | None = None,
    ) -> None:
        """``past``: what was known of the folder when this camera was open before."""
        self._watch, self._options, self._info, self._key = watch, options, info, key
        self._below = below(watch.root, options, key)
        self._reach = FolderReach(self._below)
        self._past = past or FolderPast(watch, self._below)
        self._settling: dict[Path, tuple[Stamp, float]] = {}
        self._doubted: set[str] = set()
        self._frames: list[Frame] = []
        self._between: list[Frame] = []
        self._kinds: frozenset[str] = frozenset()
        self._armed = False
        self._closed = False
        self._tells_time = False
        self._spec, self._armed_at_s = ArmSpec("", 1, 0.0), 0.0
        self._counts: Counter[str] = Counter()
        self._past.keep(self._look())

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
            return patiently(self._past.look)
        except OSError as error:
            raise self._gone(error) from None

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
        mine = [one for one in newest(present) if self._is_mine(*one)]
        came = [o for o in mine if self._past.is_new(*o) and as_text(o[0]) not in fetched]
        self._counts["stale_frames"] += len(came)
        if not self._armed_at_s:
            came = [o for o in mine if o[1].modified_ns / 1e9 > time.time() - RECENT_S]
        told = reversed(came[:MOST_BETWEEN])
        self._between = [self._late(*one, seen_come=bool(self._armed_at_s)) for one in told]
        self._kinds = kinds_of_one(mine)
        self._tells_time = self._told_time(mine)
        self._spec, self._armed_at_s = spec, time.time()
        self._past.keep(present)
        self._frames, self._armed = [], True
        self._settling.clear()
        self._doubted.clear()

    def _late(self, path: Path, stamp: Stamp, *, seen_come: bool) -> Frame:
        """A file of before the camera was armed, without its content.

        Of one that was not seen to come only the time of writing tells since when it is there.
        """
        written = {} if seen_come else {"written_ns": str(stamp.modified_ns)}
        return Frame(
            camera_id=self._info.id,
            arrived_host_ns=time.monotonic_ns(),
            status=FrameStatus.OK,
            encoded=b"",
            media_type=MEDIA_TYPES[path.suffix.lower()],
            metadata={
                **self._tags(path, stamp),
                "file": as_text(path.name),
                "path": as_text(path),
                **written,
            },
        )

    def _tags(self, path: Path, stamp: Stamp) -> Mapping[str, str]:
        """The EXIF of a file, empty when it is gone."""
        try:
            return self._watch.tags(path, stamp)
        except OSError:
            return {}

    def _told_time(self, mine: Sequence[tuple[Path, Stamp]]) -> bool:
        """Whether the pictures of before tell their times: those taken, else the newest there."""
        if self._frames:
            return any("DateTimeOriginal" in frame.metadata for frame in self._frames)
        if self._tells_time:
            return True
        return any("DateTimeOriginal" in self._tags(*one) for one in mine[:1])

    def _is_mine(self, path: Path, stamp: Stamp) -> bool:
        if self._options.by == "folder":
            return True
        return self._tags(path, stamp).get("BodySerialNumber") == self._key

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
            # A share that went may be mounted again; health and the next arm say where it is not.
            with suppress(OSError):
                self._collect(hasty=timeout_s <= 0.0)
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
            if not self._past.is_new(path, stamp):
                continue
            seen, since = self._settling.get(path, (None, now))
            if seen != stamp:
                self._settling[path] = (stamp, now)
                since = now
            if self._is_steady(path, stamp, now - since, hasty=hasty):
                if self._is_mine(path, stamp):
                    self._take(path, stamp)
                # Not before: of a share that went meanwhile it would be lost.
                self._past.take(path, stamp)

    def _is_steady(self, path: Path, stamp: Stamp, unchanged_s: float, *, hasty: bool) -> bool:
        """Whether a file is all there; one that may yet be filled is given longer."""
        if unchanged_s < self._options.settle_s or not self._watch.whole(path, stamp):
            return False
        if not self._watch.gaps(path, stamp):
            return True
        self._doubted.add(as_text(path))
        return hasty or unchanged_s >= min(LONGEST_DOUBT_S, self._spec.deadline_s / 2.0)

    def _take(self, path: Path, stamp: Stamp) -> None:
        frame = self._frame(path, stamp)
        for k, former in enumerate(self._frames):
            if former.metadata["path"] == as_text(path) and self._written_into(former, frame):
                self._frames[k] = replace(frame, arrived_host_ns=former.arrived_host_ns)
                self._doubted.discard(as_text(path))
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
        known_as = self._past.renamed(path, stamp) or self._watch.seen(content)
        known_as = known_as or self._past.copied(path, stamp, content)
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
                "file": as_text(path.name),
                "path": as_text(path),
                "sha256": content,
                **doubts,
            },
        )

    def between(self) -> Sequence[Frame]:
        """Files that came since the capture before and until this one was armed."""
        return tuple(self._between)

    def kinds(self) -> frozenset[str]:
        """Media types that the newest exposure of before brought."""
        return self._kinds

    def unread(self) -> str:
        """What came since :meth:`arm` and cannot be filed, by name and with the reason."""
        try:
            return in_words(self._unread())
        except OSError:  # the folder went; health says so
            return ""

    def _unread(self) -> dict[Path, str]:
        reasons = {}
        for path, (stamp, _) in self._settling.items():
            if not self._past.taken(path, stamp):
                reasons[path] = why_no_picture(path, stamp)
            elif self._options.by == "serial" and not self._is_mine(path, stamp):
                body = self._tags(path, stamp).get("BodySerialNumber")
                if body is None or body not in (self._options.cameras or {body: ""}).values():
                    reasons[path] = f"of body {body}" if body else "it names no body"
        for path in self._past.others():
            if not path.name.startswith(".") and not is_apart(path, self._below):
                reasons[path] = why_no_picture(path)
        return reasons

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
        return sum(not self._past.taken(path, stamp) for path, (stamp, _) in self._settling.items())

    def close(self) -> None:
        """Let go of it; the files stay as they are."""
        self._closed, self._armed = True, False
