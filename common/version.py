"""Which version of the program this is."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version


def program_version() -> str:
    """Version of the installed program."""
    try:
        return version("rigwright")
    except PackageNotFoundError:
        # A checkout that is run without being installed has no version of its own.
        return "0"
