"""Which shot a picture file is of, where nothing but the file itself can tell.

Programs that fetch pictures deliver late, rename, copy and double. What speaks for a file: the
time in its EXIF against the shot, by the offset of its camera's clock as earlier captures showed
it; its content against all that was seen; the body it names; its number. A file that cannot be
shown to belong is held back and named: it stays where its program put it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from rig.acquisition.cameras.base import Frame
from rig.acquisition.synchrony.cameraframes import Method, Pair, Pairing
from rig.acquisition.synchrony.faults import Fault, FaultKind
from rig.acquisition.synchrony.fileexposures import (
    SECOND_NS,
    FileExposure,
    Span,
    file_exposures,
)
from rig.acquisition.synchrony.filenumbers import FileNumbers

SLACK_NS = SECOND_NS // 2
"""How far the time in a file may be from the start of its exposure beyond its last digit."""
NEAR_NS = 3 * SECOND_NS // 2
"""A clock that was set by the computer's is not farther off."""
ZONE_NS = 1800 * SECOND_NS
WIDEST_ZONE_NS = 14 * 3600 * SECOND_NS
"""A clock that was set to another time zone, or to summer time, is off by whole half hours."""
RIVALS_NS = 2 * 24 * 3600 * SECOND_NS
"""Of two pictures farther apart, only one can be of a clock that was set, in whatever zone."""
DRIFT = 1e-4
"""A camera's clock gains or loses at most this share of the time since it was last compared."""
REMEMBERED = 500
"""Shots against which a late picture is held."""


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
    stepped: bool = False
    """Whether all pictures before it had come, it was counted next, and its clock was known: it can
    be of no earlier shot."""


@dataclass
class CameraFiles:
    """What is remembered of one camera. ``outstanding``: shots whose pictures have not come."""

    offset: Span | None = None
    known_at_ns: int = 0
    clues: list[Clue] = field(default_factory=list)
    outstanding: int = 0
    tells_now: bool = False
    """Whether files of the capture that is being sorted tell their times."""
    serial: str = ""
    numbers: FileNumbers = field(default_factory=FileNumbers)


@dataclass(frozen=True, eq=False)
class FileDelivery:
    """What came for one camera in one capture, and the shots it may be of.

    ``wait_ns``: how much later than its shot a picture may have been taken, where somebody else
    fires. ``kinds``: media types each shot must bring.
    """

    camera: str
    frames: tuple[Frame, ...]
    shots: tuple[FiredShot, ...]
    first_host_ns: int
    wait_ns: int = 0
    kinds: frozenset[str] = frozenset()


