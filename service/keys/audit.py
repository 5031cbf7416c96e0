"""Who did what: a line of JSON for everything that changes something, and for every refusal."""

from __future__ import annotations

import json
import logging
import os
from datetime import UTC, datetime
from logging.handlers import RotatingFileHandler
from pathlib import Path
from typing import Any

FILE_NAME = "audit.jsonl"
_LARGEST_BYTES = 10 << 20
_FORMER_FILES = 9


class AuditLog:
    """The file in the data folder; former ones are beside it, numbered, the oldest go.

    For any thread. A line that cannot be written is told in the service's log, and stops nothing.
    """

    def __init__(self, folder: Path) -> None:
        self._handler = _Own(
            folder / FILE_NAME,
            maxBytes=_LARGEST_BYTES,
            backupCount=_FORMER_FILES,
            encoding="utf-8",
            delay=True,
        )

    def note(self, entry: dict[str, Any]) -> None:
        """Add a line; ``at`` is now."""
        at = datetime.now(UTC).isoformat(timespec="milliseconds")
        told = {key: value for key, value in entry.items() if value is not None}
        self._handler.handle(
            logging.makeLogRecord({"msg": json.dumps({"at": at, **told}), "levelno": logging.INFO})
        )

    def close(self) -> None:
        """Let go of the file."""
        self._handler.close()


class _Own(RotatingFileHandler):
    def _open(self) -> Any:  # noqa: ANN401 - a text file, as the inherited one says
        # Names of people and addresses are nobody else's business.
        os.close(os.open(self.baseFilename, os.O_CREAT | os.O_APPEND | os.O_WRONLY, 0o600))
        return super()._open()
