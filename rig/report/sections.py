"""The sections of the report: what each says in words, and which figures it holds."""

from __future__ import annotations

from collections.abc import Mapping

from common.page.html import element, esc, figure_text, percent, plot, section
from geometry.scan import ScanNote
from geometry.subject import Subject
from rig.design.layout import Layout
from rig.report import tables
from rig.report.drawings import array_drawing, footprint
from rig.report.ellipsoids import Ellipsoids
from rig.report.matchable import matchable
from solver.result import Bound, Design, Status


def rig(stills: Mapping[str, str]) -> str:
    """The rig in three dimensions; ``stills`` are addresses of pictures by a figure's key."""
    words = (
        "<b>Drag to turn, scroll to zoom.</b> The subject is coloured by the standard deviation σ "
        "of each point: the longest semi-axis of its error ellipsoid. Point at the surface to read "
        "σ and the number of views, point at a camera to read its setting. Entries of the legend "
        "switch parts on and off, among them the start before optimisation."
    )
    return section("rig", "The rig", words, plot("rig-3d", "", "large", stills["rig-3d"]))


def accuracy(design: Design) -> str:
    """The error map and the figures before and after."""
    words = (
        "The subject from the front. Both σ maps have the same colours, so they can be compared; "
        "where the start is worse than anything in the design it takes the brightest colour. Grey "
        "is outside the region the rig was designed for. The third map counts the views: a point "
        "needs two to be measured, and the third guards against mistakes."
    )
    maps = "".join(
        (
            plot("map-before", "σ at the start"),
            plot("map-after", "σ of the design"),
            plot("map-views", "Views of the design"),
        )
    )
    numbers = element(
        "div",
        _titled("Accuracy", tables.accuracy_table(design))
        + _titled("Coverage", tables.coverage_table(design)),
        class_="grid2",
    )
    return section(
        "accuracy", "Accuracy on the subject", words, f'<div class="grid3">{maps}</div>', numbers
    )


def _titled(title: str, content: str) -> str:
    return f"<div><h3>{esc(title)}</h3>{content}</div>"


def ellipsoids(
    design: Design,
    before: Ellipsoids,
    after: Ellipsoids,
    factor: float,
    stills: Mapping[str, str],
) -> str:
    """Error ellipsoids before and after."""
    times = f"{factor:,.0f}" if factor >= 1.0 else figure_text(factor)
    words = (
        f"Each ellipsoid is the 1 σ error of one point, drawn <b>{times} times too large</b>. They "
        "are elongated in the direction in which the cameras are least sure, mostly towards the "
        "cameras. The two figures have the same scale and turn together."
    )
    notes = []
    if before.cut + after.cut:
        notes.append(
            f"{before.cut} at the start and {after.cut} of the design are longer than the figure "
            "has room for and are drawn shorter."
        )
    if len(before.lost) + len(after.lost):
        notes.append(
            f'<span class="key lost">●</span> marks points that fewer than two cameras see: '
            f"{len(before.lost)} at the start, {len(after.lost)} in the design."
        )
    pair = "".join(
        (
            plot(key, _median(name, quality.sigma_median_mm), "tall", stills[key])
            for key, name, quality in (
                ("ellipsoids-before", "Start", design.start_quality),
                ("ellipsoids-after", "Design", design.quality),
            )
        )
    )
    extra = f'<p class="lead">{" ".join(notes)}</p>' if notes else ""
    return section(
        "ellipsoids",
        "Error ellipsoids before and after",
        words,
        extra,
        f'<div class="grid2">{pair}</div>',
    )


def _median(name: str, sigma_mm: float) -> str:
    return f"{esc(name)}: median σ {figure_text(sigma_mm)} mm"


def footprints(design: Design, subject: Subject) -> str:
    """What every camera has in its image."""
    words = (
        'The frame of each image with the points that camera sees. <span class="key"></span> is '
        'the outline in the design, <span class="key before"></span> at the start; an outline that '
        "leaves the frame is cut off. The cross is the principal point."
    )
    limit = design.limits.incidence.ray_max_deg
    starts = {camera.name: camera for camera in design.start_cameras}
    drawn = "".join(
        footprint(camera, starts.get(camera.name), subject, limit) for camera in design.cameras
    )
    return section("images", "Image footprints", words, f'<div class="footprints">{drawn}</div>')


def limits(design: Design) -> str:
    """The limits and what binds."""
    words = (
        "Every limit at its worst place. A limit <b>binds</b> when it has no slack left: the "
        "design would be better without it. These are the ones to think about when more accuracy "
        "is wanted. A <b>broken</b> limit has negative slack."
    )
    return section("limits", "Limits", words, tables.constraint_table(design.quality.constraints))


