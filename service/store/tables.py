"""The tables of the store. The migrations build them; a test holds the two to each other."""

from __future__ import annotations

from datetime import UTC, datetime
from enum import StrEnum

from sqlalchemy import (
    JSON,
    Boolean,
    CheckConstraint,
    Column,
    ForeignKey,
    Index,
    Integer,
    MetaData,
    String,
    Table,
)


class JobStatus(StrEnum):
    """The one authoritative state of a job. The last four are terminal and never change."""

    PENDING = "pending"
    RUNNING = "running"
    COMPLETED = "completed"
    FAILED = "failed"
    CANCELLED = "cancelled"
    INTERRUPTED = "interrupted"

    @property
    def terminal(self) -> bool:
        """Whether the job has ended for good."""
        return self not in (JobStatus.PENDING, JobStatus.RUNNING)


def utc_now() -> str:
    """The present time as the store writes it: ISO 8601, UTC, with offset."""
    return time_text(datetime.now(UTC))


def time_text(time: datetime) -> str:
    """A time of UTC as the store writes it; texts are in the order of their times."""
    return time.isoformat(timespec="milliseconds")


metadata = MetaData(
    naming_convention={
        "ix": "ix_%(column_0_N_label)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "ck": "ck_%(table_name)s_%(constraint_name)s",
        "fk": "fk_%(table_name)s_%(column_0_N_name)s",
        "pk": "pk_%(table_name)s",
    }
)

identity = Table(
    "identity",
    metadata,
    Column("id", Integer, CheckConstraint("id = 1", name="one_row"), primary_key=True),
    Column("service_uuid", String, nullable=False),
    Column("created_at", String, nullable=False),
)

blobs = Table(
    "blobs",
    metadata,
    Column("sha256", String, primary_key=True),
    Column("size_bytes", Integer, nullable=False),
    Column("created_at", String, nullable=False),
)

scans = Table(
    "scans",
    metadata,
    Column("seq", Integer, primary_key=True, autoincrement=True),
    Column("id", String, nullable=False, unique=True),
    Column("blob_sha256", String, ForeignKey("blobs.sha256"), nullable=False, index=True),
    Column("filename", String, nullable=False),
    Column("media_type", String, nullable=False),
    Column("options", JSON(none_as_null=True), nullable=False),
    Column("report", JSON(none_as_null=True), nullable=False),
    Column("created_at", String, nullable=False),
    sqlite_autoincrement=True,
)

jobs = Table(
    "jobs",
    metadata,
    Column("seq", Integer, primary_key=True, autoincrement=True),
    Column("id", String, nullable=False, unique=True),
    Column("kind", String, nullable=False),
    Column("status", String, nullable=False),
    Column("request", JSON(none_as_null=True), nullable=False),
    Column("scan_id", String, ForeignKey("scans.id", ondelete="SET NULL"), index=True),
    Column("cancel_requested", Boolean, nullable=False),
    Column("progress", JSON(none_as_null=True)),
    Column("result", JSON(none_as_null=True)),
    Column("problem", JSON(none_as_null=True)),
    Column("created_at", String, nullable=False),
    Column("started_at", String),
    Column("ended_at", String),
    CheckConstraint(
        "status IN ('pending', 'running', 'completed', 'failed', 'cancelled', 'interrupted')",
        name="status_known",
    ),
    Index("ix_jobs_kind_seq", "kind", "seq"),
    Index("ix_jobs_status_seq", "status", "seq"),
    sqlite_autoincrement=True,
)

job_events = Table(
    "job_events",
    metadata,
    Column("job_id", String, ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True),
    Column("id", Integer, primary_key=True, autoincrement=False),
    Column("type", String, nullable=False),
    Column("data", JSON(none_as_null=True), nullable=False),
    Column("at", String, nullable=False),
)

job_files = Table(
    "job_files",
    metadata,
    Column("job_id", String, ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True),
    Column("name", String, primary_key=True),
    Column("blob_sha256", String, ForeignKey("blobs.sha256"), nullable=False, index=True),
    Column("media_type", String, nullable=False),
)

job_inputs = Table(
    "job_inputs",
    metadata,
    Column("job_id", String, ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True),
    Column("role", String, primary_key=True),
    Column("name", String, nullable=False),
    Column("blob_sha256", String, ForeignKey("blobs.sha256"), nullable=False, index=True),
)

documents = Table(
    "documents",
    metadata,
    Column("seq", Integer, primary_key=True, autoincrement=True),
    Column("id", String, nullable=False, unique=True),
    Column("kind", String, nullable=False),
    Column("blob_sha256", String, ForeignKey("blobs.sha256"), nullable=False, index=True),
    Column("filename", String, nullable=False),
    Column("report", JSON(none_as_null=True), nullable=False),
    Column("created_at", String, nullable=False),
    Index("ix_documents_kind_seq", "kind", "seq"),
    sqlite_autoincrement=True,
)

sign_ins = Table(
    "sign_ins",
    metadata,
    Column("sha256", String, primary_key=True),
    Column("key_sha256", String, nullable=False),
    Column("ends_at", String, nullable=False),
)

idempotency = Table(
    "idempotency",
    metadata,
    Column("scope", String, primary_key=True),
    Column("key", String, primary_key=True),
    Column("request_sha256", String),
    Column("answer", JSON(none_as_null=True)),
    Column("created_at", String, nullable=False),
)
