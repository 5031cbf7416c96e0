"""What a key may do: each scope holds those before it."""

from __future__ import annotations

from enum import StrEnum


class Scope(StrEnum):
    """``read``: look, and stop what runs. ``configure``: ask for work that fires nothing.

    ``hardware``: everything, firing as well.
    """

    READ = "read"
    CONFIGURE = "configure"
    HARDWARE = "hardware"

    def covers(self, needed: Scope) -> bool:
        """Whether a key of this scope may do what ``needed`` may."""
        order = list(Scope)
        return order.index(self) >= order.index(needed)
