"""A mount plan as tables on standard output."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from common.words import of_limits, percent_cut
from service.kinds.plan import PlanPrice, PlanResult


def _figure(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _loss(share: float | None) -> str:
    return "-" if share is None else f"{100.0 * share:+.2f} %"


def print_plan(result: PlanResult) -> None:
    """What is built, what it costs in accuracy, and how exact it must be."""
    console = Console(highlight=False)
    console.print(
        f"{escape(result.system)}: {result.members} members "
        f"({result.member_length_mm / 1000.0:.2f} m), {result.plates} plates, "
        f"{result.wedges} printed wedges, {result.parts} bought parts"
    )
    _print_price(console, result.price)
    _print_tolerances(console, result)
    for clash in result.clashes:
        console.print(
            f"clash ({clash.kind}): {clash.one} - {clash.other}, "
            f"{_figure(clash.clearance_mm, 1)} mm of {_figure(clash.required_mm, 1)} mm",
            markup=False,
        )
    _print_sags(console, result)
    _print_stances(console, result)
    for note in result.notes:
        console.print(f"note: {note}", markup=False)


def _print_sags(console: Console, result: PlanResult) -> None:
    if not result.sags:
        return
    most = max(result.sags, key=lambda sag: sag.leans_deg or 0.0)
    console.print(
        f"under its own weight {most.camera} leans most, by {_figure(most.leans_deg, 2)} degrees; "
        f"a touch of 5 N turns it by {_figure(most.touched_deg, 2)}",
        markup=False,
    )


def _print_stances(console: Console, result: PlanResult) -> None:
    if not result.stances:
        return
    weakest = min(result.stances, key=lambda stance: stance.tips_n or 0.0)
    console.print(
        f"a push of {_figure(weakest.tips_n, 0)} N at the height of the head tips it, "
        f"{_figure(weakest.push_n, 0)} N are asked",
        markup=False,
    )


def _print_price(console: Console, price: PlanPrice) -> None:
    table = Table(
        *("", "Sigma, median mm", "2+ views", "3+ views", "Limits"),
        title="What building costs",
        title_justify="left",
    )
    stages = (
        ("as designed", price.designed),
        ("each setting rounded", price.rounded),
        ("re-optimised: as built", price.built),
    )
    for label, row in stages:
        table.add_row(
            label,
            _figure(row.sigma_median_mm, 5),
            percent_cut(row.coverage_2_views),
            percent_cut(row.coverage_3_views),
            "kept" if row.feasible else f"{len(row.broken) or 'some'} broken",
        )
    console.print(table)
    for label, row in stages:
        if row.broken:
            console.print(f"broken {label}: {of_limits(row.broken)}", markup=False)
    console.print(
        f"loss of median sigma {_loss(price.sigma_loss)}, of coverage {_loss(price.coverage_loss)}"
    )


def _print_tolerances(console: Console, result: PlanResult) -> None:
    table = Table(
        *("Setting", "Camera", "May be off by", "Then breaks"),
        title="Tightest settings",
        title_justify="left",
    )
    for row in result.tightest:
        least = [value for value in (row.plus, row.minus) if value is not None]
        off = f"{min(least):.2f} {row.unit}" if least else "more than was tried"
        table.add_row(escape(row.setting), escape(row.camera), off, escape(row.limit))
    console.print(table)
    share = result.yield_share
    if share is not None:
        console.print(
            f"{100.0 * share:.0f} % of {result.yield_trials} rigs built with every setting off "
            "by up to half a step keep all limits"
        )
