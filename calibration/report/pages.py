"""HTML pages that a technician understands: the verdict first, then why."""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib.resources import files

from calibration.adjustment.result import Calibration
from calibration.check.verdicts import CameraCheck, CheckResult, Kind, Light
from calibration.files.calibrationfile import CalibrationRecord
from calibration.files.records import CheckRecord
from calibration.report.history import History, explained, history_svg
from calibration.report.network import network_figures, turning_figure, values_table
from calibration.report.residualplot import residual_plot
from calibration.report.views import DetectionView, views_figures
from common.page.document import drawn_page, still_page
from common.page.html import esc, table, text_table
from common.page.svg import GREEN, RED, YELLOW, Series, chart

STYLE = """
body{font:15px/1.5 system-ui,sans-serif;color:#1f2933;max-width:1000px}
body{margin:2rem auto;padding:0 1rem}
h1{font-size:1.5rem}h2{font-size:1.1rem;margin-top:2rem}
.table{overflow-x:auto}table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums}
th,td{padding:.25rem .5rem;text-align:right;border-bottom:1px solid #e2e8ee}
th:first-child,td:first-child{text-align:left}th{font-weight:600;vertical-align:bottom}
tr.bad td{background:#fdecea;font-weight:600}
.light{display:inline-block;width:1.6rem;height:1.6rem;border-radius:50%;vertical-align:middle}
.finding{border-left:.35rem solid;padding:.4rem .8rem;margin:.6rem 0;background:#f6f8fa}
.plots{display:flex;flex-wrap:wrap;gap:1rem}.plots figure{width:300px;margin:0}
#network-3d{height:480px}
figcaption,small,.note{color:#52606d;font-size:.85rem}svg{max-width:100%;height:auto}
"""
UNSEEN = (
    "A camera has no point where a check did not see it, or where it is fine and its test answers "
    "only to what was found of another."
)
COLOURS = {Light.GREEN: GREEN, Light.YELLOW: YELLOW, Light.RED: RED}
HEADLINES = {
    Light.GREEN: "Fine: go on working",
    Light.YELLOW: "Look before you go on",
    Light.RED: "Stop: something has changed",
}

NEXT = {
    Light.GREEN: "Next: work, and check again tomorrow.",
    Light.YELLOW: "Next: look at what is named above, then check again.",
    Light.RED: "Next: put right what is named above and check again. Nobody puts a camera back to "
    "a hundredth of a millimetre by hand: where one moved, calibrate anew and check against that.",
}


def number(value: float, digits: int = 3) -> str:
    """A number with so many significant digits, thousands apart, a dash for none."""
    if value != value:
        return "-"
    short = f"{value:.{digits}g}"
    return f"{float(short):,.0f}" if 10.0**digits <= abs(value) < 1e9 else short


def light(colour: Light) -> str:
    """A traffic light's lamp, with its word for those who do not see it."""
    style = f"background:{COLOURS[colour]}"
    return f'<span class="light" role="img" aria-label="{colour.value}" style="{style}"></span>'


def finding(sentence: str, colour: str) -> str:
    """A sentence with a coloured edge."""
    return f'<div class="finding" style="border-color:{colour}">{esc(sentence)}</div>'


