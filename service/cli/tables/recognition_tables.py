"""What recognition says, in a few lines on standard output."""

from __future__ import annotations

from pathlib import Path

import typer

from service.kinds.recognition import (
    EnrolmentResult,
    StatedRates,
    TrainingResult,
    VerificationResult,
)


def print_training(result: TrainingResult, out: Path) -> None:
    """Whom it was trained on, what was left out, how often it errs."""
    typer.echo(f"{result.persons} persons, {result.captures} captures")
    for head in result.left_out:
        typer.echo(f"left out: {head.name}: {head.why}")
    typer.echo(_rates(result.rates))
    typer.echo(f"equal error rate {_percent(result.rates.equal_error)}")
    typer.echo(f"model: {out}")


def print_enrolment(result: EnrolmentResult, gallery: Path) -> None:
    """Who is in the gallery now."""
    typer.echo(
        f"{result.name}: {result.captures} captures; {_measured(result.measured_share)}, "
        f"{result.regions} regions"
    )
    typer.echo(f"gallery: {gallery}, {result.persons} persons")


def print_verification(result: VerificationResult) -> None:
    """The verdict, and how far it can be trusted."""
    verdict = "the same person" if result.same else "not the same person"
    typer.echo(
        f"{result.name}: {verdict}; {_percent(result.score)} of {result.regions} regions say so, "
        f"more than {_percent(result.rates.threshold)} are needed; "
        f"{_measured(result.measured_share)}"
    )
    typer.echo(_rates(result.rates))


def _measured(share: float) -> str:
    return f"{_percent(share)} of the face was measured"


def _rates(rates: StatedRates) -> str:
    least = 3.0 / max(rates.impostors, 1)
    few = f" (fewer than {_percent(least)} cannot be shown)" if rates.false_match < least else ""
    return (
        f"on persons left out of the training: false matches {_percent(rates.false_match)} of "
        f"{rates.impostors:,}{few}, false non-matches {_percent(rates.false_non_match)} of "
        f"{rates.genuines:,}"
    )


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %"
