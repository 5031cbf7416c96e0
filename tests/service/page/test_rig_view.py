"""At the rig, in a real browser: look, test, fire, and see what came; two people at once."""

from __future__ import annotations

import json
import signal
import urllib.parse
import urllib.request
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from browsers import chromium
from page_visits import ROOT, Serving, Visit, served
from service_helpers import wait_for
from stations import write_station

from rig.acquisition.trigger.fake.program import FakeTrigger, start_fake
from service.api.reconstructions import ReconstructionBody
from service.api.studies import StudyBody

if TYPE_CHECKING:
    from playwright.sync_api import Route

pytestmark = [pytest.mark.needs_browser, pytest.mark.slow]
NAME = '"><img src=x onerror="window.ran=1"><svg onload="window.ran=1">'
"""What it would do it does within a frame of being made, wherever a page takes it for markup."""

SHOTS = 20
JSON = dict[str, Any]


@pytest.fixture(scope="module")
def box() -> Iterator[FakeTrigger]:
    with start_fake() as fake:
        yield fake


@pytest.fixture(scope="module")
def serving(tmp_path_factory: pytest.TempPathFactory, box: FakeTrigger) -> Iterator[Serving]:
    folder = tmp_path_factory.mktemp("lab")
    station = write_station(folder / "rig", url=box.url, name=NAME.replace('"', '\\"'))
    found = Serving(folder / "data", station)
    found.begin()
    yield found
    found.end()


@pytest.fixture(scope="module")
def address(serving: Serving) -> str:
    return serving.address


@pytest.fixture(scope="module")
def visits(address: str) -> Iterator[tuple[Visit, Visit]]:
    with chromium() as browser:
        yield Visit(browser, address), Visit(browser, address, 820)


def read(address: str) -> JSON:
    with urllib.request.urlopen(address) as answer:  # noqa: S310 - the service of this test
        found: JSON = json.load(answer)
        return found


def sent(address: str, content: object) -> JSON:
    """The answer to a POST of a file, or of anything that becomes JSON."""
    data = content if isinstance(content, bytes) else json.dumps(content).encode()
    kind = "application/octet-stream" if isinstance(content, bytes) else "application/json"
    request = urllib.request.Request(address, data, {"Content-Type": kind})  # noqa: S310 - as below
    with urllib.request.urlopen(request) as answer:  # noqa: S310 - the service of this test
        found: JSON = json.load(answer)
        return found


def pulses(box: FakeTrigger) -> int:
    return sum(edge.output == 1 and edge.rising for edge in box.box.edges)


def nothing_ran(visit: Visit) -> None:
    visit.page.wait_for_timeout(100)
    assert visit.page.evaluate("window.ran") is None
    assert visit.page.locator("main :is(img[src='x'], script, svg[onload])").count() == 0


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
    assert [item["id"] for item in captures["items"]] == [shown]
    assert one.page.locator("h1").inner_text() == NAME
    nothing_ran(one)
    one.sound()
    other.see("Trigger box: ready")
    other.sound()


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
    before = len(read(f"{address}v1/captures")["items"])
    one.press("Fire")
    one.page.locator(".result .state", has_text="complete").first.wait_for()
    assert len(read(f"{address}v1/captures")["items"]) == before + 1
    shown = first.locator("img").get_attribute("src")
    one.page.wait_for_function(
        "was => document.querySelector('.live img').getAttribute('src') !== was", arg=shown
    )  # it goes on
    one.page.get_by_text("Live view", exact=True).click()


def test_a_session_is_named_as_chosen_and_the_form_is_kept(visits: tuple[Visit, Visit]) -> None:
    _, other = visits
    session = other.page.get_by_label("Session", exact=True)
    day = session.input_value()
    other.page.get_by_label("Subject").fill("Zoë / 7")
    assert session.input_value() == f"{day}-Zoe-7"
    other.page.get_by_label("Named by").select_option("subject")
    assert session.input_value() == "Zoe-7"
    other.page.reload()
    other.see("Trigger box: ready")
    assert session.input_value() == "Zoe-7"
    session.fill("anna")
    other.page.get_by_label("Subject").fill("")
    other.go("Sessions")
    other.go("Rig")
    other.see("Trigger box: ready")
    assert session.input_value() == "anna", "what was typed is left alone"


def test_a_countdown_can_be_stopped(visits: tuple[Visit, Visit], address: str) -> None:
    one, _ = visits
    before = len(read(f"{address}v1/captures")["items"])
    one.page.get_by_label("Countdown, s").fill("30")
    one.press("Fire")
    one.page.get_by_role("button", name="press to stop").click()
    one.page.get_by_role("button", name="Fire", exact=True).wait_for()
    assert len(read(f"{address}v1/captures")["items"]) == before
    one.page.get_by_label("Countdown, s").fill("0")


