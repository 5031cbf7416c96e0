"""Residuals over an image as a drawing."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from calibration.adjustment.residualgrid import GridCell
from common.page.svg import FAINT, INK, dot, drawing, line

ARROW_SHARE = 0.11
"""Length of the longest arrow, as a share of the image's width."""


def residual_plot(grid: Sequence[GridCell], size_px: tuple[int, int], name: str) -> str:
    """Mean residuals over a camera's image as arrows, with the scale of the longest."""
    width, height = size_px
    unit = width / 100.0
    # No arrow is longer: none is cut at the edge of the drawing.
    room = ARROW_SHARE * width
    parts = [
        f'<rect x="{room:.1f}" y="{room:.1f}" width="{width}" height="{height}" fill="none" '
        f'stroke="{FAINT}" stroke-width="{unit:.1f}"/>'
    ]
    longest = max((float(np.hypot(c.dx_px, c.dy_px)) for c in grid), default=0.0)
    scale = ARROW_SHARE * width / max(longest, 1e-9)
    for cell in grid:
        x, y = cell.x_px + room, cell.y_px + room
        tip = x + scale * cell.dx_px, y + scale * cell.dy_px
        parts.append(line(x, y, *tip, INK, 0.45 * unit))
        parts.append(dot(x, y, 0.7 * unit, INK))
    label = f"{name}: longest arrow {longest:.3f} px"
    return (
        drawing(width + 2.0 * room, height + 2.0 * room, parts, label)
        + f"<figcaption>{escape(label)}</figcaption>"
    )
