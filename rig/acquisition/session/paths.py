"""Where everything lies in a session folder. All paths are relative to it."""

from __future__ import annotations

from pathlib import Path

SESSION = "session.json"
IMAGES = "images/rig1"
"""COLMAP's image path is ``images``; ``rig1`` is the rig's name there."""

RAW = "raw/rig1"
RIG = "rig"
CAPTURES = "captures"
INCOMPLETE = ".incomplete"
"""Everything that is being written. It is there only while something is, or after a crash."""

SCRATCH = f"{INCOMPLETE}/.scratch"
INTERRUPTED = "interrupted"
FRAMES_TABLE = "frames.csv"
TRIGGER_LOG = "trigger.jsonl"
SYNC_CHECK = "checks/sync.json"
TABLES = (FRAMES_TABLE, TRIGGER_LOG, SYNC_CHECK)

INTENT = "intent.json"
"""In a stage: the box was about to be armed."""

STAGED_RECORD = "capture.json"
"""In a stage: every file of the capture is there and durable."""


def picture(camera: str, instant: int, suffix: str, *, raw: bool = False) -> str:
    """The file of one camera at one instant: one folder per camera, one name per instant."""
    return f"{RAW if raw else IMAGES}/{camera}/{instant:06d}{suffix}"


def record(number: int, capture_id: str) -> str:
    """A capture's own file."""
    return f"{CAPTURES}/{number:06d}-{capture_id}.json"


def stage(folder: Path, capture_id: str) -> Path:
    """Where a capture is written before it is committed."""
    return folder / INCOMPLETE / capture_id
