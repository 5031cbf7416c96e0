"""The door of the page, in a real browser: a key, what it may do, and the way out."""

from __future__ import annotations

from pathlib import Path

import pytest
from browsers import chromium
from page_visits import Visit, served
from stations import write_station

from service.keys.keyfile import add_key, revoke_key
from service.keys.scope import Scope

pytestmark = [pytest.mark.needs_browser, pytest.mark.slow]


def test_who_has_a_key_comes_in_and_may_what_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RIGWRIGHT_REQUIRE_KEYS", "true")
    data = tmp_path / "data"
    data.mkdir()
    _, token = add_key(data, "anna", Scope.READ, None)
    with served(data, write_station(tmp_path / "rig")) as address, chromium() as browser:
        one = Visit(browser, address, 820)
        one.see("Your key")
        one.sound()
        one.page.get_by_label("Your key").fill(token)
        one.press("Sign in")
        one.see("anna (read)")
        one.see("Trigger box: ready")
        one.sound()
        one.page.reload()
        one.see("anna (read)")
        one.press("Abort: all outputs off")
        one.see("Your key may look and stop.")
        for button in ("Fire", "Self-test", "Reset the box"):
            assert one.page.get_by_role("button", name=button, exact=True).count() == 0
        for view in ("Design", "Build", "Calibration", "Surface", "Studies"):
            one.go(view)
            one.page.locator("main h1").first.wait_for()
            one.page.wait_for_load_state("networkidle")
            assert one.page.locator("main form:visible").count() == 0
            assert one.page.get_by_role("button", name="Propose targets").count() == 0
        one.go("Rig")
        one.see("Trigger box: ready")
        links = one.page.get_by_role("navigation").get_by_role("link").all()
        assert len({link.bounding_box()["y"] for link in links}) == 1
        one.press("Sign out")
        # By its label: "Your key may look and stop" is there until the door comes.
        one.page.get_by_label("Your key").wait_for()
        assert one.page.get_by_text("Trigger box").count() == 0
        one.page.get_by_label("Your key").fill(token)
        one.press("Sign in")
        one.see("Trigger box: ready")
        revoke_key(data, "anna")
        one.page.get_by_label("Your key").wait_for()
