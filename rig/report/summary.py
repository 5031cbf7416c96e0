"""The top of the report: what it is about, the verdict, and the figures asked for first."""

from __future__ import annotations

import math

from common.page.html import element, esc, figure_text, percent
from rig.design.layout import Layout
from rig.report import tables
from rig.report.words import family_words
from solver.result import Design, Quality

CONTENTS = (
    ("rig", "Rig"),
    ("accuracy", "Accuracy"),
    ("ellipsoids", "Ellipsoids"),
    ("images", "Images"),
    ("limits", "Limits"),
    ("cameras", "Cameras"),
    ("mounts", "Mounts"),
    ("solver", "Solver"),
    ("scan", "Scan"),
)


def heading(title: str, scan_name: str, design: Design) -> str:
    """Title, one line about what it is, and the way to the sections."""
    fixed = sum(camera.fixed for camera in design.cameras)
    kinds = sorted({camera.camera.name for camera in design.cameras})
    words = f"{len(design.cameras)} cameras ({', '.join(kinds)})"
    words += f", {fixed} of them fixed" if fixed else ""
    words += f", designed for {scan_name}" if scan_name else ""
    links = "".join(element("a", esc(name), href=f"#{key}") for key, name in CONTENTS)
    return f"<h1>{esc(title)}</h1><p>{esc(words)}</p><nav>{links}</nav>"


def verdict(design: Design, layout: Layout) -> str:
    """The one sentence a reader wants first."""
    rows = design.quality.constraints
    broken, binding = design.quality.violated, [r for r in rows if r.satisfied and r.active]
    if broken:
        names = sorted({family_words(row.family)[0] for row in broken})
        word = f"{len(broken)} of {len(rows)} limits are broken: {', '.join(names)}."
        more = (
            "This is the nearest design that was found. The solver section says which limits "
            "contradict each other and by how much each would have to give way."
        )
    else:
        word = f"All {len(rows)} limits hold."
        names = sorted({family_words(row.family)[0] for row in binding})
        more = f"What shapes the design: {'; '.join(names)}." if names else "No limit binds."
    if layout.collisions:
        more += f" The layout check lists {len(layout.collisions)} collisions: see Mounts."
    css = "verdict broken" if broken or layout.collisions else "verdict"
    return (
        f'<div class="{css}"><p class="word">{esc(word)}</p><p class="more">{esc(more)}</p></div>'
    )


def _tile(name: str, figure: str, note: str) -> str:
    css = "figure long" if len(figure) > 8 and "<" not in figure else "figure"
    return (
        f'<div class="tile"><div class="name">{esc(name)}</div>'
        f'<div class="{css}">{figure}</div><div class="note">{esc(note)}</div></div>'
    )


def tiles(design: Design, layout: Layout) -> str:
    """The figures that are asked for first."""
    quality, before = design.quality, design.start_quality.sigma_median_mm
    two, three = (percent(tables.share_seen(quality, views)) for views in (2, 3))
    gsd = quality.cameras.gsd_mm[:, 1]
    mean_gsd = float(gsd[gsd == gsd].mean()) if (gsd == gsd).any() else math.nan
    frame, sigma = percent(quality.in_frame_share), quality.sigma_median_mm
    largest = figure_text(quality.sigma_max_mm)
    parts = (
        _tile("Median error σ", _mm(sigma), f"{figure_text(before)} mm at the start"),
        _tile("95 % of points below", _mm(quality.sigma_p95_mm), f"largest {largest} mm"),
        _tile("Seen by two or more", two, f"by three or more: {three}"),
        _tile("Sharp", percent(quality.in_focus_share), f"in frame: {frame}"),
        _tile("Can be matched", percent(quality.matchable.share(1)), _groups(quality)),
        _tile("Pixel on the subject", _mm(mean_gsd), "mean over the cameras"),
        _tile("Room the array takes", *_room(layout)),
    )
    return f'<div class="tiles">{"".join(parts)}</div>'


def _groups(quality: Quality) -> str:
    count = len(quality.matchable.groups)
    return "all cameras are one group" if count == 1 else f"the cameras are {count} groups"


def _mm(value: float) -> str:
    return f"{figure_text(value)} <small>mm</small>"


def _room(layout: Layout) -> tuple[str, str]:
    """Envelope of the array, in metres when it is as large as a hall."""
    size = layout.envelope_size_mm
    if size.max() >= 10_000.0:
        return " × ".join(f"{v / 1000.0:.1f}" for v in size), "m: width, depth, height"
    return " × ".join(f"{v:.0f}" for v in size), "mm: width, depth, height"
