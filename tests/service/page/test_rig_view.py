"""At the rig, in a real browser: look, test, fire, and see what came; two people at once."""

from __future__ import annotations

import json
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from browsers import chromium
from page_visits import Visit, served
from stations import write_station

from service.api.reconstructions import ReconstructionBody
from service.api.studies import StudyBody

if TYPE_CHECKING:
    from playwright.sync_api import Route

pytestmark = pytest.mark.needs_browser
NAME = '<img src=x onerror="document.title=1">'


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    folder = tmp_path_factory.mktemp("lab")
    with served(folder / "data", write_station(folder / "rig")) as found:
        yield found


@pytest.fixture(scope="module")
def visits(address: str) -> Iterator[tuple[Visit, Visit]]:
    with chromium() as browser:
        yield Visit(browser, address), Visit(browser, address, 820)


def read(address: str) -> object:
    with urllib.request.urlopen(address) as answer:  # noqa: S310 - the service of this test
        return json.load(answer)


def refused(visit: Visit, address: str) -> list[str]:
    """What the browser posts to ``address`` from now on, each time told that too many wait."""
    problem = {"type": "/problems/conflict/queue-full", "detail": "too many wait; ask later"}
    bodies: list[str] = []

    def ask(route: Route) -> None:
        if route.request.method == "GET":
            route.continue_()
            return
        bodies.append(str(route.request.post_data))
        route.fulfill(status=503, json=problem)

    visit.page.route(address, ask)
    return bodies


@pytest.mark.slow
def test_a_capture_is_seen_by_everybody_at_the_rig(
    visits: tuple[Visit, Visit], address: str
) -> None:
    one, other = visits
    one.see("Trigger box: ready")
    one.press("Self-test")
    one.see("All is well.")
    one.page.get_by_label("Subject").fill(NAME)
    one.page.get_by_label("Session").fill("anna")
    one.press("Fire")
    one.page.locator(".sheet img").nth(1).wait_for()
    shown = one.page.locator(".result h2").inner_text()
    captures = read(f"{address}v1/captures")
    assert [item["id"] for item in captures["items"]] == [shown]  # type: ignore[index]
    assert one.page.evaluate("document.title") == "Rigwright"
    one.sound()
    other.see("Trigger box: ready")
    other.sound()


@pytest.mark.slow
def test_a_camera_is_aimed_on_the_screen_and_a_capture_goes_first(
    visits: tuple[Visit, Visit], address: str
) -> None:
    one, _ = visits
    one.page.get_by_text("Live view", exact=True).click()
    one.see("The datum should be at the cross.")
    first = one.page.locator(".live figure").first
    first.locator(".sight").click(position={"x": 20, "y": 40})
    one.see("degrees to the left")
    assert first.locator("svg .cross").count() == 2 and first.locator("svg .found").count() == 1
    one.sound()
    before = len(read(f"{address}v1/captures")["items"])  # type: ignore[index]
    one.press("Fire")
    one.page.locator(".result .state", has_text="complete").first.wait_for()
    assert len(read(f"{address}v1/captures")["items"]) == before + 1  # type: ignore[index]
    shown = first.locator("img").get_attribute("src")
    one.page.wait_for_function(
        "was => document.querySelector('.live img').getAttribute('src') !== was", arg=shown
    )  # it goes on
    one.page.get_by_text("Live view", exact=True).click()


def test_a_countdown_can_be_stopped(visits: tuple[Visit, Visit], address: str) -> None:
    one, _ = visits
    before = len(read(f"{address}v1/captures")["items"])  # type: ignore[index]
    one.page.get_by_label("Countdown, s").fill("30")
    one.press("Fire")
    one.page.get_by_role("button", name="press to stop").click()
    one.page.get_by_role("button", name="Fire", exact=True).wait_for()
    assert len(read(f"{address}v1/captures")["items"]) == before  # type: ignore[index]


@pytest.mark.slow
def test_a_session_is_looked_at_and_proven(visits: tuple[Visit, Visit]) -> None:
    _, other = visits
    other.go("Sessions")
    other.page.get_by_role("link", name="anna").click()
    other.page.locator(".sheet img").nth(1).wait_for()
    other.press("Prove it whole")
    other.see("Whole: 2 captures,")
    other.sound()


