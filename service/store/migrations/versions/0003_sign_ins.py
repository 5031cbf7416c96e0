"""Browsers that signed in."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Create the table."""
    op.create_table(
        "sign_ins",
        sa.Column("sha256", sa.String, nullable=False),
        sa.Column("key_sha256", sa.String, nullable=False),
        sa.Column("ends_at", sa.String, nullable=False),
        sa.PrimaryKeyConstraint("sha256", name=op.f("pk_sign_ins")),
    )
