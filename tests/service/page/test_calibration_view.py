"""Targets in a real browser: given as they are, and where they are still lacking."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import httpx2
import pytest
from browsers import chromium
from page_visits import Visit, served
from plate_pictures import practice_in, put_plate
from service_helpers import wait_for
from stations import write_station

from service.api.acceptances import AcceptanceBody

if TYPE_CHECKING:
    from playwright.sync_api import Route

pytestmark = pytest.mark.needs_browser
JSON = dict[str, Any]


def captured(address: str, capture_id: str) -> JSON:
    body = {"capture_id": capture_id, "session": "anna"}
    made = httpx2.post(f"{address}v1/rigs/studio/captures", json=body)
    own = address.rstrip("/") + made.json()["links"]["self"]
    found: JSON = wait_for(lambda: httpx2.get(own).json()["result"])["record"]
    return found


@pytest.mark.slow
def test_targets_are_given_and_the_empty_part_of_each_field_is_shown(tmp_path: Path) -> None:
    practice = practice_in(tmp_path)
    session = tmp_path / "data/sessions/anna"
    station = write_station(tmp_path / "rig")
    with served(tmp_path / "data", station) as address, chromium() as browser:
        one = Visit(browser, address)
        one.see("Trigger box: ready")
        put_plate(practice, session, captured(address, "one"))
        one.go("Calibration")
        one.page.get_by_label("Target file").set_input_files(practice / "station.toml")
        one.page.locator(".problem", has_text="station.toml").wait_for()
        assert len(one.faults) == 1, one.faults  # the browser tells of the refusal
        one.faults.clear()
        one.page.get_by_label("Target file").set_input_files(practice / "targets.toml")
        one.page.get_by_label("Targets", exact=True).first.wait_for(state="attached")
        with zipfile.ZipFile(tmp_path / "elsewhere.zip", "w") as archive:
            for camera in ("cam01", "cam02"):
                archive.write(practice / "plate.png", f"{camera}/0001.png")
        one.page.get_by_label("Pictures", exact=True).set_input_files(tmp_path / "elsewhere.zip")
        one.page.get_by_label("Pictures of them").locator(
            "option", has_text="elsewhere.zip"
        ).wait_for(state="attached")
        one.page.get_by_text("Where are targets still lacking?").press("Enter")
        one.see("1 capture looked at. Next: hold the plate")
        shown = one.page.locator(".cells")
        assert shown.nth(0).locator(".full").count() > 3
        assert shown.nth(1).locator(".full").count() == 0
        one.see("in the picture of cam02.")
        one.sound()
        captured(address, "two")
        one.see("2 captures looked at.")
        a_bar_is_tested(one)


def a_bar_is_tested(one: Visit) -> None:
    """With a calibration, and of a test, that only the browser is told of."""
    links = {word: f"/v1/none/{word}" for word in ("self", "files", "events")}
    job = {"status": "completed", "created_at": "2026-01-31T12:00:00Z", "problem": None}
    length = {
        "line": "diagonal", "first": "a", "second": "b", "calibrated_mm": 500.0,
        "measured_mm": 500.0123, "error_um": 12.3, "limit_um": 60.0, "within": True,
    }  # fmt: skip
    result = {
        "outcome": "passed", "text": "It passed.", "missing": [], "notes": [], "lines": 7,
        "largest_um": 12.3, "rms_um": 8.0, "lengths": [length],
    }  # fmt: skip
    calibrated = {**job, "id": "c1", "links": links, "result": {"cameras": [], "rms_px": 0.1}}
    tested = {**job, "id": "a1", "links": links, "result": result}
    bodies: list[str] = []

    def ask(route: Route) -> None:
        bodies.append(str(route.request.post_data))
        route.fulfill(json=tested, status=201)

    listed = {"items": [calibrated], "next": None}
    one.page.route("**/v1/calibrations?*", lambda route: route.fulfill(json=listed))
    one.page.route("**/v1/acceptances", ask)
    one.page.route("**/v1/acceptances/a1", lambda route: route.fulfill(json=tested))
    one.page.route("**/v1/none/files", lambda route: route.fulfill(json={"items": []}))
    one.go("Rig")
    one.go("Calibration")
    one.page.get_by_label("Pictures of the bar").select_option("sanna")
    one.page.get_by_label("Temperature, °C").fill("21.5")
    one.sound()
    one.press("Test it")
    one.see("It passed.")
    row = one.page.get_by_role("row", name="diagonal: a to b").locator("td")
    assert row.all_inner_texts()[1:] == ["500 mm", "500.0123 mm", "12.3 µm", "60 µm", "within"]
    one.sound()
    (asked,) = [AcceptanceBody.model_validate_json(body) for body in bodies]
    assert (asked.calibration_id, asked.pictures.session) == ("c1", "anna")
    assert asked.temperature_degc == 21.5
