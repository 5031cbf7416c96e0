"""Where everything lies in a session folder. All paths are relative to it."""

from __future__ import annotations

import re
from pathlib import Path

CAPTURE_ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
SESSION = "session.json"
MARKS = "marks.json"
"""What people think of the pictures: the one file that may change afterwards."""

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

STAGED = re.compile(rf"{INTENT}|{STAGED_RECORD}|({IMAGES}|{RAW})/[^/]+/\d{{6,}}\.[^/]+")
"""All that is ever written in a stage, by its path there."""

CHANGED = ".changed"
"""Ends the name that a file gets which somebody else wrote in the place of one of ours."""

HALF = re.compile(r"[^/]+\.half")
"""All that is ever written in the folder of halves."""


def picture(camera: str, instant: int, suffix: str, *, raw: bool = False) -> str:
    """The file of one camera at one instant: one folder per camera, one name per instant."""
    return f"{RAW if raw else IMAGES}/{camera}/{instant:06d}{suffix}"


def record(number: int, capture_id: str) -> str:
    """A capture's own file."""
    return f"{CAPTURES}/{number:06d}-{capture_id}.json"


def stage(folder: Path, capture_id: str) -> Path:
    """Where a capture is written before it is committed."""
    return folder / INCOMPLETE / capture_id
