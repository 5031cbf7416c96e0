"""One capture on its way into a session: everything it writes before it is committed."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta
from pathlib import Path

from common.errors import ConflictError, RigwrightError
from rig.acquisition.session import paths
from rig.acquisition.session.commit import clear_stage, publish, set_aside
from rig.acquisition.session.exif import PictureFacts
from rig.acquisition.session.folder import Session
from rig.acquisition.session.intents import Intent
from rig.acquisition.session.jsonfiles import entry, model_bytes
from rig.acquisition.session.pictures import filed
from rig.acquisition.session.recording import FiledFrame, Numbering, make_record
from rig.acquisition.session.records import CaptureRecord
from rig.acquisition.session.recovery import interrupted
from rig.acquisition.session.storage import disk_errors, two_disks
from rig.acquisition.station.spec import CapturePolicy
from rig.acquisition.synchrony.cameraframes import Pair
from rig.acquisition.synchrony.capturedata import CameraPart, CaptureData
from rig.acquisition.synchrony.faults import Fault, FaultKind
from rig.acquisition.synchrony.imagechecks import is_raw
from rig.acquisition.synchrony.verdict import Evidence

WRITERS = 2
"""Coding one picture while another waits for the disk; more only wait together."""

SLOW_S = 10.0
"""A capture that takes longer to write says so: the next one waits for it."""


class Stage:
    """A capture's own folder in the session, out of sight until it is committed.

    Raises :class:`ConflictError` ``disk-full`` and the other errors of a disk.
    """

    def __init__(self, session: Session, capture_id: str, writers: int = WRITERS) -> None:
        self._session = session
        self._id = capture_id
        self._writers = writers
        self._folder = paths.stage(session.folder, capture_id)
        session.tidy()
        if session.committed(capture_id) is not None:
            raise ConflictError(
                "capture-committed",
                f"capture {capture_id} is committed already",
                "read it, or take a new one under another id",
            )
        with disk_errors(session.folder):
            _refuse_other_disks(session.folder)
            session.index.disk.make_folder(self._folder)

    def may_fire(self, box_capture: str, shots: int, interval_us: float) -> None:
        """From now on this capture may have fired, until somebody says otherwise."""
        intent = Intent(
            capture_id=self._id,
            box_capture=box_capture,
            shots=shots,
            interval_us=interval_us,
            at=datetime.now(UTC).astimezone().isoformat(),
        )
        with disk_errors(self._session.folder):
            index = self._session.index
            index.disk.replace(self._folder / paths.INTENT, model_bytes(intent), index.scratch)

    def drop(self) -> None:
        """Nothing was fired: nothing is left."""
        with disk_errors(self._session.folder):
            clear_stage(self._session.index, self._folder)

    def set_aside(self, fate: str, why: str) -> None:
        """It fired, or may have, and cannot be committed: its id is never used again."""
        with disk_errors(self._session.folder):
            aside = interrupted(self._id, fate, why)
            self._session.index = set_aside(self._session.index, aside)

    def settle(self, why: str) -> CaptureRecord | None:
        """After a failed commit of what was fired: committed after all, or set aside.

        Raises when the disk fails still; the next opening of the session then settles it.
        """
        self._session.tidy(interrupted(self._id, "fired", why))
        return self._session.index.committed(self._id)

    def commit(
        self,
        captured: CaptureData,
        evidence: Evidence,
        policy: CapturePolicy,
        *,
        partial_allowed: bool,
        focal_mm: Mapping[str, float] | None = None,
    ) -> CaptureRecord:
        """Write everything and commit it. ``focal_mm``: focal lengths by camera, for EXIF."""
        began = time.monotonic()
        session = self._session
        numbering = Numbering(session.next_number, session.next_instant)
        with disk_errors(session.folder):
            files, faults, lost = self._write_pictures(captured, policy, numbering, focal_mm or {})
            captured = captured.without(lost)
            seconds = time.monotonic() - began
            if seconds > SLOW_S:
                faults.append(_slow(files, seconds))
            record = make_record(
                captured,
                evidence,
                files,
                numbering,
                partial_allowed=partial_allowed,
                more_faults=faults,
            )
            index = session.index
            staged = self._folder / paths.STAGED_RECORD
            index.disk.replace(staged, model_bytes(record), index.scratch)
            session.index = publish(index, record)
        return record

    def _write_pictures(
        self,
        captured: CaptureData,
        policy: CapturePolicy,
        numbering: Numbering,
        focal_mm: Mapping[str, float],
    ) -> tuple[list[FiledFrame], list[Fault], list[Fault]]:
        """The files, what is to be said of them, and a fault for each that could not be coded."""

        def write(one: tuple[CameraPart, Pair, bool]) -> tuple[FiledFrame, bool] | Fault:
            part, pair, raw = one
            name, instant = part.plan.name, numbering.first_instant + pair.shot - 1
            facts = picture_facts(captured, part, pair, focal_mm.get(name))
            try:
                file = filed(pair.frame, facts, policy)
            except (RigwrightError, OSError, ValueError) as error:
                # One picture that nothing can code must not cost all the others.
                text = f"{name}: the picture of shot {pair.shot} cannot be filed ({error})"
                return Fault(FaultKind.MISSING, text, name, pair.shot)
            path = paths.picture(name, instant, file.suffix, raw=raw)
            self._write(path, file.data)
            done = FiledFrame(part, pair, raw, entry(path, file.data), file.media_type)
            return done, file.as_png

        with ThreadPoolExecutor(self._writers, "capture-writer") as pool:
            outcomes = list(pool.map(write, _pictures(captured)))
        written = [one for one in outcomes if not isinstance(one, Fault)]
        faults = [
            Fault(
                FaultKind.FILED_AS_PNG,
                f"{one.part.plan.name}: {policy.image_format} cannot hold its picture, which is "
                "filed as PNG",
                one.part.plan.name,
                one.pair.shot,
            )
            for one, as_png in written
            if as_png
        ]
        lost = [one for one in outcomes if isinstance(one, Fault)]
        return [one for one, _ in written], faults, lost

    def _write(self, path: str, data: bytes) -> None:
        disk, target = self._session.index.disk, self._folder / path
        disk.make_folder(target.parent)
        disk.write(target, data)
        disk.sync_folder(target.parent)


def _pictures(captured: CaptureData) -> Iterator[tuple[CameraPart, Pair, bool]]:
    """All pictures and the raw files beside them, each with whether it is one."""
    for part in captured.parts:
        beside = () if part.raws is None else part.raws.pairs
        for pair in (*part.pairing.pairs, *beside):
            yield part, pair, is_raw(pair.frame)


def _slow(files: list[FiledFrame], seconds: float) -> Fault:
    megabytes = sum(one.file.bytes for one in files) / 1e6
    text = f"writing {megabytes:.0f} MB took {seconds:.0f} s: the disk is slow"
    return Fault(FaultKind.SLOW_DISK, text)


def picture_facts(
    captured: CaptureData, part: CameraPart, pair: Pair, focal_mm: float | None
) -> PictureFacts:
    """What EXIF says of one picture."""
    told = next((i.at_host_ns for i in part.received.trigger_times if i.shot == pair.shot), None)
    at = pair.exposed_host_ns or told or captured.fired_host_ns
    later = timedelta(microseconds=(at - captured.fired_host_ns) / 1000.0)
    settings = part.settings
    return PictureFacts(
        unique_id=f"{captured.capture_id}/{part.plan.name}/{pair.shot}",
        taken_at=captured.fired_at + later,
        make=part.info.vendor,
        model=part.info.model,
        serial_number=part.info.id,
        exposure_us=pair.frame.exposure_us or settings.exposure_us,
        f_number=settings.f_number,
        iso=settings.iso,
        focal_length_mm=focal_mm,
    )


def _refuse_other_disks(folder: Path) -> None:
    """Refuse before anything fires what would fail when its pictures are put in place."""
    home = folder.stat().st_dev
    tops = (paths.IMAGES, paths.RAW, paths.CAPTURES, paths.INCOMPLETE, paths.INTERRUPTED)
    for place in (folder / top for top in tops):
        inner = place.iterdir() if place.is_dir() else ()
        for held in (place.parent, place, *inner):
            if held.is_dir() and held.stat().st_dev != home:
                raise two_disks(folder, held)
