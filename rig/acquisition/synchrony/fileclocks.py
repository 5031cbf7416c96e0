"""What the times in files say of their cameras' clocks, against the shots they may be of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rig.acquisition.cameras.base import Frame
from rig.acquisition.synchrony.fileexposures import SECOND_NS, FileExposure, Span, file_time

SLACK_NS = SECOND_NS // 2
"""How far the time in a file may be from the start of its exposure beyond its last digit."""
NEAR_NS = 3 * SECOND_NS // 2
"""A clock that was set by the computer's is not farther off."""
AGREED_NS = SLACK_NS // 2
"""Clocks that were set by one, and say so of one shot, are not farther apart: half of what is
forgiven one of them."""
MOST_LEAST = 3
"""So many clocks at least must agree to speak against another."""
ZONE_NS = 1800 * SECOND_NS
WIDEST_ZONE_NS = 14 * 3600 * SECOND_NS
"""A clock that was set to another time zone, or to summer time, is off by whole half hours."""
RIVALS_NS = 2 * 24 * 3600 * SECOND_NS
"""Of two pictures farther apart, only one can be of a clock that was set, in whatever zone."""
DRIFT = 1e-4
"""A camera's clock gains or loses at most this share of the time since it was last compared."""


@dataclass(frozen=True)
class FiredShot:
    """One shot at the computer's wall clock, in ns since 1970."""

    capture_id: str
    shot: int
    at_ns: int


@dataclass(frozen=True)
class Clue:
    """An offset that a held picture would have, were it of the shot it came for."""

    offset: Span
    shot: FiredShot
    at: Span
    """The time that the picture told."""
    stepped: bool = False
    """Whether all pictures before it had come, it was counted next, and its clock was known: it can
    be of no earlier shot."""


@dataclass(frozen=True, eq=False)
class FileDelivery:
    """What came for one camera in one capture, and the shots it may be of.

    ``wait_ns``: how much later than its shot a picture may have been taken, where somebody else
    fires. ``kinds``: media types each shot must bring. ``between``: files that came after
    the capture before and until the camera was armed for this one.
    """

    camera: str
    frames: tuple[Frame, ...]
    shots: tuple[FiredShot, ...]
    first_host_ns: int
    wait_ns: int = 0
    kinds: frozenset[str] = frozenset()
    between: tuple[Frame, ...] = ()


def clock_offset(at: Span, shot: FiredShot, wait_ns: int) -> Span:
    """What the camera's clock is ahead of the computer's, were the picture of this shot."""
    return at.shifted(-shot.at_ns).wider(SLACK_NS + wait_ns, SLACK_NS)


def is_plain(offset: Span) -> bool:
    """Whether a clock so far off is one that was set, if perhaps to another time zone."""
    middle = (offset.low_ns + offset.high_ns) // 2
    half = (offset.high_ns - offset.low_ns) // 2
    away = abs((middle + ZONE_NS // 2) % ZONE_NS - ZONE_NS // 2)
    return abs(middle) <= WIDEST_ZONE_NS + half and away <= max(NEAR_NS, half)


def of_these_days(given: FileDelivery, exposure: FileExposure) -> bool:
    """Whether a clock could be so far off that the picture is of about now."""
    if exposure.time is None:
        return False
    return any(abs(exposure.time.low_ns - shot.at_ns) < RIVALS_NS for shot in given.shots)


def plain_clocks(
    deliveries: Sequence[FileDelivery], known: Mapping[str, Span | None]
) -> dict[str, bool]:
    """Of the cameras whose pictures tell times: whether their clocks look set by the computer's.

    ``known``: offsets as earlier captures showed them.
    """
    told = {}
    for one in deliveries:
        offset = known[one.camera]
        times = [file_time(f.metadata) for f in one.frames if not f.metadata.get("known_as")]
        offsets = [clock_offset(at, s, one.wait_ns) for at in times if at for s in one.shots]
        if offset is not None:
            told[one.camera] = is_plain(offset)
        elif offsets:
            told[one.camera] = any(map(is_plain, offsets))
    return told


def shared_offset(deliveries: Sequence[FileDelivery]) -> Span | None:
    """The offset that the clocks of most cameras have by their pictures of one shot.

    None where no three, or no more than half of those that tell a time, agree.
    """
    told = []
    for one in deliveries:
        times = {file_time(f.metadata) for f in one.frames if not f.metadata.get("known_as")}
        at = times.pop() if len(times) == 1 else None
        if at is not None and len(one.shots) == 1:
            told.append(at.shifted(-one.shots[0].at_ns))
    groups = [[o for o in told if o.wider(AGREED_NS, AGREED_NS).common(one)] for one in told]
    most = max(groups, key=len, default=[])
    if len(most) < MOST_LEAST or 2 * len(most) <= len(told):
        return None
    return Span(min(o.low_ns for o in most), max(o.high_ns for o in most))


def is_alone(at: Span, shot: FiredShot, shared: Span | None) -> bool:
    """Whether a clock would be off what most others share, were the picture of the shot."""
    offset = at.shifted(-shot.at_ns).wider(SLACK_NS, SLACK_NS)
    return shared is not None and offset.common(shared) is None


def alone_words(at: Span, shot: FiredShot) -> str:
    """Why a picture is held whose clock would be the only one that is off, and what to do."""
    off_s = (at.low_ns + at.high_ns) / 2e9 - shot.at_ns / 1e9
    return (
        f"its time is {off_s:+.1f} s off the shot, and the other cameras' agree: another picture, "
        "or a clock that is off; set the camera's clock, or take one more capture in this session"
    )


def off_words(at: Span, shot: FiredShot, known: Span | None, fits: bool) -> str:
    """Why a picture is held whose time does not show it to be of the shot, and what to do.

    ``fits``: it would, had not an earlier picture failed to come.
    """
    if fits:
        why = (
            "its time fits the shot, but an earlier picture has not come: it may be that one, by a "
            "clock that is off"
        )
    else:
        clock = "a clock that is not set" if known is None else "a clock that was set meanwhile"
        off = _seconds(at.shifted(-shot.at_ns))
        was = "" if known is None else f", and its clock was {_seconds(known)} off until now"
        why = f"its time is {off} off the shot{was}: another shot's picture, or {clock}"
    return f"{why}; set the camera's clock, or take one more capture in this session"


def _seconds(span: Span) -> str:
    middle_s = (span.low_ns + span.high_ns) / 2e9
    return f"{middle_s:+.0f} s" if abs(middle_s) >= 1.0 else "less than 1 s"


def late_words(capture_id: str) -> str:
    """Why a file is held that came when its capture had been written, and what to do."""
    return (
        f"it came after capture {capture_id} had been written; name the kinds of files in 'files' "
        "of the camera, or give a longer 'frame_deadline_s', to have it waited for"
    )