def check_page(record: CheckRecord, reference: Calibration | None = None, history: str = "") -> str:
    """One check: light, findings, cameras, carriers, lengths, residuals.

    ``reference`` gives the image sizes for the residual plots; without it there are none.
    ``history``: the file beside it that shows the checks over time, if there is one.
    """
    result = record.result
    title = f"Calibration check {record.made_utc}".strip()
    parts = [
        f"<h1>{light(result.light)} {esc(HEADLINES[result.light])}</h1>",
        f"<p>Compared with the calibration {esc(record.reference or 'without a name')}. "
        f"Checked {esc(record.made_utc or 'at a time that is not known')}.</p>",
        *([f'<p><a href="{esc(history)}">All checks over time</a></p>'] if history else []),
        *(finding(f.sentence, COLOURS[f.light]) for f in result.findings),
        *(f'<p class="note">{esc(note)}</p>' for note in result.notes),
        f"<p>{esc(NEXT[result.light])}</p>",
        "<h2>Cameras</h2>",
        _camera_table(result.cameras),
        f'<p class="note">Test: the pose test over its limit, an alarm above 1 unless a finding '
        "explains it: points tie the cameras together, so where one moves others' tests answer. "
        "Effect: root mean square over what the camera saw, in mm at the subject; a sentence "
        "above gives the largest over a face. Could hide: what points at the subject may be "
        "off without this check seeing it; smallest turn and shift: what "
        "it could have seen of a movement (Baarda, delta0 4.13); "
        f"{result.power95_factor:.1f} times as much is reported in 95 of 100 checks.</p>",
        "<h2>Targets</h2>",
        _carrier_table(result),
    ]
    if result.lengths:
        parts += ["<h2>Measured distances</h2>", _length_table(result)]
    if reference is not None:
        parts += ["<h2>Residuals over the images</h2>", _residuals(result.cameras, reference)]
    parts.append(
        f'<p class="note">{result.points} image points in {result.frames} frames, chi-square '
        f"{result.chi2:.0f} of {result.dof}, {result.rms_px:.3f} px rms; scale "
        f"{result.scale_ppm:+.1f} ppm (sigma {result.scale_sigma_ppm:.1f}); a false alarm in "
        f"{1.0 / result.alpha:.0f} checks at most.</p>"
    )
    return still_page(title, "".join(parts), STYLE)


def _camera_table(cameras: tuple[CameraCheck, ...]) -> str:
    head = (
        "camera",
        "verdict",
        "points",
        "rms px",
        "noise",
        "test",
        "effect mm",
        "effect px",
        "could hide mm",
        "smallest turn urad",
        "smallest shift um",
    )
    rows = []
    for c in cameras:
        sees = c.sensitivity
        turn = max(sees.turn_urad[:2]) if sees else float("nan")
        shift = max(sees.shift_um) if sees else float("nan")
        hidden = sees.hidden_mm if sees else float("nan")
        told = c.verdict.words + (f" ({c.reason})" if c.verdict is Kind.CANNOT_TELL else "")
        numbers = (
            c.rms_px,
            c.noise_factor,
            c.effect_mm,
            c.effect_px,
            hidden,
            turn,
            shift,
        )
        figures = [number(v) for v in numbers]
        load = "explained" if explained(c) else number(c.pose_statistic / c.pose_limit)
        rows.append((c.name, told, str(c.points), *figures[:2], load, *figures[2:]))
    marks = ["" if c.verdict is Kind.FINE else "bad" for c in cameras]
    return _marked(head, rows, marks)


def _marked(head: Sequence[str], rows: Sequence[Sequence[str]], marks: Sequence[str]) -> str:
    cells = ([esc(cell) for cell in row] for row in rows)
    return table([esc(cell) for cell in head], cells, row_css=marks)


def _carrier_table(result: CheckResult) -> str:
    head = ("carrier", "verdict", "points", "rms px", "scale ppm", "sigma ppm", "worst target")
    return _marked(
        head,
        [
            (
                c.name,
                c.verdict.words,
                str(c.points),
                number(c.rms_px),
                number(c.scale_ppm),
                number(c.scale_sigma_ppm),
                c.worst_target,
            )
            for c in result.carriers
        ],
        ["" if c.verdict is Kind.FINE else "bad" for c in result.carriers],
    )


def _length_table(result: CheckResult) -> str:
    return text_table(
        ("distance", "length mm", "error um", "sigma um", "error / sigma"),
        (
            (
                f"{m.first} - {m.second}",
                f"{m.length_mm:.3f}",
                f"{m.error_um:+.1f}",
                number(m.sigma_um),
                f"{m.z:+.1f}",
            )
            for m in result.lengths
        ),
    )


def _residuals(cameras: tuple[CameraCheck, ...], reference: Calibration) -> str:
    sizes = {c.name: c.image_size_px for c in reference.cameras}
    plots = (
        f"<figure>{residual_plot(c.grid, sizes[c.name], c.name)}</figure>"
        for c in cameras
        if c.name in sizes and c.grid
    )
    return f'<div class="plots">{"".join(plots)}</div>'


