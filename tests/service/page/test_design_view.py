"""Designs in a real browser: compared side by side, and asked for anew with a limit relaxed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import pytest
from browsers import chromium
from page_visits import Visit, served

from rig.specification.examples import example_text
from rig.specification.rigfile import RigFile, parse_rig_file
from service.api.designs import DesignBody

if TYPE_CHECKING:
    from playwright.sync_api import Route

pytestmark = [pytest.mark.needs_browser, pytest.mark.slow]
JSON = dict[str, Any]
GIVE = 0.01
LIMITS = {
    "base_height": {"min": 0.2, "max": 0.9, "neighbour_max": 0.4, "mean_min": 0.2, "mean_max": 0.8},
    "incidence": {"mean_max_deg": 40.0},
    "frame": {"margin_px": 8.0},
    "centring": {"tolerance_px": 5.0},
    "spacing": {"edge_mm": 200.0, "tolerance_mm": 3.0},
    "gsd": {"max_mm": 0.2},
    "stand_off": {"min_mm": 500.0, "max_mm": 900.0},
    "bodies": {"clearance_mm": 12.0},
    "sight_lines": {"clearance_mm": 7.0},
    "coverage": {"tier": [{"views": 2, "share": 0.9}, {"views": 4, "share": 0.5}]},
}
LOOSER = {
    **{("base_height", key): -1 for key in ("min", "mean_min")},
    **{("base_height", key): 1 for key in ("max", "neighbour_max", "mean_max")},
    ("incidence", "mean_max_deg"): 1,
    ("frame", "margin_px"): -1,
    ("centring", "tolerance_px"): 1,
    ("spacing", "tolerance_mm"): 1,
    ("gsd", "max_mm"): 1,
    ("stand_off", "min_mm"): -1,
    ("stand_off", "max_mm"): 1,
    ("bodies", "clearance_mm"): -1,
    ("sight_lines", "clearance_mm"): -1,
}
FAMILIES = {
    **{f"base_height_{key}": ("base_height", key) for key in ("min", "max", "mean_min")},
    "base_height_mean_max": ("base_height", "mean_max"),
    "base_height_neighbour": ("base_height", "neighbour_max"),
    "incidence_mean": ("incidence", "mean_max_deg"),
    "frame": ("frame", "margin_px"),
    "centring": ("centring", "tolerance_px"),
    "spacing": ("spacing", "tolerance_mm"),
    "gsd": ("gsd", "max_mm"),
    "stand_off_min": ("stand_off", "min_mm"),
    "stand_off_max": ("stand_off", "max_mm"),
    "body_clearance": ("bodies", "clearance_mm"),
    "sight_line": ("sight_lines", "clearance_mm"),
}


@pytest.fixture(scope="module")
def visit(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Visit]:
    data = tmp_path_factory.mktemp("designs") / "data"
    with served(data) as address, chromium() as browser:
        yield Visit(browser, address)


def rig() -> JSON:
    """A rig file as a design is filed with, with a number for every limit that has one."""
    given = json.loads(parse_rig_file(example_text("face"), "face").model_dump_json(by_alias=True))
    filed = RigFile.from_spec(RigFile.model_validate(given | {"limits": LIMITS}).to_spec())
    found: JSON = json.loads(filed.model_dump_json(by_alias=True, exclude_none=True))
    return found


def relaxed(visit: Visit, family: str, give: float | None = GIVE) -> JSON | None:
    script = "async ([rig, one]) => (await import('./page/relax.js')).relaxed(rig, one)"
    found: JSON | None = visit.page.evaluate(
        script, [rig(), {"family": family, "give_alone": give}]
    )
    return found


@pytest.mark.parametrize("family", FAMILIES)
def test_a_limit_that_gives_way_is_looser_and_all_else_as_it_was(visit: Visit, family: str) -> None:
    found, (part, key) = relaxed(visit, family), FAMILIES[family]
    assert found is not None
    changed = found["limits"][part].pop(key) - (before := rig())["limits"][part].pop(key)
    assert changed * LOOSER[part, key] == pytest.approx(1.02 * GIVE)
    assert found == before


def test_a_share_gives_way_and_what_cannot_give_way_is_not_offered(visit: Visit) -> None:
    found = relaxed(visit, "coverage_4")
    assert found is not None
    RigFile.model_validate(found).to_spec()
    two, four = found["limits"]["coverage"]["tier"]
    assert (two["share"], four["share"]) == (0.9, pytest.approx(0.5 - 1.02 * GIVE))
    assert relaxed(visit, "depth_of_field") is None
    assert relaxed(visit, "body_clearance", 13.0) is None, "no gap is less than none"
    assert relaxed(visit, "gsd", None) is None, "alone it does not help"


def told(number: int, sigma_mm: float, **more: object) -> JSON:
    """A job that only the browser is told of."""
    own = f"/v1/designs/d{number}"
    links = {"self": own, "files": f"{own}/files", "events": f"{own}/events"}
    result = {
        "name": f"Rig {number}", "cameras": number, "feasible": True, "contradiction": None,
        "sigma_median_mm": sigma_mm, "sigma_p95_mm": 2 * sigma_mm, "sigma_max_mm": 3 * sigma_mm,
        "in_focus_share": 1.0, "matchable_share": 1.0, "conflicts": [],
        "coverage": [{"views": 2, "share": 0.9}],
    } | more  # fmt: skip
    return {
        "id": f"d{number}", "scan_id": "s1", "status": "completed", "problem": None,
        "created_at": "2026-01-31T12:00:00Z", "links": links, "result": result,
    }  # fmt: skip


def test_designs_are_compared_side_by_side(visit: Visit) -> None:
    listed = {"items": [told(5, 0.1), told(7, 0.05), told(9, 0.2)], "next": None}
    visit.page.route("**/v1/designs?*", lambda route: route.fulfill(json=listed))
    visit.go("Design")
    visit.page.get_by_text("Compare designs").press("Enter")
    row = visit.page.get_by_role("row", name="Sigma, median")
    assert row.locator("td").all_inner_texts() == ["Sigma, median", "100 µm", "50 µm"]
    assert row.locator("strong").all_inner_texts() == ["50 µm"]
    visit.page.get_by_label("Rig 9, 9 cameras").check()
    row.locator("td", has_text="200 µm").wait_for()
    visit.sound()
    visit.page.unroute_all()


def test_a_conflict_has_a_button_that_designs_anew_once(visit: Visit) -> None:
    conflict = {"family": "gsd", "unit": "mm", "give": 0.004, "give_alone": 0.02}
    other = {"family": "depth_of_field", "unit": "mm", "give": 1.0, "give_alone": 2.0}
    job = told(5, 0.1, feasible=False, conflicts=[conflict, other])
    bodies: list[str] = []

    def ask(route: Route) -> None:
        if route.request.method == "POST":
            bodies.append(str(route.request.post_data))
            route.fulfill(json=job, status=201)
        else:
            route.continue_()

    empty = {"items": []}
    visit.page.route("**/v1/designs", ask)
    visit.page.route("**/v1/designs/d5", lambda route: route.fulfill(json=job))
    visit.page.route("**/v1/designs/d5/design", lambda route: route.fulfill(json={"rig": rig()}))
    for path in ("files", "exports"):
        visit.page.route(f"**/v1/designs/d5/{path}", lambda route: route.fulfill(json=empty))
    visit.page.route("**/v1/designs/d5/report", lambda route: route.fulfill(body="report"))
    visit.page.goto(f"{visit.address}#/design/d5")
    button = visit.page.get_by_role("button", name="Relax it by 0.0204 mm")
    button.wait_for()
    assert visit.page.get_by_role("button", name="Relax it").count() == 1
    visit.sound()
    button.dblclick()
    visit.page.wait_for_timeout(300)
    (asked,) = [DesignBody.model_validate_json(body) for body in bodies]
    assert asked.scan_id == "s1"
    assert asked.rig.limits.gsd is not None
    assert asked.rig.limits.gsd.max_mm == pytest.approx(0.2 + 0.0204)
    visit.page.unroute_all()