def test_abort_stops_a_countdown_at_every_browser(
    visits: tuple[Visit, Visit], box: FakeTrigger
) -> None:
    """Also at those that do not look at this moment: they ask before they fire."""
    one, other = visits
    fired = pulses(box)
    for hands in (one, other):
        one.page.get_by_label("Countdown, s").fill("4")
        one.press("Fire")
        one.page.get_by_role("button", name="press to stop").wait_for()
        hands.press("Abort: all outputs off")
        hands.see("Aborted: all outputs are off.")
        one.see("Stopped before anything fired.")
        one.page.get_by_role("button", name="Fire", exact=True).wait_for()
        one.page.wait_for_timeout(4500)  # longer than was counted down
        assert pulses(box) == fired
    one.page.get_by_label("Countdown, s").fill("0")
    one.sound()


def told(**result: object) -> dict[str, object]:
    """A list of one job that somebody gave such names; only the browser is told of it."""
    links = {word: f"/v1/none/{word}" for word in ("self", "files", "report", "cancel", "events")}
    job = {"id": NAME, "status": "completed", "created_at": "2026-01-31T12:00:00Z", "links": links}
    return {"items": [{**job, "problem": None, "result": result}], "next": None}


NAMED = {
    "designs": told(name=NAME, cameras=3, sigma_median_mm=0.1),
    "plans": told(name=NAME, system=NAME),
    "calibrations": told(cameras=[{"name": NAME}], rms_px=0.1),
    "checks": told(light="red", text=NAME),
    "studies": told(name=NAME, designs=3),
    "reconstructions": told(frame=NAME, points=10),
    "comparisons": told(median_absolute_mm=0.1),
}


def test_markup_in_a_name_is_a_name(visits: tuple[Visit, Visit], address: str) -> None:
    """The rig and the subject of a session have it already."""
    one, _ = visits
    file = urllib.parse.quote(f"{NAME}.xyz", safe="")
    scan = (ROOT / "examples/wall/targets.xyz").read_bytes()
    where = f"{address}v1/scans?filename={file}&units=m&up=%2Bz&front=-y&subject=object"
    kept = sent(where, scan)
    assert kept["filename"] == f"{NAME}.xyz"
    plate = {"name": "plate", "columns": 5, "rows": 4, "square_mm": 9.0, "marker_mm": 6.0}
    plate["dictionary"] = "DICT_4X4_50"
    targets = {"schema": "rigwright.targets/1", "name": NAME, "plates": [plate]}
    sent(f"{address}v1/target-sets", targets)
    one.page.get_by_text("Live view", exact=True).click()
    one.page.get_by_label("Look for").locator("option", has_text=NAME).wait_for(state="attached")
    nothing_ran(one)
    one.page.get_by_text("Live view", exact=True).click()
    for kind, items in NAMED.items():
        one.page.route(f"**/v1/{kind}?*", lambda route, _r, items=items: route.fulfill(json=items))
    for view in ("Sessions", "Calibration", "Surface", "Design", "Studies", "Build"):
        one.go(view)
        one.page.locator("main h1").wait_for()
        if view != "Sessions":  # they are called by letters
            one.page.get_by_text(NAME).first.wait_for(state="attached", timeout=30_000)
        nothing_ran(one)
    one.page.unroute_all()
    assert one.faults == []
    for place in ("sessions", "design", "calibration/checks", "studies", "build"):  # not there
        one.page.goto(f"{address}#/{place}/{urllib.parse.quote(NAME, safe='')}")
        one.page.locator(".problem").wait_for()
        nothing_ran(one)
    assert one.foreign == []
    one.faults.clear()  # the browser tells of what was not there
    one.go("Rig")


def test_one_fires_the_other_is_told_and_a_crash_fires_nothing_again(
    visits: tuple[Visit, Visit], serving: Serving, box: FakeTrigger
) -> None:
    """As soon after each other as two people can: neither page has heard of the other's."""
    before = len(read(f"{serving.address}v1/captures")["items"])
    was = pulses(box)
    for visit, name in zip(visits, ("anna", "bert"), strict=True):
        visit.go("Rig")
        visit.see("Trigger box: ready")
        visit.page.get_by_label("Session", exact=True).fill("a-crash")
        visit.page.get_by_label("Operator").fill(name)
        visit.page.get_by_label("Shots", exact=True).fill(str(SHOTS))
        visit.page.get_by_label("Between shots, ms").fill("500")
    for visit in visits:
        visit.page.get_by_role("button", name="Fire", exact=True).evaluate("b => b.click()")
    one, other = visits
    other.see("asked for by 'anna'")
    wait_for(lambda: pulses(box) >= was + 2)
    serving.end(signal.SIGKILL)
    for visit in visits:
        visit.see("The service does not answer")
    serving.begin()
    for visit in visits:
        visit.page.locator("#service.good").wait_for()
        visit.see("Trigger box: ready")
    one.see("was interrupted after it may have fired")
    newest, *older = read(f"{serving.address}v1/captures")["items"]
    assert (newest["status"], len(older)) == ("interrupted", before)
    fired = pulses(box)
    assert fired <= was + SHOTS
    one.page.wait_for_timeout(1500)  # thrice the time between shots, and a look of every page
    assert pulses(box) == fired
    assert len(read(f"{serving.address}v1/captures")["items"]) == before + 1
    for visit in visits:
        visit.faults.clear()  # the browser tells of what nobody answered


