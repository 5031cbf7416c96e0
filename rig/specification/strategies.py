"""Where the starts of a design may come from, for those who ask for one."""

from solver.strategy import Strategy

__all__ = ["Strategy"]
