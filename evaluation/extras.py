"""Libraries that only reconstruction and comparison need: the extra ``evaluation``."""

from __future__ import annotations

import importlib
from types import ModuleType

from common.errors import InputError


def _extra(module: str, package: str) -> ModuleType:
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise InputError(
            "extra-missing",
            f"{package} is not installed, and this needs it",
            "install it: pip install 'rigwright[evaluation]'",
        ) from error


def require_numba() -> None:
    """Raises a one-line :class:`InputError` where numba is missing."""
    _extra("numba", "numba")


def plyfile() -> ModuleType:
    """The module plyfile."""
    return _extra("plyfile", "plyfile")


def igl() -> ModuleType:
    """The module igl (libigl)."""
    return _extra("igl", "libigl")
