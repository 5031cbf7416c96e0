"""The same request with the same ``Idempotency-Key`` gets the same answer.

A key is first claimed, then answered in the same transaction as the change that the request
asks for, or released when the request fails: a failed request changed nothing and may be tried
again under its key.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

from sqlalchemy import Connection, delete, insert, select, update

from common.errors import ConflictError, InputError
from service.store.tables import idempotency, utc_now

KEPT_DAYS = 7


@dataclass(frozen=True)
class IdempotencyKey:
    """A key a client chose, within the ``scope`` of one resource."""

    scope: str
    key: str


@dataclass(frozen=True)
class StoredAnswer:
    """What a key was answered with, and the hash of the request it was for."""

    request_sha256: str | None
    answer: Any


def claim(connection: Connection, claimed: IdempotencyKey) -> StoredAnswer | None:
    """Claim a key. What is stored when it was answered before, else None.

    Raises :class:`ConflictError` while another request with the key is being answered.
    """
    row = connection.execute(select(idempotency).where(*_this(claimed))).mappings().one_or_none()
    if row is None:
        connection.execute(
            insert(idempotency).values(scope=claimed.scope, key=claimed.key, created_at=utc_now())
        )
        return None
    if row["answer"] is None:
        raise ConflictError(
            "idempotency-in-flight",
            "a request with this Idempotency-Key is still being answered",
            "wait for its answer, then ask again",
        )
    return StoredAnswer(row["request_sha256"], row["answer"])


def replay(stored: StoredAnswer, request_sha256: str) -> Any:  # noqa: ANN401 - any JSON value
    """The answer given before. Raises :class:`InputError` when the request was another one."""
    if stored.request_sha256 != request_sha256:
        raise InputError(
            "idempotency-key-reused",
            "this Idempotency-Key was used for a request with another content",
            "choose a new key for a new request",
        )
    return stored.answer


def answer(
    connection: Connection,
    claimed: IdempotencyKey,
    request_sha256: str,
    given: Any,  # noqa: ANN401 - any JSON value
) -> None:
    """Store the answer to a claimed key."""
    connection.execute(
        update(idempotency)
        .where(*_this(claimed))
        .values(request_sha256=request_sha256, answer=given)
    )


def release(connection: Connection, claimed: IdempotencyKey) -> None:
    """Give a key back whose request failed."""
    connection.execute(
        delete(idempotency).where(*_this(claimed), idempotency.c.request_sha256.is_(None))
    )


def forget_stale(connection: Connection) -> None:
    """On start: drop keys that a crash left unanswered, and old ones."""
    oldest = (datetime.now(UTC) - timedelta(days=KEPT_DAYS)).isoformat(timespec="milliseconds")
    connection.execute(
        delete(idempotency).where(
            idempotency.c.request_sha256.is_(None) | (idempotency.c.created_at < oldest)
        )
    )


def _this(claimed: IdempotencyKey) -> tuple[Any, Any]:
    return idempotency.c.scope == claimed.scope, idempotency.c.key == claimed.key
