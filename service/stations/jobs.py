"""What a rig does when it is asked for a capture or a test."""

from __future__ import annotations

from common.files.plain import plain
from common.files.writing import writable_place
from rig.acquisition.capture.results import CaptureResult, DryRun, SelfTest, SyncCheck
from rig.acquisition.capture.rig import Rig
from rig.acquisition.session.records import VerdictEntry
from rig.acquisition.station.delays import write_timings
from rig.acquisition.synchrony.faults import Fault
from rig.acquisition.synchrony.lags import LagEstimate
from rig.acquisition.synchrony.verdict import Verdict
from service.jobs.engine import Running
from service.kinds.rigs import (
    CaptureOutcome,
    CaptureRequest,
    CheckLine,
    FaultLine,
    LagLine,
    RigTestOutcome,
    RigTestRequest,
    TimingLine,
)
from service.stations.sessions import Sessions


def take_capture(
    request: CaptureRequest, rig: Rig, sessions: Sessions, running: Running
) -> CaptureOutcome:
    """Take a capture and file it."""
    name = request.session_name
    result = rig.capture(
        sessions.get(name, rig, request.subject, request.operator),
        request.capture_id,
        shots=request.shots,
        interval_us=request.interval_us,
        allow_partial=request.allow_partial,
        progress=running.report,
        cancel=running.cancel,
    )
    if result.error is not None:
        raise result.error
    return capture_outcome(result, name)


def capture_outcome(result: CaptureResult, session: str) -> CaptureOutcome:
    """A committed capture."""
    return CaptureOutcome(session=session, record=result.record)


def run_test(
    request: RigTestRequest, rig: Rig, sessions: Sessions, running: Running
) -> RigTestOutcome:
    """Do a dry run, a self-test or a synchronisation check."""
    if request.test == "self-test":
        return self_test_outcome(rig.self_test(sessions.root))
    if request.test == "dry-run":
        return _dry_run(request, rig, running)
    if request.adopt and rig.station.path is not None:
        writable_place(rig.station.path, overwrite=True)
    check = rig.sync_check(request.captures, progress=running.report, cancel=running.cancel)
    if not request.adopt or check.timings is None:
        return sync_outcome(check)
    if rig.station.path is not None:
        write_timings(rig.station.path, check.timings)
    rig.adopt(check.timings)
    return sync_outcome(check, adopted=True)


def _dry_run(request: RigTestRequest, rig: Rig, running: Running) -> RigTestOutcome:
    dry = rig.dry_run(
        shots=request.shots,
        interval_us=request.interval_us,
        allow_partial=request.allow_partial,
        progress=running.report,
        cancel=running.cancel,
    )
    return dry_run_outcome(dry)


def dry_run_outcome(dry: DryRun) -> RigTestOutcome:
    """What a dry run found."""
    return RigTestOutcome(
        test="dry-run",
        ok=not dry.faults,
        ready=list(dry.ready),
        faults=[_fault(fault) for fault in dry.faults],
        seconds=dry.seconds,
    )


def self_test_outcome(test: SelfTest) -> RigTestOutcome:
    """What a self-test found."""
    checks = [CheckLine(name=c.name, ok=c.ok, text=c.text) for c in test.checks]
    return RigTestOutcome(test="self-test", ok=test.ok, checks=checks)


def sync_outcome(check: SyncCheck, *, adopted: bool = False) -> RigTestOutcome:
    """What a synchronisation check found."""
    timings = check.timings
    return RigTestOutcome(
        test="sync-check",
        ok=all(evidence.verdict.state == "synchronised" for evidence in check.captures),
        verdicts=[_verdict(evidence.verdict) for evidence in check.captures],
        faults=[_fault(fault) for fault in check.faults],
        lags={name: _lag(lag) for name, lag in check.lags.items()},
        timings=None
        if timings is None
        else {
            name: TimingLine(delay_us=t.delay_us, expected_lag_us=t.expected_lag_us)
            for name, t in timings.items()
        },
        why_not=check.why_not,
        adopted=adopted,
    )


def _fault(fault: Fault) -> FaultLine:
    return FaultLine(kind=fault.kind.value, text=fault.text, camera=fault.camera, shot=fault.shot)


def _lag(lag: LagEstimate) -> LagLine:
    return LagLine(
        camera=lag.camera,
        lag_us=lag.lag_us,
        jitter_us=lag.jitter_us,
        uncertainty_us=lag.uncertainty_us,
        count=lag.count,
        exposure_us=lag.exposure_us,
        source=lag.source,
    )


def _verdict(verdict: Verdict) -> VerdictEntry:
    return VerdictEntry.model_validate(plain(verdict))
