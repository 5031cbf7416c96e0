"""Rigs to begin with: the rig files that come with the program."""

from __future__ import annotations

from functools import cache

from common.files.strict import validated
from common.files.toml import parsed
from rig.specification.examples import example_names, example_text
from rig.specification.rigfile import RigFile
from service.kinds.design import RigExample


@cache
def example_rigs() -> tuple[RigExample, ...]:
    """All of them; only what the files say themselves is set."""
    return tuple(_example(name) for name in example_names())


def _example(name: str) -> RigExample:
    data = parsed(example_text(name), name, "rig", "rig file")
    return RigExample(name=name, rig=validated(RigFile, data, name))
