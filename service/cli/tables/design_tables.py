"""Results as tables on standard output."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from common.words import percent_cut
from rig.design.designmodel import ConstraintFigures
from service.kinds.design import DesignResult
from service.kinds.evaluation import EvaluationResult


def _number(value: float | None, unit: str = "") -> str:
    return "-" if value is None else f"{value:.4g}{' ' if unit else ''}{unit}"


def _share(value: float | None) -> str:
    return "-" if value is None else percent_cut(value)


def print_figures(result: EvaluationResult, start_cost_mm2: float | None = None) -> None:
    """The figures of a design, which has the start's cost as well, or of an evaluation."""
    table = Table("Figure", "Value", title="Quality", title_justify="left")
    table.add_row("cost, mean |Q|", _number(result.cost_mm2, "mm\u00b2"))
    if start_cost_mm2 is not None:
        table.add_row("the same at the start", _number(start_cost_mm2, "mm\u00b2"))
    for label, sigma_mm in (
        ("sigma, median", result.sigma_median_mm),
        ("sigma, 95 % of points", result.sigma_p95_mm),
        ("sigma, largest", result.sigma_max_mm),
    ):
        table.add_row(label, _number(sigma_mm, "mm"))
    for row in result.coverage:
        table.add_row(f"points seen by {row.views} or more", _share(row.share))
    table.add_row("views in focus", _share(result.in_focus_share))
    table.add_row("views in frame", _share(result.in_frame_share))
    table.add_row(
        "points in a matchable pair, of those that can be", _share(result.matchable_share)
    )
    table.add_row("groups of cameras that match", _groups(result.groups))
    bound = result.bound if isinstance(result, DesignResult) else None
    if bound is not None:
        table.add_row("no network on the grid is below", _number(bound.lower_mm2, "mm\u00b2"))
        table.add_row("could be gained at most", _share(bound.gap_share))
        table.add_row("points that no two places see", _share(bound.unseen_share))
    Console().print(table)


def _groups(groups: list[list[str]] | None) -> str:
    """How many cameras each group has, where there are several."""
    if groups is None:
        return "-"
    sizes = " + ".join(str(len(group)) for group in groups)
    return "1" if len(groups) == 1 else f"{len(groups)}: {sizes} cameras"


def print_notes(result: EvaluationResult) -> None:
    """What was inferred or changed to read the scan and find the face."""
    console = Console(highlight=False)
    for note in result.notes:
        console.print(f"{note.kind}: {note.text}", markup=False)


def print_limits(constraints: Iterable[ConstraintFigures]) -> None:
    """The tightest row of each kind of limit."""
    tightest: dict[str, ConstraintFigures] = {}
    for row in constraints:
        family = row.name.split("/", 1)[0]
        known = tightest.get(family)
        if known is None or _rank(row) < _rank(known):
            tightest[family] = row
    table = Table(
        "Limit, where tightest", "Value", "", "Limit", "State", title="Limits", title_justify="left"
    )
    for row in tightest.values():
        state = "broken" if not row.satisfied else "binds" if row.active else "holds"
        table.add_row(
            escape(row.name),
            _number(row.value, row.unit),
            row.sense,
            _asked(row),
            state,
        )
    Console().print(table)


def _asked(row: ConstraintFigures) -> str:
    """The limit; that of an equality with its tolerance, which slack and deviation add up to."""
    words = _number(row.limit)
    if row.sense != "==" or row.value is None or row.limit is None or row.slack is None:
        return words
    tolerance = row.slack + abs(row.value - row.limit)
    return f"{words} \u00b1 {_number(tolerance)}" if tolerance > 1e-9 else words


def _rank(row: ConstraintFigures) -> tuple[bool, bool, float]:
    slack = row.slack
    return row.satisfied, not row.active, slack if slack is not None else 0.0


def print_conflicts(result: DesignResult) -> None:
    """Which limits contradict each other, and by how much each would have to give way."""
    table = Table(
        "Limit",
        "gives way by",
        "if it alone gave way",
        title="Limits in conflict",
        title_justify="left",
    )
    for row in result.conflicts:
        alone = row.give_alone
        table.add_row(
            escape(row.family),
            _number(row.give, row.unit),
            "not enough" if alone is None else _number(alone, row.unit),
        )
    Console().print(table)


def print_files(files: dict[str, Path]) -> None:
    """Where everything was written, one path per line and unwrapped, so that it can be copied."""
    print("Written:")  # noqa: T201 - the result of the command
    for path in files.values():
        print(f"  {path}")  # noqa: T201
