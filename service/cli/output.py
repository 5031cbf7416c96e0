"""What commands about rigs print on standard output."""

from __future__ import annotations

import json
import sys
from typing import Any

from common.files.plain import plain
from service.problems import KINDS

JSON = dict[str, Any]
NOT_WELL = KINDS["device"].exit_code
"""The exit code of a command that found a device, or a rig, not to be well."""


def print_json(document: JSON) -> None:
    """One document, for machines."""
    sys.stdout.write(json.dumps(plain(document), indent=2) + "\n")


def show(document: JSON, *, as_json: bool) -> None:
    """A document as JSON, or as a line for each of its values."""
    if as_json:
        print_json(document)
        return
    for key, value in _lines(plain(document)):
        sys.stdout.write(f"{key}: {value}\n")


def _lines(document: JSON, prefix: str = "") -> list[tuple[str, str]]:
    lines: list[tuple[str, str]] = []
    for key, value in document.items():
        name = f"{prefix}{key}".replace("_", " ")
        if isinstance(value, dict):
            lines += _lines(value, f"{name}, ")
        elif isinstance(value, list):
            lines += [(name, str(item)) for item in value] or [(name, "none")]
        else:
            lines.append((name, "unknown" if value is None else str(value)))
    return lines
