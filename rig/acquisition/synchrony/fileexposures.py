"""Which files are of one exposure: those of one name, one moment and one body."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import PurePath

from rig.acquisition.cameras.base import Frame
from rig.acquisition.synchrony.filenumbers import file_numbers
from rig.acquisition.synchrony.imagechecks import is_raw

SECOND_NS = 1_000_000_000


@dataclass(frozen=True)
class Span:
    """An interval of nanoseconds, both ends included."""

    low_ns: int
    high_ns: int

    def shifted(self, by_ns: int) -> Span:
        """The same, later by so much."""
        return Span(self.low_ns + by_ns, self.high_ns + by_ns)

    def wider(self, below_ns: int, above_ns: int) -> Span:
        """The same with both ends moved out."""
        return Span(self.low_ns - below_ns, self.high_ns + above_ns)

    def common(self, other: Span) -> Span | None:
        """What two intervals have in common."""
        low, high = max(self.low_ns, other.low_ns), min(self.high_ns, other.high_ns)
        return Span(low, high) if low <= high else None


def file_time(tags: Mapping[str, str]) -> Span | None:
    """When a file says its picture was taken, in ns since 1970 by its camera's clock.

    Times without a zone are taken to be of the computer's. As wide as the last digit; None where
    the file does not say.
    """
    try:
        at = datetime.strptime(tags.get("DateTimeOriginal", ""), "%Y:%m:%d %H:%M:%S")
        zone = tags.get("OffsetTimeOriginal", "").strip()
        if re.fullmatch(r"[+-]\d\d:\d\d", zone):
            at = at.replace(tzinfo=datetime.strptime(zone, "%z").tzinfo)
        seconds = round(at.astimezone().timestamp())
    except (ValueError, OverflowError, OSError):
        return None
    digits = tags.get("SubSecTimeOriginal", "").strip()
    if not re.fullmatch(r"\d{1,9}", digits):
        return Span(seconds * SECOND_NS, (seconds + 1) * SECOND_NS)
    step = SECOND_NS // 10 ** len(digits)
    low = seconds * SECOND_NS + int(digits) * step
    return Span(low, low + step)


@dataclass(frozen=True, eq=False)
class FileExposure:
    """The files of one exposure: those of one name without its ending."""

    frames: tuple[Frame, ...]
    time: Span | None

    @property
    def name(self) -> str:
        """The file by which it is named."""
        return self.frames[0].metadata.get("file", "a file")


def file_exposures(frames: Sequence[Frame], shots: int) -> tuple[list[FileExposure], list[Frame]]:
    """Files by exposure, in order of their times, numbers and arrival; and the spare ones.

    Spare are smaller files of a kind that an exposure has already (a second card's, a thumbnail),
    where only one of ``shots`` can be meant. Files of one name that tell different times or bodies
    are of different exposures.
    """
    groups: dict[str, list[Frame]] = {}
    for number, frame in enumerate(frames):
        stem = PurePath(frame.metadata.get("file", str(number))).stem.casefold()
        groups.setdefault(stem, []).append(frame)
    exposures, spare = list[FileExposure](), list[Frame]()
    for group in groups.values():
        for together in _moments(group):
            made, more = _kinds(together, shots)
            exposures += made
            spare += more

    def order(e: FileExposure) -> tuple[int, tuple[int, ...], int]:
        at = 0 if e.time is None else e.time.low_ns
        return at, file_numbers(e.name), e.frames[0].arrived_host_ns

    return sorted(exposures, key=order), spare


def _moments(group: Sequence[Frame]) -> list[list[Frame]]:
    """Files of one name, by what they say of their moment and body."""
    moments: list[list[Frame]] = []
    silent = []
    for frame in group:
        at, body = file_time(frame.metadata), _body(frame)
        if at is None:
            silent.append(frame)
            continue
        for moment in moments:
            then = file_time(moment[0].metadata)
            other = _body(moment[0])
            if then is not None and _at_once(at, then) and not (body and other and body != other):
                moment.append(frame)
                break
        else:
            moments.append([frame])
    # Which of several moments a file without a time is of cannot be told.
    if len(moments) == 1:
        moments[0] += silent
    elif silent:
        moments.append(silent)
    return moments


def _at_once(one: Span, other: Span) -> bool:
    """Whether two told times can be one: one second ends where the next begins."""
    common = one.common(other)
    return common is not None and common.low_ns < common.high_ns


def _body(frame: Frame) -> str:
    return frame.metadata.get("BodySerialNumber", "")


def _kinds(together: Sequence[Frame], shots: int) -> tuple[list[FileExposure], list[Frame]]:
    """Exposures with one file of each kind, and files that are left over."""
    by_size = sorted(
        together, key=lambda f: (file_time(f.metadata) is None, -len(f.encoded or b""))
    )
    first: dict[str, Frame] = {}
    more = [f for f in by_size if first.setdefault(f.media_type, f) is not f]
    ordered = tuple(sorted(first.values(), key=is_raw))
    times = [at for frame in ordered if (at := file_time(frame.metadata)) is not None]
    made = [FileExposure(ordered, times[0] if times else None)]
    if times and shots == 1:
        return made, more
    return [*made, *(FileExposure((f,), file_time(f.metadata)) for f in more)], []
