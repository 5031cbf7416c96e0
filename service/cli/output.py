"""What commands about rigs print on standard output."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path

from common.files.plain import plain
from service.kinds.base import Result
from service.problems import KINDS

NOT_WELL = KINDS["device"].exit_code
"""The exit code of a command that found a device, or a rig, not to be well."""


def print_json(document: object) -> None:
    """One document, for machines."""
    sys.stdout.write(json.dumps(plain(document), indent=2) + "\n")


def print_result_json(result: Result, files: Mapping[str, Path], **more: object) -> None:
    """A result with where its files are, for machines."""
    document = {"result": result.model_dump(mode="json", by_alias=True), **more}
    print_json(document | {"files": {name: str(path) for name, path in files.items()}})


def say_next(what: str, *command: object) -> None:
    """What comes next: a sentence, and the command that can be copied."""
    sys.stdout.write(f"Next: {what}:\n  {' '.join(('rigwright', *map(str, command)))}\n")


def show(lines: Mapping[str, object], *, as_json: bool) -> None:
    """Facts as JSON, or each on a line of its own."""
    if as_json:
        print_json(lines)
        return
    for name, value in lines.items():
        for item in (value or ["none"]) if isinstance(value, list) else [value]:
            text = "unknown" if item is None else str(item)
            sys.stdout.write(f"{name.replace('_', ' ')}: {text}\n")
