"""A capture's record from what was shot and what it proves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

from common.errors import InternalError
from common.files.plain import plain
from rig.acquisition.session.records import CaptureRecord, FileEntry, contradictions
from rig.acquisition.synchrony.cameraframes import Pair
from rig.acquisition.synchrony.capturedata import CameraPart, CaptureData
from rig.acquisition.synchrony.evidence import CameraTiming, FrameTiming, sync_class
from rig.acquisition.synchrony.faults import Fault
from rig.acquisition.synchrony.verdict import Evidence


@dataclass(frozen=True, eq=False)
class FiledFrame:
    """A picture and the file it was given."""

    part: CameraPart
    pair: Pair
    raw: bool
    file: FileEntry
    media_type: str


@dataclass(frozen=True)
class Numbering:
    """Where in its session a capture stands."""

    number: int
    first_instant: int


def make_record(
    captured: CaptureData,
    evidence: Evidence,
    files: Sequence[FiledFrame],
    numbering: Numbering,
    *,
    partial_allowed: bool,
    more_faults: Sequence[Fault] = (),
) -> CaptureRecord:
    """Everything about a capture that is kept, as its file has it."""
    timings = {(f.camera, f.shot): f for f in evidence.stamps.frames}
    cameras = {c.camera: c for c in evidence.stamps.cameras}
    document = {
        "schema": "rigwright.capture/1",
        "capture_id": captured.capture_id,
        "number": numbering.number,
        "fired_at": captured.fired_at.isoformat(),
        "shots": captured.shots,
        "interval_us": captured.interval_us,
        "first_instant": numbering.first_instant,
        "state": "complete" if captured.whole else "partial",
        "partial_allowed": partial_allowed,
        "missing": captured.missing(),
        "verdict": evidence.verdict,
        "faults": [*captured.all_faults, *more_faults],
        "cameras": [_camera(part, cameras[part.plan.name]) for part in captured.parts],
        "frames": [_frame(f, timings, numbering) for f in files],
        "unfiled": [
            {"camera": p.plan.name, "media_type": f.media_type, "metadata": dict(f.metadata)}
            for p in captured.parts
            for f in p.unfiled
        ],
        "trigger": _trigger(captured, evidence),
        "timing": evidence.stamps.shots,
        "optical": evidence.optical,
    }
    record = CaptureRecord.model_validate(plain(document))
    wrong = contradictions(record)
    if wrong:
        raise InternalError("record", f"capture {record.capture_id}: {wrong[0]}", "report this")
    return record


def _camera(part: CameraPart, timing: CameraTiming) -> dict[str, object]:
    capabilities = part.received.capabilities
    return {
        "name": part.plan.name,
        "backend": part.plan.backend,
        "id": part.info.id,
        "vendor": part.info.vendor,
        "model": part.info.model,
        "trigger": capabilities.trigger,
        "timestamps": capabilities.timestamps,
        "sync_class": sync_class(capabilities, part.plan.output),
        "output": part.plan.output,
        "delay_us": part.plan.delay_us,
        "settings": asdict(part.settings),
        "lag_us": timing.lag_us,
        "lag_uncertainty_us": timing.lag_uncertainty_us,
        "skew_us": timing.skew_us,
        "skew_uncertainty_us": timing.skew_uncertainty_us,
        "passed": timing.passed,
        "clock_samples": [
            [s.host_before_ns, s.device_ns, s.host_after_ns] for s in part.clock_samples
        ],
    }


def _frame(
    filed: FiledFrame, timings: dict[tuple[str, int], FrameTiming], numbering: Numbering
) -> dict[str, object]:
    frame, shot = filed.pair.frame, filed.pair.shot
    name = filed.part.plan.name
    instant = next((i for i in filed.part.received.trigger_times if i.shot == shot), None)
    timing = timings.get((name, shot))
    return {
        "camera": name,
        "shot": shot,
        "instant": numbering.first_instant + shot - 1,
        "raw": filed.raw,
        "file": filed.file.model_dump(),
        "media_type": filed.media_type,
        "status": frame.status,
        "method": filed.pair.method,
        "counter": frame.counter,
        "device_ns": frame.device_ns,
        "arrived_host_ns": frame.arrived_host_ns,
        "told_host_ns": None if instant is None else instant.at_host_ns,
        "told_by": "none" if instant is None else instant.source,
        "exposed_host_ns": filed.pair.exposed_host_ns,
        "lag_us": None if timing is None else timing.lag_us,
        "lag_uncertainty_us": None if timing is None else timing.lag_uncertainty_us,
        "skew_us": None if timing is None else timing.skew_us,
        "skew_uncertainty_us": None if timing is None else timing.skew_uncertainty_us,
        "exposure_us": None if timing is None else timing.exposure_us,
        "metadata": dict(frame.metadata),
    }


def _trigger(captured: CaptureData, evidence: Evidence) -> dict[str, object] | None:
    report = captured.report
    if report is None:
        return None
    return {
        "box_capture": report.capture_id,
        "outcome": report.outcome,
        "acknowledged": report.acknowledged,
        "why": report.why,
        "shots_done": report.shots_done,
        "shots_wanted": report.shots_wanted,
        "clock_uncertainty_us": report.clock_uncertainty_us,
        "error_us": None if evidence.edges is None else evidence.edges.error_us,
        "edges": report.edges,
        "wire": report.wire,
    }
