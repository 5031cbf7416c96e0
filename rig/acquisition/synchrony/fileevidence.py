"""Which shot a picture file is of, where nothing but the file itself can tell.

Programs that fetch pictures deliver late, rename, copy and double. What speaks for a file: the
time in its EXIF against the shot, by the offset of its camera's clock as earlier captures showed
it; its content against all that was seen; the body it names; its number. A file that cannot be
shown to belong is held back and named: it stays where its program put it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import PurePath

from rig.acquisition.cameras.base import Frame
from rig.acquisition.synchrony.cameraframes import Method, Pair, Pairing
from rig.acquisition.synchrony.faults import Fault
from rig.acquisition.synchrony.fileclocks import (
    DRIFT,
    SLACK_NS,
    Clue,
    FileDelivery,
    FiredShot,
    alone_words,
    clock_offset,
    is_alone,
    is_plain,
    late_words,
    of_these_days,
    off_words,
    plain_clocks,
    shared_offset,
)
from rig.acquisition.synchrony.fileexposures import FileExposure, Span, file_exposures, file_time
from rig.acquisition.synchrony.filenumbers import FileNumbers
from rig.acquisition.synchrony.fileoutlook import FileOutlook
from rig.acquisition.synchrony.heldfiles import hold, own_frames, owners_of, pairings
from rig.acquisition.synchrony.sharedtimes import SharedTimes

REMEMBERED = 500
"""Shots against which a late picture is held."""

WRITTEN_SLACK_NS = 2_000_000_000
"""Disks of cameras (FAT) tell when a file was written in steps of two seconds."""


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
    filed_in: str = ""
    """The last capture of which it has a picture; ``filed``: the files of that."""
    filed: tuple[str, ...] = ()


class FileEvidence:
    """Gives files to shots, and learns from those that are certain. Used by one thread."""

    def __init__(self) -> None:
        self._cameras: dict[str, CameraFiles] = {}
        self._shots: list[FiredShot] = []
        self._seen: dict[str, str] = {}
        self._times = SharedTimes()
        self._plain: dict[str, bool] = {}
        self._shared: Span | None = None
        self._filed: set[tuple[str, str, str]] = set()

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
            mine = own_frames(given, memory.serial, {}, self._seen, [])
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

    def outlook(self, camera: str, wait_ns: int, now_ns: int) -> FileOutlook:
        """What is known of a camera's files, for one that waits for the next of them.

        ``now_ns``: since 1970.
        """
        memory = self._of(camera)
        offset = memory.offset and self._by_now(memory, memory.offset, now_ns)
        return FileOutlook(offset, memory.outstanding, frozenset(self._seen), wait_ns)

    def sort(self, deliveries: Sequence[FileDelivery]) -> dict[str, tuple[Pairing, Pairing | None]]:
        """The pictures of each camera, and the raw files beside them."""
        owners = owners_of(deliveries, {d.camera: self._of(d.camera).serial for d in deliveries})
        known = {d.camera: self._of(d.camera).offset for d in deliveries}
        self._plain = plain_clocks(deliveries, known)
        self._shared = shared_offset(deliveries)
        self._times.begin(deliveries)
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
        self._came_between(given, memory, faults)
        frames = own_frames(given, memory.serial, owners, self._seen, faults)
        exposures, spare = file_exposures(frames, len(given.shots))
        for frame in spare:
            why = "a larger file of the same exposure is kept"
            hold(given, FileExposure((frame,), None), why, faults)
        found: dict[int, tuple[FileExposure, Method]] = {}
        lone = sum(of_these_days(given, e) for e in exposures) <= len(given.shots)
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
                    hold(given, exposure, "which shot it is of cannot be told", faults)
        self._learn(given, memory, found)
        return pairings(given, found, faults)

    def _came_between(self, given: FileDelivery, memory: CameraFiles, faults: list[Fault]) -> None:
        """Tell of files that a capture would have had, had they come in time."""
        stems = {PurePath(name).stem.casefold() for name in memory.filed}
        for frame in given.between:
            exposure = FileExposure((frame,), file_time(frame.metadata))
            if not self._shots or self._is_known(frame, memory):
                continue
            if PurePath(exposure.name).stem.casefold() in stems:
                hold(given, exposure, late_words(memory.filed_in), faults)
            elif memory.outstanding:
                self._came_too_late(given, memory, exposure, faults)

    def _is_known(self, frame: Frame, memory: CameraFiles) -> bool:
        """Whether a file had its place already, or lay there before the last capture was fired."""
        tags = frame.metadata
        if tags.get("path", "") in memory.filed or _place(frame) in self._filed:
            return True
        written_ns = int(tags.get("written_ns", self._shots[-1].at_ns))
        return written_ns < self._shots[-1].at_ns - WRITTEN_SLACK_NS

    def _came_too_late(
        self, given: FileDelivery, memory: CameraFiles, exposure: FileExposure, faults: list[Fault]
    ) -> None:
        """The same where a picture lacks: what the late one tells is learned."""
        last, at = self._shots[-1], exposure.time
        if at is None or memory.offset is None:
            if at is not None:
                offset = clock_offset(at, last, given.wait_ns)
                memory.clues = [*memory.clues[-3:], Clue(offset, last, at)]
            hold(given, exposure, late_words(last.capture_id), faults)
            return
        offset = self._now(given, memory, memory.offset)
        of = [s for s in self._shots if clock_offset(at, s, given.wait_ns).common(offset)]
        lacking = [s for s in of if not self._times.has(given.camera, s.capture_id)]
        if lacking:
            memory.outstanding -= 1
            hold(given, exposure, late_words(lacking[-1].capture_id), faults)

    def _now(self, given: FileDelivery, memory: CameraFiles, offset: Span) -> Span:
        """An offset that was learned, as it may be by now."""
        return self._by_now(memory, offset, given.shots[0].at_ns)

    def _by_now(self, memory: CameraFiles, offset: Span, now_ns: int) -> Span:
        drift_ns = round(DRIFT * max(0, now_ns - memory.known_at_ns))
        return offset.wider(drift_ns, drift_ns)

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
            hold(given, exposure, f"{why}; {remedy}", faults)
            return []
        if exposure.time is None:
            return _untimed(given, memory, exposure, faults)
        if memory.offset is None:
            return self._first(given, memory, exposure, exposure.time, lone, faults)
        at, offset = exposure.time, self._now(given, memory, memory.offset)
        mine = [s for s in given.shots if clock_offset(at, s, given.wait_ns).common(offset)]
        others = [s for s in self._shots if clock_offset(at, s, given.wait_ns).common(offset)]
        told = self._told(given, at, [s.capture_id for s in others])
        if mine and told is not False and (told or not others or not memory.outstanding):
            return mine
        if mine and told is False:
            why = "the other cameras' pictures were taken at another time"
        elif mine:
            why = f"it may be of capture {others[-1].capture_id} as well"
        elif others:
            why = f"it is of capture {others[-1].capture_id}, and came late"
            memory.outstanding = max(0, memory.outstanding - 1)
        else:
            return self._first(given, memory, exposure, exposure.time, lone, faults)
        hold(given, exposure, why, faults)
        return []

    def _told(self, given: FileDelivery, at: Span, rivals: Sequence[str]) -> bool | None:
        """What the other cameras say where the shot is when somebody pleases; else None."""
        return self._times.tell(given.camera, at, rivals) if given.wait_ns else None

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
        offsets = {shot: clock_offset(at, shot, given.wait_ns) for shot in given.shots}
        ahead = memory.numbers.ahead(exposure.name)
        in_turn = len(given.shots) == 1 and ahead is not None and ahead == memory.outstanding + 1
        agreed = [s for s in offsets if self._agrees(given, memory, at, s, in_turn)]
        plain = {s: o for s, o in offsets.items() if memory.offset is None and is_plain(o)}
        near = [s for s, o in plain.items() if lone and self._is_set(given, memory, at, s, o)]
        alone = [s for s in near if is_alone(at, s, self._shared)]
        near = [s for s in near if s not in alone]
        if agreed or near:
            return agreed or near
        shot, offset = next(iter(offsets.items()))
        stepped = in_turn and memory.offset is not None and not memory.outstanding
        memory.clues = [*memory.clues[-3:], Clue(offset, shot, at, stepped)]
        fits = bool(plain and memory.outstanding)
        why = alone_words(at, shot) if alone else off_words(at, shot, memory.offset, fits)
        hold(given, exposure, why, faults)
        return []

    def _is_set(
        self, given: FileDelivery, memory: CameraFiles, at: Span, shot: FiredShot, offset: Span
    ) -> bool:
        """Whether a clock that looks set by the computer's is taken to be.

        Where an earlier picture has not come, this may be that one, by a clock that is off by the
        time between: only where all other clocks of the rig are set is that ruled out.
        """
        if not memory.outstanding:
            return True
        others = [plain for name, plain in self._plain.items() if name != given.camera]
        earlier = any(is_plain(clock_offset(at, s, given.wait_ns)) for s in self._shots)
        told = bool(others) and all(others) and not earlier
        return told and not self._came_late(memory, shot, offset)

    def _agrees(
        self, given: FileDelivery, memory: CameraFiles, at: Span, shot: FiredShot, in_turn: bool
    ) -> bool:
        """Whether an earlier picture was off by just as much, and not only as one come late.

        ``in_turn``: by its number, one picture was made for each shot since the last that was
        believed.
        """
        offset, agreeing = clock_offset(at, shot, given.wait_ns), 0
        # By a clock that is known it may have been taken by hand before the shot: twice is chance.
        known = memory.offset
        enough = 2 if known is not None and offset.high_ns < known.low_ns else 1
        for clue in memory.clues:
            then = {clue.shot.capture_id: clue.at}
            told = self._times.tell(given.camera, at, supposed=then) if given.wait_ns else None
            if told is False:
                continue
            if clue.shot.capture_id == shot.capture_id or offset.common(clue.offset) is None:
                continue
            stepped = clue.stepped and in_turn
            agreeing += not self._shifted(shot, offset, clue) or is_plain(offset)
            if stepped or agreeing >= enough:
                return bool(told) or not self._came_late(memory, shot, offset)
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
                offset = clock_offset(exposure.time, shot, given.wait_ns)
                sharper = memory.offset and self._now(given, memory, memory.offset).common(offset)
                memory.offset, memory.known_at_ns = sharper or offset, shot.at_ns
                memory.clues.clear()
                if len(given.shots) == 1:
                    self._times.learn(given.camera, shot.capture_id, exposure.time)
            tags = exposure.frames[0].metadata
            memory.serial = memory.serial or tags.get("BodySerialNumber", "")
        # A picture whose number was believed settles which of those before it are lost.
        if any(method is Method.ARRIVAL for _, method in found.values()):
            memory.outstanding = 0
        memory.outstanding += len(given.shots) - len(found)
        if found:
            memory.filed_in = given.shots[0].capture_id
            filed = [f for exposure, _ in found.values() for f in exposure.frames]
            self._filed |= {_place(frame) for frame in filed}
            memory.filed = tuple(f.metadata.get("path", f.metadata.get("file", "")) for f in filed)
        memory.numbers.capture_ends([found[k][0].name for k in sorted(found)])


def _place(frame: Frame) -> tuple[str, str, str]:
    """Where a file lay and when it was taken: programs use names again."""
    tags = frame.metadata
    moment = tags.get("DateTimeOriginal", ""), tags.get("SubSecTimeOriginal", "")
    return tags.get("path", tags.get("file", "")), *moment


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
        hold(given, exposure, f"{why} capture", faults)
        return []
    if not memory.outstanding:
        return list(shots)
    place = 0 if ahead is None else ahead - memory.outstanding
    if 1 <= place <= len(shots) and memory.numbers.goes_on(name):
        return [shots[place - 1]]
    why = "it tells no time, and an earlier picture has not come: which it is cannot be told"
    hold(
        given,
        exposure,
        f"{why}; let the camera write times, or begin a new session, with the station opened anew, "
        "when none is on its way",
        faults,
    )
    memory.numbers.hold(name)
    return []


def _method(exposure: FileExposure) -> Method:
    return Method.ARRIVAL if exposure.time is None else Method.FILE_TIME


def _in_order(
    given: FileDelivery, usable: Sequence[tuple[FileExposure, Sequence[FiredShot]]]
) -> bool:
    return all(shot in shots for shot, (_, shots) in zip(given.shots, usable, strict=True))