def test_a_session_is_looked_at_and_proven(visits: tuple[Visit, Visit]) -> None:
    _, other = visits
    other.go("Sessions")
    other.page.get_by_role("link", name="anna").click()
    other.page.locator(".sheet img").nth(1).wait_for()
    other.press("Prove it whole")
    other.see("Whole: 2 captures,")
    with other.page.expect_download() as told:
        other.page.get_by_role("link", name="All of it as a ZIP").click()
    with zipfile.ZipFile(told.value.path()) as archive:
        assert archive.testzip() is None
        assert "anna/session.json" in archive.namelist()
    other.sound()


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
    one.page.get_by_label("Session", exact=True).select_option("a-crash")
    one.page.get_by_label("Capture", exact=True).get_by_text("none in this session").wait_for(
        state="attached"
    )
    one.press("Reconstruct")
    one.see("session a-crash holds no capture; choose another")
    assert bodies == []
    one.page.get_by_label("Session", exact=True).select_option("anna")
    one.page.get_by_label("Capture", exact=True).get_by_text("none").wait_for(state="detached")
    one.press("Reconstruct")
    one.see("too many wait")
    one.page.unroute_all()
    one.faults.clear()  # the browser tells of the refusal on its console
    (asked,) = [ReconstructionBody.model_validate_json(body) for body in bodies]
    assert (asked.design_id, asked.calibration_id, asked.pictures.session) == ("d1", None, "anna")
    assert len(asked.pictures.captures) == 1


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
    one.page.get_by_text("From a study file", exact=True).click()
    given = [ROOT / "examples/studies" / name for name in ("wall.toml", "wall-rig.toml")]
    one.page.get_by_label("Study file and its rig files").set_input_files(given)
    one.see("Not here: targets.xyz.")
    scans[0]["filename"] = "targets.xyz"
    one.go("Rig")
    one.go("Studies")
    one.page.get_by_text("From a study file", exact=True).click()
    one.page.get_by_label("Study file and its rig files").set_input_files(given)
    one.press("Compare as the file says")
    one.see("too many wait")
    one.page.unroute_all()
    one.faults.clear()  # the browser tells of the refusal on its console
    asked, as_filed = [StudyBody.model_validate_json(body) for body in bodies]
    assert (as_filed.scan_ids, as_filed.study.grid.cameras) == (["anna"], [3, 4, 5, 6])
    grid = asked.study.grid
    assert (asked.scan_ids, grid.cameras, grid.seed) == (["anna", "bert"], [3, 4, 5], [1, 2])
    assert list(grid.form or ()) == ["free", "symmetric"]


def test_a_job_that_begins_is_seen_to_before_its_first_progress(
    visits: tuple[Visit, Visit],
) -> None:
    """Of a job that only the browser is told of: its process loads for seconds."""
    one, _ = visits
    links = {"self": "/v1/studies/slow", "events": "/v1/studies/slow/events"}
    job = {"id": "slow", "status": "pending", "progress": None, "links": links}
    one.page.route("**/v1/studies/slow", lambda route: route.fulfill(json=job))
    told = {"status": 200, "content_type": "text/event-stream"}
    one.page.route("**/v1/studies/slow/events", lambda route: route.fulfill(**told, body=""))
    one.page.goto(f"{one.address}#/studies/slow")
    one.see("waits for its turn")
    begun = 'event: running\ndata: {"status": "running"}\n\n'
    one.page.route("**/v1/studies/slow/events", lambda route: route.fulfill(**told, body=begun))
    one.see("begins")
    one.page.unroute_all()
    one.go("Rig")


@pytest.mark.parametrize("view", ["Calibration", "Surface", "Design", "Studies", "Build"])
def test_views_of_an_empty_service(visits: tuple[Visit, Visit], view: str) -> None:
    one, _ = visits
    one.go(view)
    one.page.locator("main h1").wait_for()
    one.page.wait_for_load_state("networkidle")
    one.sound()


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
