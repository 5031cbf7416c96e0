"""What a session tells of cameras that are only seen through their files, for a rig opened anew."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from datetime import datetime

from rig.acquisition.cameras.base import Frame, FrameStatus, TriggerKind
from rig.acquisition.session.records import CaptureRecord, FrameEntry, UnfiledEntry
from rig.acquisition.station.spec import Station
from rig.acquisition.synchrony.cameraframes import Method, Pair
from rig.acquisition.synchrony.fileclocks import FileDelivery, FiredShot
from rig.acquisition.synchrony.fileevidence import FileEvidence

RECALLED = 100
"""So many of the last captures are gone through: clocks drift, and old pictures come no more."""


def recall(
    evidence: FileEvidence,
    station: Station,
    records: Sequence[CaptureRecord],
    cameras: Collection[str],
) -> None:
    """Let ``evidence`` learn what the captures of a session showed of ``cameras``."""
    for record in records[-RECALLED:]:
        try:
            past = _past(station, record, cameras)
        except ValueError:
            # A record that was damaged teaches nothing; `sessions verify` tells of it.
            continue
        evidence.recall(past)


def _past(
    station: Station, record: CaptureRecord, cameras: Collection[str]
) -> list[tuple[FileDelivery, tuple[Pair, ...]]]:
    """What came of each camera, and what of it was filed; ValueError where it cannot have been."""
    shots = _shots(record)
    past = []
    for camera in record.cameras:
        if camera.name not in cameras:
            continue
        given = FileDelivery(
            camera.name,
            tuple(_frame(u) for u in record.unfiled if u.camera == camera.name),
            shots,
            0,
            0 if camera.trigger == TriggerKind.EDGE else _wait_ns(station),
        )
        filed = _pairs(record, camera.name)
        if not {pair.shot for pair in filed} <= {shot.shot for shot in shots}:
            raise ValueError("a picture of a shot that was not fired")
        past.append((given, filed))
    return past


def _wait_ns(station: Station) -> int:
    return round(station.policy.frame_deadline_s * 1e9)


def _shots(record: CaptureRecord) -> tuple[FiredShot, ...]:
    first_ns = round(datetime.fromisoformat(record.fired_at).timestamp() * 1e9)
    stopped = record.trigger is not None and record.trigger.outcome == "partial"
    made = record.trigger.shots_done if stopped and record.trigger else record.shots
    return tuple(
        FiredShot(record.capture_id, k + 1, first_ns + round(k * record.interval_us * 1e3))
        for k in range(made)
    )


def _pairs(record: CaptureRecord, camera: str) -> tuple[Pair, ...]:
    mine = [frame for frame in record.frames if frame.camera == camera]
    return tuple(Pair(frame.shot, _frame(frame), Method(frame.method)) for frame in mine)


def _frame(entry: FrameEntry | UnfiledEntry) -> Frame:
    """The same file without its picture."""
    return Frame(
        entry.camera,
        0,
        FrameStatus.OK,
        encoded=b"",
        media_type=entry.media_type,
        metadata=entry.metadata,
    )
