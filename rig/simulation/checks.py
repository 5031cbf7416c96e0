"""How settings of the simulation refuse what cannot be."""

from __future__ import annotations

import math

from common.errors import InputError


def require(condition: bool, what: str, problem: str, remedy: str) -> None:
    """Raise :class:`InputError` ``simulation-<what>`` unless the condition holds."""
    if not condition:
        raise InputError(f"simulation-{what}", problem, remedy)


def require_range(name: str, value: float, low: float, high: float) -> None:
    """Raise :class:`InputError` when a number is not within its limits, or not a number."""
    require(
        math.isfinite(value) and low <= value <= high,
        name.replace("_", "-"),
        f"{name} of the simulation is {value:g}",
        f"give a number from {low:g} to {high:g}",
    )
