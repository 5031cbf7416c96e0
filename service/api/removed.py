"""``/v1/removed-sessions``: sessions that were removed, until they are erased."""

from __future__ import annotations

from urllib.parse import quote

from fastapi import APIRouter
from pydantic import AwareDatetime

from service.api.addresses import at
from service.api.context import ServiceDep
from service.api.models import problems
from service.api.sessions import SessionSummary, summary
from service.kinds.base import Model
from service.stations.removed import RemovedFolder

router = APIRouter(tags=["sessions"])


class RemovedSession(Model):
    """A session that was removed; it can be restored before ``until``, then it is erased."""

    id: str
    name: str
    removed_at: AwareDatetime
    until: AwareDatetime
    links: dict[str, str]


class RemovedSessionList(Model):
    """What can still be restored, last removed first."""

    items: list[RemovedSession]


@router.delete(
    "/v1/sessions/{session}", response_model=RemovedSession, responses=problems(404, 409)
)
def remove_session(service: ServiceDep, session: str) -> RemovedSession:
    """Remove a session with its pictures; it can be restored for `RIGWRIGHT_SESSION_GRACE_DAYS`.

    409 while a rig is busy, or while a job or another process uses the session.
    """
    return _document(service.rigs.remove_session(session))


@router.get("/v1/removed-sessions", response_model=RemovedSessionList)
def list_removed_sessions(service: ServiceDep) -> RemovedSessionList:
    """List the sessions that can be restored."""
    return RemovedSessionList(items=[_document(one) for one in service.rigs.removed.all()])


@router.get(
    "/v1/removed-sessions/{removed}", response_model=RemovedSession, responses=problems(404)
)
def read_removed_session(service: ServiceDep, removed: str) -> RemovedSession:
    """Read when a session was removed and until when it can be restored."""
    return _document(service.rigs.removed.get(removed))


@router.post(
    "/v1/removed-sessions/{removed}/restore",
    response_model=SessionSummary,
    responses=problems(404, 409),
)
def restore_session(service: ServiceDep, removed: str) -> SessionSummary:
    """Bring a removed session back. 409 where a new one has its name."""
    return summary(service.rigs.removed.restore(removed))


@router.delete("/v1/removed-sessions/{removed}", status_code=204, responses=problems(404, 409))
def erase_session(service: ServiceDep, removed: str) -> None:
    """Erase a removed session for good, now. 409 where some of it cannot be."""
    service.rigs.removed.erase(removed)


def _document(one: RemovedFolder) -> RemovedSession:
    own = at(f"/v1/removed-sessions/{quote(one.id)}")
    return RemovedSession(
        id=one.id,
        name=one.name,
        removed_at=one.removed_at,
        until=one.until,
        links={"self": own, "restore": f"{own}/restore"},
    )
