"""The kinds of jobs the service does."""

from __future__ import annotations

from service.jobs.engine import JobKind

KINDS = {
    kind.name: kind
    for kind in (
        JobKind("design", "service.tasks.designing:design"),
        JobKind("evaluation", "service.tasks.designing:evaluation"),
    )
}
