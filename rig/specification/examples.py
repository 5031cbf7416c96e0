"""Rig files that come with the program."""

from __future__ import annotations

from importlib.resources import files

from common.errors import NotFoundError
from rig.specification.rigfile import parse_rig
from rig.specification.spec import RigSpec


def example_names() -> tuple[str, ...]:
    """The names of the rigs that come with the program."""
    entries = (entry.name for entry in files("rig.specification.data").iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in entries if name.endswith(".toml")))


def example_text(name: str) -> str:
    """The rig file ``name`` as text; raises :class:`NotFoundError` when there is none."""
    if name not in example_names():
        known = ", ".join(example_names())
        raise NotFoundError(
            "example", f"there is no example rig {name!r}", f"choose one of {known}"
        )
    return files("rig.specification.data").joinpath(f"{name}.toml").read_text(encoding="utf-8")


def example_rig(name: str) -> RigSpec:
    """The rig ``name``, for example ``face``."""
    return parse_rig(example_text(name), f"{name}.toml")
