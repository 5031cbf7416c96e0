"""Reconstructions and comparisons as tables on standard output."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from service.kinds.comparison import ComparisonResult
from service.kinds.reconstruction import ReconstructionResult
from service.kinds.trial import TrialResult


def print_reconstruction(result: ReconstructionResult) -> None:
    """What each camera gave, and how sure the points are."""
    rows = [(c.camera, f"{c.tried:,}", f"{c.measured:,}", f"{c.points:,}") for c in result.cameras]
    _print(("camera", "patches", "matched", "points"), rows)
    missing = ", ".join(result.without_pictures) or "none"
    console = Console(highlight=False)
    console.print(
        f"{result.points:,} points, median sigma {result.sigma_median_mm:.4f} mm, median of "
        f"{result.views_median} cameras a point; surface of {result.mesh_area_mm2 / 100.0:.1f} cm2 "
        f"in {result.mesh_faces:,} triangles; cameras without a picture: {missing}",
        markup=False,
    )
    if result.texture is not None:
        console.print(
            f"texture of {result.texture.width_px} x {result.texture.height_px} px; triangles that "
            f"no camera sees whole: {result.texture.unseen_faces:,}",
            markup=False,
        )
    for doubt in result.doubts:
        console.print(doubt.words, markup=False)


def print_comparison(result: ComparisonResult) -> None:
    """The figures of the distances, and how much of the reference was reached."""
    reached = [
        (f"reference within {s.at:g} mm", f"{s.value:.2f} %") for s in result.reached_percent
    ]
    rows = [
        ("points", f"{result.points:,}"),
        ("left out", f"{result.left_out:,}"),
        ("bias", f"{result.bias_mm:+.4f} mm"),
        ("rms", f"{result.rms_mm:.4f} mm"),
        ("median of absolute", f"{result.median_absolute_mm:.4f} mm"),
        *((f"{s.at:g} % within", f"{s.value:.4f} mm") for s in result.percentiles_mm),
        *reached,
        ("alignment", result.align + ("" if result.converged else ", NOT converged")),
    ]
    _print(("distances to the reference", ""), rows)


def print_trial(result: TrialResult) -> None:
    """The regions, predicted against measured, and the verdict."""
    head = ("region", "points", "bias mm", "rms mm", "predicted mm", "measured mm", "ratio")
    rows = [
        (
            r.region,
            f"{r.points:,}",
            f"{r.bias_mm:+.4f}",
            f"{r.rms_mm:.4f}",
            f"{r.predicted_mm:.4f}",
            f"{r.measured_mm:.4f}",
            f"{r.ratio:.2f}",
        )
        for r in result.regions
    ]
    _print(head, rows)
    Console(highlight=False).print(result.verdict, markup=False)


def _print(head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    table = Table(box=None, pad_edge=False)
    for number, title in enumerate(head):
        table.add_column(title, justify="right" if number else "left")
    for row in rows:
        table.add_row(*row)
    Console(highlight=False).print(table, markup=False)
