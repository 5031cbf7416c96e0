"""Rigs to begin with: the rig files that come with the program, and what one may say."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from pydantic import JsonValue

from rig.specification.examples import example_names, example_text
from rig.specification.rigfile import RigFile, parse_rig_file
from service.kinds.design import RigExample


@cache
def example_rigs() -> tuple[RigExample, ...]:
    """All of them; only what the files say themselves is set."""
    return tuple(_example(name) for name in example_names())


@cache
def rig_schema() -> dict[str, JsonValue]:
    """The JSON schema (draft 2020-12) of a rig file."""
    return RigFile.model_json_schema()


def rig_of_file(path: Path, name: str) -> RigExample:
    """What a rig file says, and no more."""
    return _read(path.read_text(encoding="utf-8"), name)


def _example(name: str) -> RigExample:
    return _read(example_text(name), name)


def _read(text: str, name: str) -> RigExample:
    return RigExample(name=name, rig=parse_rig_file(text, name))
