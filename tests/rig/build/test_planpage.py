"""The plan's page: complete, self-contained, safe, and drawn apart by a real browser."""

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
from plans import plate_plan, tslot_plan

from rig.build.drawings.views import plan_solids
from rig.build.folder.planfiles import plan_files
from rig.build.mounts.plan import Clash, MountPlan, Stance
from rig.build.page.planpage import render_plan_page
from rig.build.parts import Prices, bill_of_materials, cut_list
from rig.catalogue import load_catalogue

if TYPE_CHECKING:
    from playwright.sync_api import Browser

EVIL = "</script><img src=x onerror=alert(1)> & \"quoted\" 'name'"
CATALOGUE = load_catalogue()


def page_of(plan: MountPlan) -> str:
    bill = bill_of_materials(plan, CATALOGUE, Prices("EUR", {"2020": 6.5}))
    return render_plan_page(plan, bill, cut_list(plan, CATALOGUE))


@pytest.fixture(scope="module")
def page() -> str:
    return page_of(tslot_plan(3))


class Elements(HTMLParser):
    """Collects the elements of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))


def test_it_loads_nothing_and_every_section_is_linked(page: str) -> None:
    rest = without_plotly(page)
    assert "http://" not in rest and "https://" not in rest and "default-src 'none'" in rest
    elements = Elements()
    elements.feed(rest)
    for tag, attributes in elements.found:
        assert "src" not in attributes, tag
        assert not [name for name in attributes if name.startswith("on")]
    sections = {a["id"] for tag, a in elements.found if tag == "section"}
    links = {(a.get("href") or "")[1:] for tag, a in elements.found if tag == "a"}
    assert sections == links == {"structure", "accuracy", "settings", "parts", "cuts", "steps"}


def test_every_part_setting_and_step_is_told(page: str) -> None:
    plan = tslot_plan(3)
    text = html.unescape(re.sub(r"<[^>]+>", " ", without_plotly(page)))
    for line in bill_of_materials(plan, CATALOGUE).lines:
        assert line.name in text and line.part in text
    for member in plan.structure.members:
        assert member.id in text
    for step in plan.steps:
        assert step in text
    assert "height on upright  560  mm  (1.5)" in text


def test_the_figure_holds_every_solid_where_it_stands(page: str) -> None:
    plan = tslot_plan(3)
    parts = json.loads(re.search(FIGURES, without_plotly(page), re.DOTALL).group(1))
    solids = plan_solids(plan)
    corners = np.concatenate([np.array(m["at"]).T for m in parts["ways"].values()])
    wanted = np.concatenate([s.corners_mm for s in solids])
    assert np.allclose(corners.min(axis=0), wanted.min(axis=0), atol=0.01)
    assert np.allclose(corners.max(axis=0), wanted.max(axis=0), atol=0.01)
    named = {w for t in parts["figure"]["data"] for w in t.get("text", [])}
    assert named == {s.owner for s in solids}


def test_names_cannot_break_out() -> None:
    plan = tslot_plan(2)
    first = plan.mounts[0]
    evil = replace(first, camera=replace(first.camera, name=EVIL))
    rest = without_plotly(page_of(replace(plan, name=EVIL, mounts=(evil,), steps=(EVIL,))))
    assert rest.count("<script") == 3 and "<img" not in rest
    assert html.escape(EVIL, quote=True) in rest


def test_a_plan_that_cannot_be_built_says_so() -> None:
    plan = replace(tslot_plan(2), clashes=(Clash("solid", "arm-c1", "c2", -3.0, 2.0),))
    text = page_of(plan)
    assert "cannot be built" in text and "arm-c1 and c2" in text
    broken = replace(plan.price.built, feasible=False, broken=("coverage",))
    soft = replace(plan, clashes=(), price=replace(plan.price, built=broken))
    assert "breaks limits" in page_of(soft)


def test_limits_that_rounding_breaks_are_called_broken() -> None:
    plan = tslot_plan(2)
    rounded = replace(plan.price.rounded, feasible=False, broken=("scale/c1", "scale/c2"))
    text = page_of(replace(plan, price=replace(plan.price, rounded=rounded)))
    assert "2 broken: scale (c1, c2)" in text


def test_both_masses_are_told_beside_each_other() -> None:
    """The bill weighs what is known, the stance with what is taken for the rest."""
    stance = Stance(("foot",), 16.3, np.zeros(3), 1200.0, 32.0, 40.0, "to the rear", np.ones(2))
    plan = replace(tslot_plan(2), stances=(stance,))
    assert bill_of_materials(plan, CATALOGUE).without_mass
    assert "16.3 kg with what is taken for it" in page_of(plan)
    assert "with what is taken for it" not in page_of(tslot_plan(2))


def test_the_page_links_to_the_files_beside_it() -> None:
    plan = tslot_plan(2)
    files = {name: file.words for name, file in plan_files(plan).items()}
    bill, cuts = bill_of_materials(plan, CATALOGUE), cut_list(plan, CATALOGUE)
    elements = Elements()
    elements.feed(without_plotly(render_plan_page(plan, bill, cuts, files=files)))
    links = [a.get("href") or "" for tag, a in elements.found if tag == "a"]
    beside = [link for link in links if not link.startswith("#")]
    assert set(beside) <= set(files) and len(beside) == len(set(beside))
    assert beside[0] == "steps.txt" and "#files" in links
    assert {"settings/settings.pdf", "drawings/views.pdf", "parts/bill.csv"} <= set(beside)
    page = plan_files(plan)["plan.html"].make().decode()
    assert all(f'href="{link}"' in page for link in beside)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as opened:
        yield opened


@pytest.mark.needs_browser
def test_a_browser_draws_it_whole_and_apart(browser: Browser, tmp_path: Path) -> None:
    plan = plate_plan()
    path = tmp_path / "plan.html"
    path.write_text(page_of(plan), encoding="utf-8")
    tab = browser.new_page(viewport={"width": 1000, "height": 800})
    faults: list[str] = []
    requests: list[str] = []
    tab.on("pageerror", lambda error: faults.append(str(error)))
    tab.on("request", lambda request: requests.append(request.url))
    tab.goto(path.as_uri())
    tab.wait_for_selector("body[data-ready]", timeout=120_000)
    assert tab.evaluate("document.body.dataset.ready") == "yes" and faults == []
    assert [url for url in requests if not url.startswith(("file:", "data:", "blob:"))] == []
    view = json.loads(tab.evaluate("document.body.dataset.view"))
    assert view["cameras"] == 3 and view["solids"] == len(plan_solids(plan))
    assert view["traces"] == view["kinds"] == 4 and view["canvases"] >= 1
    span = (
        "(() => { const t = document.getElementById('plan-3d').data.find(t => t.name === 'lenses');"
        " return [Math.min(...t.y), Math.max(...t.y)]; })()"
    )
    slide = (
        "v => { const s = document.getElementById('apart'); s.value = v;"
        " s.dispatchEvent(new Event('input')); }"
    )
    tab.evaluate(slide, 100)
    tab.wait_for_selector('#plan-3d[data-apart="1"]', timeout=60_000)
    apart = tab.evaluate(span)
    tab.evaluate(slide, 0)
    tab.wait_for_selector('#plan-3d[data-apart="0"]', timeout=60_000)
    whole = tab.evaluate(span)
    ends = np.concatenate([s.corners_mm[:, 1] for s in plan_solids(plan) if s.kind == "lens"])
    assert whole == pytest.approx([ends.min(), ends.max()], abs=0.01)
    assert apart[1] > whole[1] + 30.0, "lenses move towards the subject"
    assert len(tab.locator("#plan-3d").screenshot()) > 10_000
