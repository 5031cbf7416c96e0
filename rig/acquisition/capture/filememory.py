"""What a session tells of cameras that are only seen through their files, for a rig opened anew."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from datetime import datetime

from rig.acquisition.cameras.base import Frame, FrameStatus, TriggerKind
from rig.acquisition.session.records import CaptureRecord, FrameEntry, UnfiledEntry
from rig.acquisition.station.spec import Station
from rig.acquisition.synchrony.cameraframes import Method, Pair
from rig.acquisition.synchrony.fileevidence import FileDelivery, FileEvidence, FiredShot

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
        shots = _shots(record)
        past = {
            camera.name: FileDelivery(
                camera.name,
                tuple(_frame(u) for u in record.unfiled if u.camera == camera.name),
                shots,
                0,
                0 if camera.trigger == TriggerKind.EDGE else _wait_ns(station),
            )
            for camera in record.cameras
            if camera.name in cameras
        }
        filed = {name: _pairs(record, name) for name in past}
        evidence.recall([(given, filed[name]) for name, given in past.items()])


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
