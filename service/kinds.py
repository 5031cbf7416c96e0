"""The kinds of jobs the service does."""

from __future__ import annotations

from service.jobs.engine import JobKind

KINDS = {
    kind.name: kind
    for kind in (
        JobKind("design", "service.work:design_job"),
        JobKind("evaluation", "service.work:evaluation_job"),
    )
}
