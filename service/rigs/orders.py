"""What a rig can be asked for, and the JSON that comes back."""

from __future__ import annotations

import dataclasses
from typing import Any

from common.progress import CancelToken, ProgressCallback
from rig.acquisition.capture.results import CaptureResult, SelfTest, SyncCheck
from rig.acquisition.capture.rig import Rig
from rig.acquisition.station.delays import write_timings
from service.rigs.desk import Work
from service.rigs.sessions import Sessions

JSON = dict[str, Any]
CAPTURE, TEST = "capture", "rig-test"
RIG_KINDS = (CAPTURE, TEST)


def capture_order(request: JSON) -> Work:
    """Take the capture that ``request`` describes."""

    def work(rig: Rig, sessions: Sessions, progress: ProgressCallback, cancel: CancelToken) -> JSON:
        session = sessions.get(session_name(request), rig, request["subject"], request["operator"])
        result = rig.capture(
            session,
            request["capture_id"],
            shots=request["shots"],
            interval_us=request["interval_us"],
            allow_partial=request["allow_partial"],
            progress=progress,
            cancel=cancel,
        )
        if result.error is not None:
            raise result.error
        return capture_document(result, session_name(request))

    return work


def session_name(request: JSON) -> str:
    """The session of a capture; one of its own when none was named."""
    return str(request["session"] or request["capture_id"])


def capture_document(result: CaptureResult, session: str) -> JSON:
    """A committed capture as JSON."""
    return {
        "session": session,
        "record": result.record.model_dump(mode="json", by_alias=True),
    }


def test_order(request: JSON) -> Work:
    """Do the dry run, self-test or synchronisation check that ``request`` names."""

    def work(rig: Rig, sessions: Sessions, progress: ProgressCallback, cancel: CancelToken) -> JSON:
        if request["test"] == "self-test":
            return self_test_document(rig.self_test(sessions.root))
        if request["test"] == "dry-run":
            dry = rig.dry_run(
                allow_partial=request["allow_partial"], progress=progress, cancel=cancel
            )
            return {"test": "dry-run", "ok": not dry.faults, **dataclasses.asdict(dry)}
        check = rig.sync_check(request["captures"], progress=progress, cancel=cancel)
        written = request["adopt"] and check.timings is not None
        if written and check.timings is not None:
            if rig.station.path is not None:
                write_timings(rig.station.path, check.timings)
            rig.adopt(check.timings)
        return {**sync_document(check), "adopted": written}

    return work


def self_test_document(test: SelfTest) -> JSON:
    """A self-test as JSON."""
    return {
        "test": "self-test",
        "ok": test.ok,
        "checks": [dataclasses.asdict(c) for c in test.checks],
    }


def sync_document(check: SyncCheck) -> JSON:
    """A synchronisation check as JSON."""
    return {
        "test": "sync-check",
        "ok": all(evidence.verdict.state == "synchronised" for evidence in check.captures),
        "verdicts": [dataclasses.asdict(evidence.verdict) for evidence in check.captures],
        "faults": [dataclasses.asdict(fault) for fault in check.faults],
        "lags": {name: dataclasses.asdict(lag) for name, lag in check.lags.items()},
        "timings": None
        if check.timings is None
        else {name: dataclasses.asdict(timing) for name, timing in check.timings.items()},
        "why_not": check.why_not,
    }