class FileEvidence:
    """Gives files to shots, and learns from those that are certain. Used by one thread."""

    def __init__(self) -> None:
        self._cameras: dict[str, CameraFiles] = {}
        self._shots: list[FiredShot] = []
        self._seen: dict[str, str] = {}

    @property
    def begun(self) -> bool:
        """Whether anything was sorted or recalled yet."""
        return bool(self._shots)

    def recall(self, past: Sequence[tuple[FileDelivery, Sequence[Pair]]]) -> None:
        """Learn from a capture that was sorted before: what was not filed, and what was."""
        for given, filed in past:
            memory, found = self._of(given.camera), dict[int, tuple[FileExposure, Method]]()
            for shot in {pair.shot for pair in filed}:
                pairs = [pair for pair in filed if pair.shot == shot]
                (exposure, *_), _ = file_exposures([pair.frame for pair in pairs], 1)
                found[shot] = (exposure, pairs[0].method)
            contents = {pair.frame.metadata.get("sha256", "") for pair in filed}
            left = [f for f in given.frames if f.metadata.get("sha256", "") not in contents]
            mine = _own(given, memory.serial, {}, self._seen, [])
            exposures, _ = file_exposures([f for f in mine if f in left], len(given.shots))
            memory.tells_now = any(e.time is not None for e in exposures)
            for exposure in exposures:
                self._fits(given, memory, exposure, False, [])
            self._learn(given, memory, found)
            self._see((*given.frames, *(pair.frame for pair in filed)))
        for given, _ in past[:1]:
            self._shots += given.shots
        del self._shots[:-REMEMBERED]

    def _see(self, frames: Sequence[Frame]) -> None:
        for frame in frames:
            tags = frame.metadata
            if tags.get("sha256"):
                self._seen.setdefault(tags["sha256"], tags.get("file", "a file"))

    def sort(self, deliveries: Sequence[FileDelivery]) -> dict[str, tuple[Pairing, Pairing | None]]:
        """The pictures of each camera, and the raw files beside them."""
        owners = _owners(deliveries, {d.camera: self._of(d.camera).serial for d in deliveries})
        done = {one.camera: self._sorted(one, owners) for one in deliveries}
        for one in deliveries[:1]:
            self._shots += one.shots
        for one in deliveries:
            self._see(one.frames)
        del self._shots[:-REMEMBERED]
        return done

    def _of(self, camera: str) -> CameraFiles:
        return self._cameras.setdefault(camera, CameraFiles())

    def _sorted(
        self, given: FileDelivery, owners: Mapping[str, frozenset[str]]
    ) -> tuple[Pairing, Pairing | None]:
        memory, faults = self._of(given.camera), list[Fault]()
        frames = _own(given, memory.serial, owners, self._seen, faults)
        exposures, spare = file_exposures(frames, len(given.shots))
        for frame in spare:
            why = "a larger file of the same exposure is kept"
            _hold(given, FileExposure((frame,), None), why, faults)
        found: dict[int, tuple[FileExposure, Method]] = {}
        lone = sum(_of_these_days(given, e) for e in exposures) <= len(given.shots)
        memory.tells_now = any(e.time is not None for e in exposures)
        fits = [(e, self._fits(given, memory, e, lone, faults)) for e in exposures]
        usable = [(e, shots) for e, shots in fits if shots]
        if len(usable) == len(given.shots) and _in_order(given, usable):
            for shot, (exposure, _) in zip(given.shots, usable, strict=True):
                found[shot.shot] = (exposure, _method(exposure))
        else:
            for exposure, shots in usable:
                rivals = [e for e, other in usable if e is not exposure and set(other) & set(shots)]
                if len(shots) == 1 and not rivals and exposure.time is not None:
                    found[shots[0].shot] = (exposure, Method.FILE_TIME)
                else:
                    _hold(given, exposure, "which shot it is of cannot be told", faults)
        self._learn(given, memory, found)
        return _pairings(given, found, faults)

    def _fits(
        self,
        given: FileDelivery,
        memory: CameraFiles,
        exposure: FileExposure,
        lone: bool,
        faults: list[Fault],
    ) -> list[FiredShot]:
        """The shots of this capture that a file may be of; none when it is held back."""
        if exposure.time is None and (memory.offset is not None or memory.tells_now):
            why = "it tells no time, and its camera's pictures do: a thumbnail, or another's file"
            remedy = "let it write them, or begin a new session with the station opened anew"
            _hold(given, exposure, f"{why}; {remedy}", faults)
            return []
        if exposure.time is None:
            return _untimed(given, memory, exposure, faults)
        if memory.offset is None:
            return self._first(given, memory, exposure, exposure.time, lone, faults)
        age_ns = max(0, given.shots[0].at_ns - memory.known_at_ns)
        drift_ns = round(DRIFT * age_ns)
        offset = memory.offset.wider(drift_ns, drift_ns)
        mine = [s for s in given.shots if _offset(exposure.time, s, given.wait_ns).common(offset)]
        others = [s for s in self._shots if _offset(exposure.time, s, given.wait_ns).common(offset)]
        if mine and (not others or not memory.outstanding):
            return mine
        if mine:
            why = f"it may be of capture {others[-1].capture_id} as well"
        elif others:
            why = f"it is of capture {others[-1].capture_id}, and came late"
            memory.outstanding = max(0, memory.outstanding - 1)
        else:
            return self._first(given, memory, exposure, exposure.time, lone, faults)
        _hold(given, exposure, why, faults)
        return []

    def _first(
        self,
        given: FileDelivery,
        memory: CameraFiles,
        exposure: FileExposure,
        at: Span,
        lone: bool,
        faults: list[Fault],
    ) -> list[FiredShot]:
        """The same for a camera whose clock's offset is not known, or not the one it was.

        ``lone``: no more exposures of these days came than were asked for, so that each may be
        its shot's.
        """
        offsets = {shot: _offset(at, shot, given.wait_ns) for shot in given.shots}
        ahead = memory.numbers.ahead(exposure.name)
        in_turn = len(given.shots) == 1 and ahead is not None and ahead == memory.outstanding + 1
        agreed = [s for s, offset in offsets.items() if self._agrees(memory, s, offset, in_turn)]
        plain = memory.offset is None and not memory.outstanding and lone
        near = [s for s, offset in offsets.items() if plain and _is_plain(offset)]
        if agreed or near:
            return agreed or near
        shot, offset = next(iter(offsets.items()))
        seconds = (offset.low_ns + offset.high_ns) / 2e9
        stepped = in_turn and memory.offset is not None and not memory.outstanding
        memory.clues = [*memory.clues[-3:], Clue(offset, shot, stepped)]
        _hold(
            given,
            exposure,
            f"its time is {seconds:+.0f} s off the shot: another shot's picture, or a clock that "
            "is not set; set the camera's clock, or take one more capture in this session",
            faults,
        )
        return []

    def _agrees(self, memory: CameraFiles, shot: FiredShot, offset: Span, in_turn: bool) -> bool:
        """Whether an earlier picture was off by just as much, and not only as one come late.

        ``in_turn``: by its number, one picture was made for each shot since the last that was
        believed.
        """
        for clue in memory.clues:
            if clue.shot.capture_id == shot.capture_id or offset.common(clue.offset) is None:
                continue
            stepped = clue.stepped and in_turn
            if stepped or not self._shifted(shot, offset, clue) or _is_plain(offset):
                return not self._came_late(memory, shot, offset)
        return False

    def _came_late(self, memory: CameraFiles, shot: FiredShot, offset: Span) -> bool:
        """Whether held pictures have a later clock, by which this one is of an earlier shot."""
        earlier = [known for known in self._shots if known.at_ns < shot.at_ns - SLACK_NS]
        late = [offset.shifted(shot.at_ns - known.at_ns) for known in earlier]
        return any(one.common(clue.offset) for one in late for clue in memory.clues)

    def _shifted(self, shot: FiredShot, offset: Span, clue: Clue) -> bool:
        """Whether both could be of the shot before theirs: a camera that lags behind by one."""
        now, then = self._before(shot), self._before(clue.shot)
        if now is None or then is None:
            return False
        late = offset.shifted(shot.at_ns - now.at_ns)
        return late.common(clue.offset.shifted(clue.shot.at_ns - then.at_ns)) is not None

    def _before(self, shot: FiredShot) -> FiredShot | None:
        earlier = [known for known in self._shots if known.at_ns < shot.at_ns - SLACK_NS]
        return earlier[-1] if earlier else None

    def _learn(
        self,
        given: FileDelivery,
        memory: CameraFiles,
        found: Mapping[int, tuple[FileExposure, Method]],
    ) -> None:
        by_number = {shot.shot: shot for shot in given.shots}
        for number, (exposure, method) in found.items():
            shot = by_number[number]
            if method is Method.FILE_TIME and exposure.time is not None:
                offset = _offset(exposure.time, shot, given.wait_ns)
                sharper = None if memory.offset is None else memory.offset.common(offset)
                memory.offset, memory.known_at_ns = sharper or offset, shot.at_ns
                memory.clues.clear()
            tags = exposure.frames[0].metadata
            memory.serial = memory.serial or tags.get("BodySerialNumber", "")
        # A picture whose number was believed settles which of those before it are lost.
        if any(method is Method.ARRIVAL for _, method in found.values()):
            memory.outstanding = 0
        memory.outstanding += len(given.shots) - len(found)
        memory.numbers.capture_ends([found[k][0].name for k in sorted(found)])


