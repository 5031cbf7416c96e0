"""The kinds of jobs the service does."""

from __future__ import annotations

from service.jobs.engine import JobKind

KINDS = {
    kind.name: kind
    for kind in (
        JobKind("design", "service.tasks.designing:design"),
        JobKind("evaluation", "service.tasks.designing:evaluation"),
        JobKind("plan", "service.tasks.planning:plan"),
        JobKind("calibration", "service.tasks.calibrating:calibration"),
        JobKind("check", "service.tasks.calibrating:rig_check"),
        JobKind("acceptance", "service.tasks.calibrating:acceptance"),
    )
}
