"""What a session tells of cameras that are only seen through their files, for a rig opened anew."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress
from datetime import datetime

from rig.acquisition.cameras.base import Frame, FrameStatus, TriggerKind
from rig.acquisition.session.intents import Intent
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
    intents: Sequence[Intent] = (),
) -> None:
    """Let ``evidence`` learn what the captures of a session showed of ``cameras``.

    ``intents``: of those that were interrupted; their pictures may still come, as after a miss.
    """
    steps: list[tuple[int, CaptureRecord | Intent]] = []
    # A record that was damaged teaches nothing; `sessions verify` tells of it.
    for record in records:
        with suppress(ValueError):
            steps.append((_fired_ns(record), record))
    for intent in intents:
        with suppress(ValueError):
            steps.append((intent.at_ns, intent))
    for at_ns, step in sorted(steps, key=lambda one: one[0])[-RECALLED:]:
        if isinstance(step, Intent):
            shots = fired_shots(step.capture_id, at_ns, step.shots, step.interval_us)
            missed(evidence, shots, cameras)
            continue
        with suppress(ValueError):
            evidence.recall(_past(station, step, cameras))


def missed(evidence: FileEvidence, shots: tuple[FiredShot, ...], cameras: Collection[str]) -> None:
    """Shots that were fired, or may have been, and of which no picture was filed."""
    evidence.recall([(FileDelivery(name, (), shots, 0), ()) for name in cameras])


def fired_shots(
    capture_id: str, first_ns: int, shots: int, interval_us: float
) -> tuple[FiredShot, ...]:
    """The shots of a capture, the first at ``first_ns`` since 1970."""
    return tuple(
        FiredShot(capture_id, k + 1, first_ns + round(k * interval_us * 1e3)) for k in range(shots)
    )


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
    stopped = record.trigger is not None and record.trigger.outcome == "partial"
    made = record.trigger.shots_done if stopped and record.trigger else record.shots
    return fired_shots(record.capture_id, _fired_ns(record), made, record.interval_us)


def _fired_ns(record: CaptureRecord) -> int:
    return round(datetime.fromisoformat(record.fired_at).timestamp() * 1e9)


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
