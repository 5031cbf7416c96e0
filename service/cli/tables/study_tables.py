"""A study as a table on standard output."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from service.kinds.study import Recommended, StudyResult


def print_study(result: StudyResult) -> None:
    """How many designs there are, and which one to build."""
    console = Console(highlight=False)
    console.print(
        f"{result.designs} designs, {result.reused} of them finished before; {result.feasible} "
        f"hold every limit, {result.on_front} are on the Pareto front",
        markup=False,
    )
    if result.recommended is not None:
        table = Table("Recommended", "", box=None, pad_edge=False)
        for name, value in _lines(result.recommended):
            table.add_row(name, value)
        console.print(table, markup=False)
    console.print(result.why, markup=False)


def _lines(chosen: Recommended) -> list[tuple[str, str]]:
    across, deep, high = chosen.size_mm
    lines = [
        ("rig", chosen.rig),
        ("designed for", chosen.head),
        ("choice", chosen.choice or "as the rig file has it"),
        ("cameras", str(chosen.cameras)),
        ("sigma, median", _mm(chosen.sigma_median_mm)),
        ("sigma, 95 % of points", _mm(chosen.sigma_p95_mm)),
        ("array", f"{across:.0f} mm wide, {high:.0f} high, {deep:.0f} deep"),
    ]
    return lines if chosen.price is None else [*lines, ("price", f"{chosen.price:.2f}")]


def _mm(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g} mm"
