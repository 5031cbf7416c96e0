"""The acceptance test on paper: a certificate-like PDF that claims no conformity."""

from __future__ import annotations

import io
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import escape

import numpy as np

from calibration.acceptance.lines import Acceptance, Outcome

if TYPE_CHECKING:
    from reportlab.graphics.shapes import Drawing
    from reportlab.platypus import Flowable

COLOURS = {Outcome.PASSED: "#1a7f37", Outcome.FAILED: "#b42318", Outcome.INCOMPLETE: "#9a6700"}
DISCLAIMER = (
    "Made in the style of VDI/VDE 2634 part 1 at the scale of a face. It claims no conformity with "
    "that guideline and is not a calibration certificate of an accredited laboratory."
)


@dataclass(frozen=True)
class Heading:
    """What stands on top. All may be empty; times are UTC as text."""

    rig: str = ""
    calibration: str = ""
    artefact: str = ""
    operator: str = ""
    made_utc: str = ""
    temperature_degc: float | None = None


def certificate_pdf(acceptance: Acceptance, heading: Heading | None = None) -> bytes:
    """The certificate as a PDF, A4. The same test gives the same bytes."""
    # Imported late: a third of a second, which only a certificate needs.
    from reportlab.lib.pagesizes import A4
    from reportlab.lib.styles import getSampleStyleSheet
    from reportlab.lib.units import mm
    from reportlab.platypus import Paragraph, SimpleDocTemplate, Spacer

    styles = getSampleStyleSheet()
    sheet = io.BytesIO()
    document = SimpleDocTemplate(
        sheet,
        pagesize=A4,
        leftMargin=20 * mm,
        rightMargin=20 * mm,
        topMargin=18 * mm,
        bottomMargin=18 * mm,
        title="Length acceptance test",
        author="Rigwright",
        # Without it the file would carry its own time and a random id.
        invariant=1,
    )
    colour = COLOURS[acceptance.outcome]
    story: list[Flowable] = [
        Paragraph("Length acceptance test", styles["Title"]),
        _facts(acceptance, heading or Heading()),
        Spacer(1, 5 * mm),
        Paragraph(
            f'<font color="{colour}"><b>{acceptance.outcome.value.upper()}</b></font>',
            styles["Heading1"],
        ),
        Paragraph(escape(acceptance.sentence), styles["BodyText"]),
    ]
    story += [
        Paragraph(escape(line), styles["BodyText"])
        for line in acceptance.missing + acceptance.notes
    ]
    story += [Spacer(1, 4 * mm), _plot(acceptance), Spacer(1, 4 * mm), _table(acceptance)]
    story += [Spacer(1, 6 * mm), Paragraph(DISCLAIMER, styles["Italic"])]
    document.build(story)
    return sheet.getvalue()


def _facts(acceptance: Acceptance, heading: Heading) -> Flowable:
    from reportlab.platypus import Table

    limit, volume = acceptance.limit, acceptance.volume
    degrees = "" if heading.temperature_degc is None else f"{heading.temperature_degc:.1f} degC"
    rows = [
        ("Rig", heading.rig),
        ("Calibration", heading.calibration),
        ("Artefact", heading.artefact),
        ("Operator", heading.operator),
        ("Made (UTC)", heading.made_utc),
        ("Temperature", degrees),
        ("Volume", f"{volume.width_mm:g} x {volume.height_mm:g} x {volume.depth_mm:g} mm"),
        (
            "Limit",
            f"E = {limit.a_um:g} um + {limit.k_um_per_m:g} um/m x L, at most {limit.b_um:g} um",
        ),
        ("Largest error", f"{acceptance.largest_um:.1f} um"),
        ("Root mean square", f"{acceptance.rms_um:.1f} um"),
        (
            "Scale",
            f"{acceptance.scale_ppm:+.1f} ppm (sigma {acceptance.scale_sigma_ppm:.1f}); "
            f"{acceptance.rms_after_scale_um:.1f} um rms without it",
        ),
    ]
    shown = [(label, value) for label, value in rows if value]
    return Table(shown, colWidths=(110, 370), style=[("FONTSIZE", (0, 0), (-1, -1), 9)])


def _table(acceptance: Acceptance) -> Flowable:
    from reportlab.lib import colors
    from reportlab.platypus import Table

    head = ("Line", "Length", "calibrated, mm", "error, um", "sigma, um", "limit, um", "state")
    lines = {name: k for k, name in enumerate(dict.fromkeys(m.line for m in acceptance.lengths), 1)}
    rows = [
        (
            f"{lines[m.line]}: {m.line}",
            f"{m.first} - {m.second}",
            f"{m.calibrated_mm:.4f}",
            f"{m.error_um:+.1f}",
            f"{m.sigma_um:.1f}",
            f"{m.limit_um:.1f}",
            "within" if m.within else "beyond",
        )
        for m in acceptance.lengths
    ]
    style: list[tuple[Any, ...]] = [
        ("FONTSIZE", (0, 0), (-1, -1), 7.5),
        ("ALIGN", (2, 0), (5, -1), "RIGHT"),
        ("LINEBELOW", (0, 0), (-1, 0), 0.6, colors.black),
        ("TOPPADDING", (0, 0), (-1, -1), 1),
        ("BOTTOMPADDING", (0, 0), (-1, -1), 1),
    ]
    bad = [k + 1 for k, m in enumerate(acceptance.lengths) if not m.within]
    style += [("TEXTCOLOR", (0, k), (-1, k), colors.HexColor(COLOURS[Outcome.FAILED])) for k in bad]
    return Table([head, *rows], repeatRows=1, style=style)


def _plot(acceptance: Acceptance) -> Drawing:
    """Errors over lengths between the limits."""
    from reportlab.graphics.shapes import Circle, Drawing, Line, PolyLine, String
    from reportlab.lib.colors import HexColor, grey

    width, height, pad = 480.0, 150.0, 28.0
    longest = max(m.calibrated_mm for m in acceptance.lengths) * 1.05
    top = 1.15 * max(acceptance.largest_um, max(m.limit_um for m in acceptance.lengths))

    def place(length_mm: float, error_um: float) -> tuple[float, float]:
        x = pad + (width - 2.0 * pad) * length_mm / longest
        return x, height / 2.0 + (height / 2.0 - 14.0) * error_um / top

    drawing = Drawing(width, height)
    drawing.add(Line(*place(0.0, 0.0), *place(longest, 0.0), strokeColor=grey))
    for sign in (1.0, -1.0):
        points = [place(x, sign * acceptance.limit.at(x)) for x in np.linspace(0.0, longest, 50)]
        flat = [v for point in points for v in point]
        drawing.add(PolyLine(flat, strokeColor=HexColor(COLOURS[Outcome.FAILED])))
    for m in acceptance.lengths:
        x, y = place(m.calibrated_mm, m.error_um)
        colour = COLOURS[Outcome.PASSED if m.within else Outcome.FAILED]
        drawing.add(Circle(x, y, 2.0, fillColor=HexColor(colour), strokeWidth=0))
    drawing.add(String(0, height - 9, f"error: {top:+.0f} um at the top", fontSize=7))
    drawing.add(String(0, 12, f"{-top:+.0f} um at the foot; red: the limit", fontSize=7))
    for tick in range(0, int(longest) + 1, 50 * math.ceil(longest / 500.0)):
        x, middle = place(float(tick), 0.0)
        drawing.add(Line(x, middle - 2.0, x, middle + 2.0, strokeColor=grey))
        drawing.add(String(x, 2, f"{tick} mm", fontSize=7, textAnchor="middle"))
    return drawing
