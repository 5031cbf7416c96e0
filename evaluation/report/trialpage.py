"""The page of a trial: the verdict, the regions of the face, the distances."""

from __future__ import annotations

from collections.abc import Sequence

from common.page.document import still_page, style_sheet
from common.page.html import esc, section, text_table
from evaluation.report.pages import STYLE, comparison_sections
from evaluation.trial.trying import Trial


def trial_page(done: Trial, title: str, verdict: str, facts: Sequence[str], scale_mm: float) -> str:
    """``verdict`` in one sentence, ``facts`` about what was tried, then all figures."""
    head = ["region", "points", "bias mm", "rms mm", "predicted mm", "measured mm", "ratio"]
    rows = [
        [
            r.name,
            f"{r.points:,}",
            f"{r.bias_mm:+.4f}",
            f"{r.rms_mm:.4f}",
            f"{r.predicted_mm:.4f}",
            f"{r.measured_mm:.4f}",
            f"{r.ratio:.2f}",
        ]
        for r in done.regions
    ]
    told = "".join(f"<p>{esc(fact)}</p>" for fact in facts)
    body = (
        f"<header><h1>{esc(title)}</h1><p><strong>{esc(verdict)}</strong></p>{told}</header><main>"
        + section(
            "regions",
            "Predicted and measured",
            "Predicted: median sigma of the points. Measured: their robust scatter about the "
            "surface that was photographed. A ratio of 1 says that the sigmas are true; above 1 "
            "they are too careful, below 1 too bold.",
            text_table(head, rows),
        )
        + comparison_sections(done.comparison, scale_mm)
        + "</main>"
    )
    return still_page(title, body, style_sheet() + STYLE)
