"""Defaults that requests and the command line's help share: without pydantic, for a quick help."""

from __future__ import annotations

from typing import Literal

PAGE = "A4"
"""Paper of target sheets."""

PAPER: Literal["A4"] = "A4"
"""Paper of drilling templates."""

SYNC_CAPTURES = 3
"""Captures that a synchronisation check measures from."""