@pytest.mark.slow
def test_a_session_is_deleted_when_asked_twice_and_comes_back(
    visits: tuple[Visit, Visit], address: str
) -> None:
    one, _ = visits
    one.go("Sessions")
    one.page.get_by_role("link", name="anna").click()
    one.press("Delete")
    one.press("Keep it")
    assert read(f"{address}v1/removed-sessions") == {"items": []}
    one.press("Delete")
    one.press("Delete it")
    one.page.get_by_text("Deleted, restorable: 1").click()
    one.sound()
    one.page.get_by_role("button", name="Restore anna").click()
    one.page.get_by_role("link", name="anna").click()
    one.see("Prove it whole")


@pytest.mark.slow
def test_a_surface_is_asked_for_with_what_was_chosen(visits: tuple[Visit, Visit]) -> None:
    """Of the session that is there, with a design that only the browser is told of."""
    one, _ = visits
    design = {"id": "d1", "status": "completed", "created_at": "2026-01-31T12:00:00Z"}
    listed = {"items": [design | {"result": {"name": "Seven"}}], "next": None}
    one.page.route("**/v1/designs?*", lambda route: route.fulfill(json=listed))
    bodies = refused(one, "**/v1/reconstructions")
    one.go("Surface")
    one.page.get_by_label("Capture", exact=True).locator("option").first.wait_for(state="attached")
    one.sound()
    one.press("Reconstruct")
    one.see("too many wait")
    one.page.unroute_all()
    one.faults.clear()  # the browser tells of the refusal on its console
    (asked,) = [ReconstructionBody.model_validate_json(body) for body in bodies]
    assert (asked.design_id, asked.calibration_id, asked.pictures.session) == ("d1", None, "anna")
    assert len(asked.pictures.captures) == 1


@pytest.mark.slow
def test_a_study_is_asked_for_with_what_was_chosen(visits: tuple[Visit, Visit]) -> None:
    """For scans that only the browser is told of."""
    one, _ = visits
    scans = [
        {"id": name, "filename": f"{name}.ply", "extents_mm": [1, 1, 1], "notes": []}
        for name in ("anna", "bert")
    ]
    one.page.route(
        "**/v1/scans?*", lambda route: route.fulfill(json={"items": scans, "next": None})
    )
    bodies = refused(one, "**/v1/studies")
    one.go("Studies")
    one.page.get_by_label("bert.ply").check()
    one.page.get_by_label("Cameras", exact=True).fill("3, 4 5")
    one.page.get_by_label("Seeds").fill("1,2")
    one.page.get_by_label("Form", exact=True).select_option("both")
    one.sound()
    one.press("Compare them")
    one.see("too many wait")
    one.page.unroute_all()
    one.faults.clear()  # the browser tells of the refusal on its console
    (asked,) = [StudyBody.model_validate_json(body) for body in bodies]
    grid = asked.study.grid
    assert (asked.scan_ids, grid.cameras, grid.seed) == (["anna", "bert"], [3, 4, 5], [1, 2])
    assert list(grid.form or ()) == ["free", "symmetric"]


@pytest.mark.parametrize("view", ["Calibration", "Surface", "Design", "Studies", "Build"])
def test_views_of_an_empty_service(visits: tuple[Visit, Visit], view: str) -> None:
    one, _ = visits
    one.go(view)
    one.page.locator("main h1").wait_for()
    one.page.wait_for_load_state("networkidle")
    one.sound()


@pytest.mark.slow
def test_the_page_works_behind_a_proxy(visits: tuple[Visit, Visit], tmp_path: Path) -> None:
    browser = visits[0].page.context.browser  # one at a time is all that a thread may have
    assert browser is not None
    station = write_station(tmp_path / "rig")
    behind = served(tmp_path / "data", station, more=("--root-path", "/lab"))
    with behind as address:
        one = Visit(browser, f"{address}lab/")
        one.see("Trigger box: ready")
        one.press("Fire")
        one.page.locator(".sheet img").nth(1).wait_for()
        one.sound()