def cameras(design: Design) -> str:
    """What each camera sees and the tables of pairs."""
    words = (
        "GSD is the size of a pixel on the subject (mean, least and greatest). Incidence is the "
        "angle between the surface's normal and the ray. Points have to lie between the limits of "
        "sharpness. In the tables of pairs, base/height and the angle between the viewing "
        "directions say how strongly two cameras intersect: more is more precise, less is easier "
        "to match."
    )
    pairs = element(
        "div",
        _titled(
            "Base/height of pairs", tables.pair_table(design, design.quality.base_height, "B/H")
        )
        + _titled(
            "Convergence of pairs, degrees",
            tables.pair_table(design, design.quality.convergence_deg, "°"),
        ),
        class_="grid2",
    )
    return section(
        "cameras",
        "What each camera sees",
        words,
        tables.camera_table(design),
        pairs,
        matchable(design),
    )


def mounts(design: Design, layout: Layout, subject: Subject) -> str:
    """The mount layout: what a builder sets."""
    words = (
        "All lengths start at the <b>datum</b>, the foremost point of the subject (the nose tip "
        "of a face): across is positive to the subject's left, back is away from the subject, up "
        "is upwards. They lead to the mouth of the 1/4-20 thread under the body. Pan, tilt and "
        "roll are set in that order on a head, from a level camera that looks along +Y: pan to the "
        "right, tilt up and roll clockwise are positive, seen from behind the camera. The "
        "tape length from the datum to the middle of the lens front is a check."
    )
    drawings = "".join(
        (
            array_drawing(design.cameras, layout, subject, (0, 2), "From behind the cameras"),
            array_drawing(
                design.cameras, layout, subject, (0, 1), "From above, subject at the top"
            ),
        )
    )
    return section(
        "mounts",
        "Mount layout",
        words,
        f'<div class="grid2">{drawings}</div>',
        tables.layout_table(layout),
        _collisions(layout),
    )


def _collisions(layout: Layout) -> str:
    if not layout.collisions:
        return "<p>No body touches another and none stands in another camera's view.</p>"
    items = "".join(
        f"<li>{esc(_collision(c.kind, c.name, c.other))}: {figure_text(c.clearance_mm)} mm, "
        f"asked for {figure_text(c.required_mm)} mm</li>"
        for c in layout.collisions
    )
    return f'<h3>Collisions</h3><ul class="notes warning">{items}</ul>'


def _collision(kind: str, name: str, other: str) -> str:
    return (
        f"{name} and {other} are too close"
        if kind == "body"
        else f"{other} stands in the view of {name}"
    )


def solver(design: Design) -> str:
    """The solver's word."""
    report = design.solver
    if design.stands:
        return section("solver", "The solver's word", f"None: {esc(report.why_stopped)}.", "")
    status = {
        Status.CONVERGED: "converged",
        Status.STOPPED: "stopped early",
        Status.INFEASIBLE: "found no design within the limits",
    }[report.status]
    words = (
        f"The solver ({esc(report.engine)}) {status}: {esc(report.why_stopped)}. "
        f"{report.iterations} iterations in {report.rounds} rounds, KKT error "
        f"{figure_text(report.kkt_error, 2)} (how far the result is from an exact optimum), "
        f"{figure_text(report.seconds)} s, seed {report.seed}."
    )
    if any(start.feasible for start in report.starts):
        words += " The best start that holds all limits won."
    elif report.starts:
        words += " No start led to a design that holds all limits; the nearest is shown."
    if report.starts_note:
        words += f" Of the starts: {esc(report.starts_note)}."
    if report.bound is not None:
        words += f" {_bounded(report.bound)}"
    content = tables.starts_table(report) if report.starts else ""
    if report.conflicts:
        content = (
            _titled("Limits that contradict each other", tables.conflict_table(report)) + content
        )
    return section("solver", "The solver's word", words, content)


def _bounded(bound: Bound) -> str:
    """How good it could be at most, and what that speaks of."""
    unseen = ""
    if bound.unseen_share > 0.0:
        unseen = (
            f" {percent(bound.unseen_share)} of the points are seen by no two of these places: "
            "no design measures them."
        )
    return (
        f"<b>No network of as many cameras on a grid of {bound.candidates} places has a mean |Q| "
        f"below {figure_text(bound.lower_mm2)} mm²</b>; that of the design, over the same points, "
        f"is {figure_text(bound.cost_mm2)} mm², so at most {percent(bound.gap_share)} could be "
        f"gained there, limits between cameras and coverage not counted.{unseen}"
    )


def scan(notes: tuple[ScanNote, ...], scan_name: str) -> str:
    """What was inferred from the scan and changed in it."""
    named = f" ({esc(scan_name)})" if scan_name else ""
    words = (
        f"What was not given with the scan{named} was inferred, and what was wrong was repaired."
    )
    items = "".join(
        f'<li class="{esc(note.kind)}"><span class="kind">{esc(note.kind)}</span>'
        f"{esc(note.text)}</li>"
        for note in notes
    )
    return section(
        "scan",
        "The scan",
        words,
        f'<ul class="notes">{items}</ul>' if items else "<p>Nothing to say.</p>",
    )


def colophon(design: Design) -> str:
    """Conventions, in one line."""
    return (
        "<p>Rig frame: millimetres, X to the subject's left, Y from the cameras towards the "
        "subject, Z up. σ is one standard deviation for image measurements of "
        f"{figure_text(design.limits.image_sigma_px)} px.</p>"
    )