def calibration_page(record: CalibrationRecord, views: Sequence[DetectionView] = ()) -> str:
    """A calibration: how good it is, camera by camera, and what to know of it.

    ``views``: pictures with what was detected, where there are some.
    """
    calibration, name, made_utc = record.calibration, record.name, record.made_utc
    quality = calibration.quality
    colour = Light.YELLOW if quality.warnings else Light.GREEN
    told = "Calibrated" if quality.converged else f"Not converged ({quality.stop.value})"
    if not quality.converged or calibration.doubtful_lenses or quality.unfit_lenses:
        colour = Light.RED
    cross = quality.cross_validation
    facts = [
        ("image points, rms", f"{quality.rms_px:.3f} px"),
        ("chi-square over degrees of freedom", f"{quality.chi2:.0f} / {quality.dof}"),
        ("rejected as blunders", str(quality.rejected)),
        ("size from", quality.scale),
        ("datum", calibration.datum),
        ("cross-validation", "-" if cross is None else f"{cross.ratio:.2f} ({cross.halves})"),
    ]
    rows = [
        (
            c.name,
            str(c.points),
            number(c.rms_px),
            f"{c.coverage:.0%}",
            number(c.sigma_factor),
            number(c.focal_sigma_px),
            number(c.centre_sigma_px),
            number(1e3 * c.position_sigma_mm),
            number(3600.0 * c.rotation_sigma_deg),
        )
        for c in quality.cameras
    ]
    head = (
        "camera",
        "points",
        "rms px",
        "coverage",
        "noise",
        "sigma f px",
        "sigma centre px",
        "sigma place um",
        "sigma turn arcsec",
    )
    plots = "".join(
        f"<figure>{residual_plot(c.grid, k.image_size_px, c.name)}</figure>"
        for c, k in zip(quality.cameras, calibration.cameras, strict=True)
        if c.grid
    )
    return drawn_page(
        f"Calibration {name}".strip(),
        header=f"<h1>{light(colour)} {esc(told)} {esc(name)}</h1><p>{esc(made_utc)}</p>",
        main="".join(
            [
                *(finding(w, COLOURS[colour]) for w in quality.warnings),
                text_table(("", ""), facts),
                "<h2>Cameras</h2>",
                text_table(head, rows),
                "<h2>What was calibrated</h2>",
                values_table(calibration),
                '<div id="network-3d"></div>',
                network_figures(calibration),
                '<p class="note">Green: cameras and which way they look; grey: every place in '
                "which a target was seen. Drag the first figure to turn it.</p>",
                *(["<h2>What was detected</h2>", views_figures(views)] if views else []),
                "<h2>Residuals over the images</h2>",
                f'<div class="plots">{plots}</div>',
            ]
        ),
        footer='<p class="note">Next: check before each day\'s work that the rig is still so, with '
        "a few pictures of the same targets (rigwright check PICTURES --reference FOLDER).</p>",
        style=STYLE,
        figures=json.dumps({"figure": turning_figure(calibration)}, allow_nan=False),
        script=files("calibration.report").joinpath("network.js").read_text(encoding="utf-8"),
        view={"cameras": len(calibration.cameras), "detections": len(views)},
    )


def history_page(history: History) -> str:
    """Checks over time: each camera's way towards its alarm, effects at the subject, scale."""
    effects = [Series(c.name, tuple(1e3 * v for v in c.effect_mm)) for c in history.cameras]
    rows = [
        (time, colour, number(rms), f"{ppm:+.1f}", number(sigma))
        for time, colour, rms, ppm, sigma in zip(
            history.times,
            history.lights,
            history.rms_px,
            history.scale_ppm,
            history.scale_sigma_ppm,
            strict=True,
        )
    ]
    gaps = any(load != load for c in history.cameras for load in c.load)
    return still_page(
        "Calibration checks over time",
        "".join(
            [
                f"<h1>Checks against {esc(history.reference or 'the reference')}</h1>",
                history_svg(history),
                f'<p class="note">{UNSEEN}</p>' if gaps else "",
                chart(
                    history.times,
                    effects,
                    0.0,
                    "Effect at the subject",
                    "effect at the subject, um",
                ),
                text_table(("time", "light", "rms px", "scale ppm", "sigma ppm"), rows),
            ]
        ),
        STYLE,
    )
