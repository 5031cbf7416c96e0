"""The page of a reconstruction and that of a comparison."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from common.page.document import drawn_page, still_page, style_sheet
from common.page.html import esc, section, text_table
from evaluation.comparison.comparing import Comparison
from evaluation.reconstruction.reconstructing import Reconstruction
from evaluation.reconstruction.surface import SurfaceMesh
from evaluation.report.pictures import SIDES, blue_to_red, low_to_high, png_data_uri, splat
from evaluation.report.surfacefigure import surface_figure
from geometry.arrays import Floats


def reconstruction_page(
    done: Reconstruction, shown: SurfaceMesh, title: str, notes: Sequence[str] = ()
) -> str:
    """The surface to turn, the cloud from three sides, and what each camera gave.

    ``shown`` is the surface with few enough faces for a page. Both have their colours and sigma.
    """
    cloud = done.cloud
    scale_mm = float(np.percentile(cloud.sigma_mm, 98.0))
    rows = [[c.name, f"{c.tried:,}", f"{c.measured:,}", f"{c.points:,}"] for c in done.cameras]
    told = "".join(f"<p>{esc(note)}</p>" for note in notes)
    header = (
        f"<h1>{esc(title)}</h1><p>{len(cloud):,} points, median sigma "
        f"{np.median(cloud.sigma_mm):.3f} mm, median number of cameras "
        f"{int(np.median(cloud.views))}.</p>{told}"
    )
    main = (
        section(
            "surface",
            "The surface",
            "Drag to turn, scroll to come nearer. Red lines are the rims of what was measured: "
            "nothing is made up beyond them.",
            '<div id="surface-3d"></div>',
        )
        + section("colours", "The points", "", _three(cloud.points_mm, cloud.colours))
        + section(
            "sigma",
            "How sure they are",
            f"Standard deviation along the normal: green 0, yellow {scale_mm / 2:.3f} mm, "
            f"red {scale_mm:.3f} mm and more.",
            _three(cloud.points_mm, low_to_high(cloud.sigma_mm, scale_mm)),
        )
        + section(
            "cameras",
            "What each camera gave",
            "Patches tried, patches that matched, and points that the others left standing.",
            text_table(["camera", "tried", "matched", "points"], rows),
        )
    )
    figure = str(surface_figure(shown, scale_mm).to_json())
    return drawn_page(
        title,
        header=header,
        main=main,
        footer="",
        style=style_sheet() + STYLE,
        figures='{"figure": ' + figure + "}",
        script=files("evaluation.report").joinpath("surface.js").read_text(encoding="utf-8"),
        view={"points": len(cloud), "faces": len(shown.faces)},
    )


def comparison_page(done: Comparison, title: str, scale_mm: float) -> str:
    """The distances from three sides, blue to red, their histogram and all figures."""
    f = done.figures
    body = (
        f"<header><h1>{esc(title)}</h1><p>rms {f.rms_mm:.3f} mm over {f.points:,} points.</p>"
        f"</header><main>{comparison_sections(done, scale_mm)}</main>"
    )
    return still_page(title, body, style_sheet() + STYLE)


def comparison_sections(done: Comparison, scale_mm: float) -> str:
    """What a page tells of a comparison, as sections."""
    f = done.figures
    rows = [
        ["points", f"{f.points:,}"],
        ["left out (farther than the limit)", f"{f.left_out:,}"],
        ["bias", f"{f.bias_mm:+.4f} mm"],
        ["rms", f"{f.rms_mm:.4f} mm"],
        ["median of the absolute distances", f"{f.median_absolute_mm:.4f} mm"],
        ["median absolute deviation", f"{f.mad_mm:.4f} mm"],
        *([f"{p:g} % within", f"{v:.4f} mm"] for p, v in f.percentiles_mm),
        *([f"reference within {r:g} mm of a point", f"{v:.2f} %"] for r, v in f.reached_percent),
        ["points per square millimetre", f"{f.points_per_mm2:.2f}"],
        ["alignment", f"{done.alignment.how}, scale {done.alignment.scale:.6f}"],
    ]
    return (
        section(
            "distances",
            "Distance to the reference",
            f"Blue {scale_mm:g} mm inside, red {scale_mm:g} mm outside.",
            _three(done.points_mm, blue_to_red(done.distances_mm, scale_mm)),
        )
        + section("histogram", "How they spread", "", _histogram(done.distances_mm, scale_mm))
        + section("figures", "Figures", "", text_table(["figure", "value"], rows))
    )


def _three(points_mm: Floats, colours: NDArray[np.uint8]) -> str:
    figures = (
        f'<figure><img alt="{esc(name)}" src="{png_data_uri(splat(points_mm, colours, azimuth))}">'
        f"<figcaption>{esc(name)}</figcaption></figure>"
        for name, (azimuth, _) in SIDES.items()
    )
    return f'<div class="sides">{"".join(figures)}</div>'


def _histogram(distances_mm: Floats, scale_mm: float) -> str:
    counts, edges = np.histogram(distances_mm, bins=60, range=(-scale_mm, scale_mm))
    top = max(int(counts.max()), 1)
    bars = "".join(
        f'<rect x="{10 * k}" y="{160 - 150 * c / top:.1f}" width="9" height="{150 * c / top:.1f}"/>'
        for k, c in enumerate(counts)
    )
    ends = (
        f'<text x="0" y="178">{edges[0]:g} mm</text>'
        f'<text x="300" y="178" text-anchor="middle">0</text>'
        f'<text x="600" y="178" text-anchor="end">{edges[-1]:g} mm</text>'
    )
    return (
        '<svg class="histogram" viewBox="0 0 600 185" role="img" '
        f'aria-label="Histogram of the distances">{bars}{ends}</svg>'
    )


STYLE = """
#surface-3d { height: 70vh; min-height: 420px; }
.sides { display: flex; flex-wrap: wrap; gap: 1rem; }
.sides figure { margin: 0; flex: 1 1 260px; max-width: 420px; }
.sides img { width: 100%; height: auto; border-radius: 6px; }
.histogram { max-width: 700px; width: 100%; fill: currentColor; font-size: 13px; }
"""
