"""The report: complete, self-contained, safe, and drawn by a real browser."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Iterator
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from browsers import chromium
from drawn_pages import FIGURES, without_plotly

from common.page.html import figure_text, percent
from geometry.raycast import Occluder
from geometry.scan import ScanNote
from geometry.subject import Subject
from rig.design.layout import make_layout
from rig.report import render_report, sections
from rig.report.ellipsoids import ellipsoids, exaggeration, spread_sample
from rig.report.errormap import sigma_range_mm
from rig.report.words import family_words
from solver.result import Bound, Design, Relaxation, Status

if TYPE_CHECKING:
    from playwright.sync_api import Browser

EVIL = "</script><img src=x onerror=alert(1)> & \"quoted\" 'name'"
NOTES = (ScanNote("inferred", "units: mm"), ScanNote("warning", EVIL))


def report(design: Design, subject: Subject, **more: object) -> str:
    layout = make_layout(design.cameras, subject, design.limits)
    return render_report(design, subject, layout, **more)


@pytest.fixture(scope="module")
def page(design: Design, subject: Subject) -> str:
    return report(design, subject, title="Face rig", scan_name="head.glb", notes=NOTES)


@pytest.fixture(scope="session")
def bare(subject: Subject) -> Subject:
    """The points without the head: what is said in words takes a third of the time to write."""
    return replace(subject, occluder=Occluder.none())


class Elements(HTMLParser):
    """Collects the elements of a page and checks that they are closed in order."""

    VOID = frozenset({"meta", "link", "br", "img", "rect", "circle", "polygon", "path"})

    def __init__(self) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def parsed(page: str) -> Elements:
    elements = Elements()
    elements.feed(page)
    elements.close()
    assert elements.open == []
    return elements


def test_what_can_be_matched_is_told_with_the_groups_of_cameras(
    design: Design, bare: Subject, page: str
) -> None:
    found = design.quality.matchable
    assert f"{percent(found.share(1))} are in such a pair" in page
    strict = replace(design.limits.matching, least_shared=1.0)
    views = tuple(replace(v, matching=strict) for v in found.positions)
    quality = replace(design.quality, matchable=replace(found, positions=views))
    apart = report(replace(design, quality=quality), bare)
    names = "; ".join(camera.name for camera in design.cameras)
    assert f"the cameras are {len(design.cameras)} groups: {names}." in apart
    assert f"the cameras are {len(design.cameras)} groups" not in page


def test_the_page_is_well_formed_and_loads_nothing(page: str) -> None:
    elements = parsed(page)
    for tag, attributes in elements.found:
        assert (attributes.get("src") or "data:").startswith("data:"), tag
        assert tag != "iframe"
        href = attributes.get("href") or "#"
        assert href.startswith(("#", "data:"))
        assert not [name for name in attributes if name.startswith("on")]
    assert "default-src 'none'" in page
    assert "http://" not in without_plotly(page) and "https://" not in without_plotly(page)


def test_size(page: str) -> None:
    # Nine cameras on a scanned head: 2.85 MB, of which plotly is 1.95, packed.
    assert len(page.encode()) < 3_000_000


def test_every_section_is_there_and_linked(page: str) -> None:
    elements = parsed(page)
    sections = {a["id"] for tag, a in elements.found if tag == "section"}
    links = {(a.get("href") or "")[1:] for tag, a in elements.found if tag == "a"}
    assert (
        sections
        == links
        == {
            "rig",
            "accuracy",
            "ellipsoids",
            "images",
            "limits",
            "cameras",
            "mounts",
            "solver",
            "scan",
        }
    )
    places = {a.get("id") for tag, a in elements.found if tag == "div"} - {None}
    figures = json.loads(re.search(FIGURES, without_plotly(page), re.DOTALL).group(1))
    assert set(figures) == places


def test_the_figures_are_those_of_the_design(page: str, design: Design) -> None:
    assert f"{figure_text(design.quality.sigma_median_mm)} <small>mm</small>" in page
    for camera in design.cameras:
        assert page.count(f">{camera.name}<") >= 4
    binding = [r for r in design.quality.constraints if r.active and r.satisfied]
    assert page.count('class="badge binds"') == len(binding)
    assert page.count('class="badge broken"') == len(design.quality.violated)


def test_names_cannot_break_out(hostile_design: Design, bare: Subject) -> None:
    evil = report(hostile_design, bare, title=EVIL, scan_name=EVIL, notes=NOTES)
    rest = without_plotly(evil)
    assert rest.count("<script") == 3
    assert "<img src=x" not in rest
    assert html.escape(EVIL, quote=True) in rest
    parsed(evil)


def test_broken_limits_come_first_and_are_explained(design: Design, bare: Subject) -> None:
    rows = [replace(row, slack=1.0, satisfied=True) for row in design.quality.constraints]
    worst = next(k for k, row in enumerate(rows) if row.family == "base_height_min")
    rows[worst] = replace(rows[worst], slack=-0.05, satisfied=False, active=True)
    solver = replace(
        design.solver,
        status=Status.INFEASIBLE,
        conflicts=(
            Relaxation("stand_off_max", "mm", 12.5, None),
            Relaxation("gsd", "mm", 0.01, 0.02),
        ),
        starts_note="the search knows no <spacing>",
    )
    broken = replace(
        design, quality=replace(design.quality, constraints=tuple(rows)), solver=solver
    )
    text = report(broken, bare)
    limits = text[text.index('<section id="limits">') :]
    assert limits.index('class="badge broken"') < limits.index('class="badge holds"')
    assert f"1 of {len(rows)} limits are broken: Base/height, least." in text
    assert "Limits that contradict each other" in text and "12.5 mm" in text
    assert "is not enough" in text
    assert "Of the starts: the search knows no &lt;spacing&gt;." in text


def test_how_good_any_other_design_could_be_is_told_with_what_nobody_sees(design: Design) -> None:
    assert "No network of as many" not in sections.solver(design)
    bound = Bound(0.00087, 0.001, 484, 600, 0.002)
    words = sections.solver(replace(design, solver=replace(design.solver, bound=bound)))
    assert "a grid of 484 places has a mean |Q| below 0.000870 mm²" in words
    assert "at most 13 % could be gained" in words
    assert "0.2 % of the points are seen by no two of these places" in words


def test_a_subject_of_bare_points(design: Design, bare: Subject) -> None:
    text = report(design, bare)
    parsed(text)
    assert '"type":"mesh3d"' in without_plotly(text), "the bodies"


def test_figures_for_people() -> None:
    assert figure_text(0.05629) == "0.0563"
    assert figure_text(1234.5, 4) == "1234"
    assert figure_text(-2.34567) == "−2.35"
    assert figure_text(3.2e-9, 2) == "3.2e−09"
    assert [figure_text(v) for v in (float("nan"), float("inf"), 0.0)] == ["–", "∞", "0"]
    assert percent(1.0) == "100 %" and percent(0.99999) == "99.99 %" and percent(0.5) == "50 %"
    assert family_words("base_height_mean_min")[0] == "Base/height, least mean"
    assert family_words("coverage_2")[0] == "Coverage, 2 or more views"
    assert family_words("matchable_1")[0] == "Matchable, 1 or more pairs"
    assert family_words("newly_invented") == ("newly invented", "")


def test_ellipsoids_have_the_stated_size(design: Design) -> None:
    table = design.quality.points
    sample = spread_sample(table.points.points_mm, 50)
    assert len(set(sample.tolist())) == 50
    factor = exaggeration(table, table.points.radius_mm)
    assert factor in {step * 10.0**power for step in (1, 2, 5) for power in range(-3, 6)}
    shown = ellipsoids(table, sample, factor, 1e9)
    assert shown.cut == 0 and len(shown.rows) + len(shown.lost) == 50
    lengths = np.linalg.norm(shown.axes, axis=1).max(axis=1)
    assert np.allclose(lengths, factor * table.sigma_mm[shown.rows])
    small = ellipsoids(table, sample, factor, float(np.median(lengths)))
    assert 0 < small.cut < len(small.rows)
    assert np.linalg.norm(small.axes, axis=1).max() <= np.median(lengths) * (1 + 1e-12)
    low, high = sigma_range_mm(table)
    assert 0.0 < low < np.median(table.sigma_mm) <= high


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as opened:
        yield opened


NO_WEBGL = """{
  const every = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
    return kind.startsWith("webgl") ? null : every.call(this, kind, ...more);
  };
}"""
"""What a browser without it says: playwright opens no second browser beside the first."""


class Visit:
    """A page opened in the browser, with everything it said and asked for."""

    def __init__(
        self, browser: Browser, path: Path, scheme: str, width: int, first: str = ""
    ) -> None:
        context = browser.new_context(color_scheme=scheme, viewport={"width": width, "height": 900})
        context.add_init_script(first)
        self.page = context.new_page()
        self.faults: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", lambda m: self.faults.append(m.text) if m.type == "error" else None)
        self.page.on("pageerror", lambda error: self.faults.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(path.as_uri())
        self.page.wait_for_selector("body[data-ready]", timeout=120_000)
        self.view = json.loads(self.page.evaluate("document.body.dataset.view"))


@pytest.mark.slow
@pytest.mark.needs_browser
def test_a_browser_draws_it(
    page: str, design: Design, subject: Subject, browser: Browser, tmp_path: Path
) -> None:
    path = tmp_path / "report.html"
    path.write_text(page, encoding="utf-8")
    visit = Visit(browser, path, "light", 1280)
    assert visit.page.evaluate("document.body.dataset.ready") == "yes"
    assert visit.faults == []
    assert [url for url in visit.requests if not url.startswith(("file:", "data:", "blob:"))] == []
    view = visit.view
    assert view["cameras"] == 7 and view["figures"] == 6 and view["canvases"] == 3
    assert view["limits"] == len(design.quality.constraints)
    assert 6_000 < view["triangles"] <= 16_000 < len(subject.occluder.faces)
    assert view["sigma_median_mm"] == pytest.approx(design.quality.sigma_median_mm)
    drawn = visit.page.evaluate(
        "document.getElementById('rig-3d').data.filter(t => t.type === 'mesh3d').map(t => t.name)"
    )
    assert drawn == ["head", "region", *(camera.name for camera in design.cameras)]
    assert visit.page.evaluate("!!document.querySelector('#rig-3d canvas').getContext('webgl')")
    shot = visit.page.locator("#rig-3d").screenshot()
    assert len(shot) > 20_000, "an empty canvas compresses to a few kilobytes"


@pytest.mark.needs_browser
@pytest.mark.slow
def test_without_webgl_still_pictures_stand_in_for_the_scenes(
    page: str, browser: Browser, tmp_path: Path
) -> None:
    path = tmp_path / "report.html"
    path.write_text(page, encoding="utf-8")
    visit = Visit(browser, path, "light", 1280, NO_WEBGL)
    assert visit.page.evaluate("document.body.dataset.ready") == "yes"
    assert visit.faults == []
    assert visit.view["figures"] == 3, "the maps need no WebGL"
    assert visit.page.locator("#rig-3d").is_hidden()
    stills = visit.page.locator("img.still")
    assert [still.is_visible() for still in stills.all()] == [True] * 3
    assert all(stills.evaluate_all("all => all.map((one) => one.naturalWidth > 0)"))
    assert len(stills.first.screenshot()) > 20_000, "an empty picture packs to a few kilobytes"


@pytest.mark.needs_browser
@pytest.mark.slow
def test_dark_and_narrow(page: str, browser: Browser, tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    path.write_text(page, encoding="utf-8")
    visit = Visit(browser, path, "dark", 390)
    assert visit.faults == []
    background = visit.page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert max(int(v) for v in re.findall(r"\d+", background)[:3]) < 60
    ink = visit.page.evaluate("document.getElementById('rig-3d').layout.font.color")
    assert ink == "#e6e9ef"
    assert visit.page.evaluate("document.documentElement.scrollWidth") <= 390


@pytest.mark.needs_browser
@pytest.mark.slow
def test_the_ellipsoid_figures_turn_together(page: str, browser: Browser, tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    path.write_text(page, encoding="utf-8")
    visit = Visit(browser, path, "light", 1280)
    visit.page.evaluate(
        "Plotly.relayout('ellipsoids-before', {'scene.camera': {eye: {x: 0.1, y: -2, z: 0.3}}})"
    )
    visit.page.wait_for_function(
        "document.getElementById('ellipsoids-after').layout.scene.camera.eye.y === -2",
        timeout=10_000,
    )


@pytest.mark.needs_browser
@pytest.mark.slow
def test_hostile_names_do_nothing(
    hostile_design: Design, subject: Subject, browser: Browser, tmp_path: Path
) -> None:
    path = tmp_path / "report.html"
    text = report(hostile_design, subject, title=EVIL, scan_name=EVIL, notes=NOTES)
    path.write_text(text, encoding="utf-8")
    visit = Visit(browser, path, "light", 1280)
    assert visit.faults == [] and visit.page.evaluate("document.body.dataset.ready") == "yes"
    assert visit.page.title() == EVIL
    # The still pictures are the page's own; one that a name asked for would be of another kind.
    sources = visit.page.evaluate("[...document.images].map(image => image.src.slice(0, 11))")
    assert set(sources) <= {"data:image/"}