def _offset(at: Span, shot: FiredShot, wait_ns: int) -> Span:
    """What the camera's clock is ahead of the computer's, were the picture of this shot."""
    return at.shifted(-shot.at_ns).wider(SLACK_NS + wait_ns, SLACK_NS)


def _is_plain(offset: Span) -> bool:
    """Whether a clock so far off is one that was set, if perhaps to another time zone."""
    middle = (offset.low_ns + offset.high_ns) // 2
    half = (offset.high_ns - offset.low_ns) // 2
    away = abs((middle + ZONE_NS // 2) % ZONE_NS - ZONE_NS // 2)
    return abs(middle) <= WIDEST_ZONE_NS + half and away <= max(NEAR_NS, half)


def _of_these_days(given: FileDelivery, exposure: FileExposure) -> bool:
    """Whether a clock could be so far off that the picture is of about now."""
    if exposure.time is None:
        return False
    return any(abs(exposure.time.low_ns - shot.at_ns) < RIVALS_NS for shot in given.shots)


def _untimed(
    given: FileDelivery, memory: CameraFiles, exposure: FileExposure, faults: list[Fault]
) -> list[FiredShot]:
    """The shots that a file without a time may be of: its number must tell, or nothing lacks."""
    name, shots = exposure.name, given.shots
    ahead = memory.numbers.ahead(name)
    if ahead is not None and ahead <= 0:
        # What the capture before lacks is then the picture that was held back.
        explained = memory.outstanding <= (len(shots) if memory.numbers.may_begin_anew else 0)
        if memory.numbers.begins_anew(name, len(shots)) and explained:
            return list(shots)
        why = "its number is not above those of before; if the count began anew, take one more"
        _hold(given, exposure, f"{why} capture", faults)
        return []
    if not memory.outstanding:
        return list(shots)
    place = 0 if ahead is None else ahead - memory.outstanding
    if 1 <= place <= len(shots):
        return [shots[place - 1]]
    why = "it tells no time, and an earlier picture has not come: which it is cannot be told"
    _hold(
        given,
        exposure,
        f"{why}; let the camera write times, or begin a new session, with the station opened anew, "
        "when none is on its way",
        faults,
    )
    return []


def _method(exposure: FileExposure) -> Method:
    return Method.ARRIVAL if exposure.time is None else Method.FILE_TIME


def _in_order(
    given: FileDelivery, usable: Sequence[tuple[FileExposure, Sequence[FiredShot]]]
) -> bool:
    return all(shot in shots for shot, (_, shots) in zip(given.shots, usable, strict=True))


def _hold(given: FileDelivery, exposure: FileExposure, why: str, faults: list[Fault]) -> None:
    names = ", ".join(frame.metadata.get("file", "a file") for frame in exposure.frames)
    text = f"{given.camera}: {names} is held back: {why}"
    faults.append(Fault(FaultKind.HELD_BACK, text, given.camera))


def _owners(
    deliveries: Sequence[FileDelivery], serials: Mapping[str, str]
) -> dict[str, frozenset[str]]:
    """The cameras that a content came for, where it came for several: those it may be of."""
    came: dict[str, dict[str, Frame]] = {}
    for one in deliveries:
        for frame in one.frames:
            came.setdefault(frame.metadata.get("sha256", ""), {})[one.camera] = frame
    owners = {}
    for content, frames in came.items():
        if content and len(frames) > 1:
            body = next(iter(frames.values())).metadata.get("BodySerialNumber", "")
            named = frozenset(name for name in frames if body and serials[name] == body)
            owners[content] = named if len(named) == 1 else frozenset()
    return owners


def _own(
    given: FileDelivery,
    serial: str,
    owners: Mapping[str, frozenset[str]],
    seen: Mapping[str, str],
    faults: list[Fault],
) -> list[Frame]:
    """The frames without copies, and without what is of another body or from before the shot.

    ``serial``: the camera's body, empty when it is not known; ``seen``: files of earlier captures
    by their content.
    """
    own: dict[str, Frame] = {}
    for number, frame in enumerate(given.frames):
        tags, lone = frame.metadata, FileExposure((frame,), None)
        content = tags.get("sha256", str(number))
        body = tags.get("BodySerialNumber", "")
        if content in own:
            text = f"{given.camera}: {lone.name} is the same file once more; it is kept once"
            faults.append(Fault(FaultKind.DUPLICATE, text, given.camera))
        elif tags.get("known_as") or content in seen:
            _hold(given, lone, f"it is {tags.get('known_as') or seen[content]} once more", faults)
        elif tags.get("last_written"):
            why = f"it tells no time, and was last written {tags['last_written']}: an old file"
            _hold(given, lone, f"{why}; let the camera write times", faults)
        elif content in owners and given.camera not in owners[content]:
            _hold(given, lone, "the same file came for another camera", faults)
        elif body and serial and body != serial:
            _hold(given, lone, f"it is of the body {body}, not of {serial}", faults)
        elif frame.arrived_host_ns < given.first_host_ns:
            text = f"{given.camera}: a picture that came before the first shot is left out"
            faults.append(Fault(FaultKind.EXTRA_AT_START, text, given.camera))
        else:
            own[content] = frame
    return list(own.values())


def _pairings(
    given: FileDelivery,
    found: Mapping[int, tuple[FileExposure, Method]],
    faults: list[Fault],
) -> tuple[Pairing, Pairing | None]:
    pairs, beside = [], []
    for shot in given.shots:
        if shot.shot not in found:
            text = f"{given.camera}: no picture of shot {shot.shot}"
            faults.append(Fault(FaultKind.MISSING, text, given.camera, shot.shot))
            continue
        exposure, method = found[shot.shot]
        first, *others = (Pair(shot.shot, frame, method) for frame in exposure.frames)
        pairs.append(first)
        beside += others
        for kind in sorted(given.kinds - {frame.media_type for frame in exposure.frames}):
            text = f"{given.camera}: shot {shot.shot} brought no file of the kind {kind}"
            faults.append(Fault(FaultKind.FILE_MISSING, text, given.camera, shot.shot))
    raws = Pairing(given.camera, tuple(beside), ()) if beside else None
    return Pairing(given.camera, tuple(pairs), tuple(faults)), raws
