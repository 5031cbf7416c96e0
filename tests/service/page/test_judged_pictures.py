"""Pictures in a real browser: sharp or not, whole or not, rejected or not, taken again."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import httpx2
import numpy as np
import pytest
from browsers import chromium
from page_visits import Visit, served
from service_helpers import wait_for
from stations import write_station

if TYPE_CHECKING:
    from playwright.sync_api import Locator

pytestmark = pytest.mark.needs_browser
JSON = dict[str, Any]


def asked(method: str, address: str, **more: Any) -> JSON:  # noqa: ANN401 - whatever is sent
    answer = httpx2.request(method, address, headers={"X-Rigwright": "1"}, **more)
    answer.raise_for_status()
    found: JSON = answer.json()
    return found


def captured(address: str, capture_id: str) -> JSON:
    body = {"capture_id": capture_id, "session": "anna"}
    own = (
        address.rstrip("/")
        + asked("POST", f"{address}v1/rigs/studio/captures", json=body)["links"]["self"]
    )
    return wait_for(lambda: asked("GET", own)["result"])


def put_pictures(session: Path, record: JSON) -> None:
    """A sharp picture, a soft one and one that is cut off in the places of the three."""
    board = np.kron(np.indices((12, 18)).sum(axis=0) % 2, np.ones((16, 16)))
    sharp = (40 + 170 * board).astype(np.uint8)
    # Far above the 1.5 pixels that still count as sharp.
    soft = cv2.GaussianBlur(sharp, (0, 0), 4.0)
    shown = ((sharp, 1.0), (soft, 1.0), (sharp, 0.7))
    for frame, (picture, share) in zip(record["frames"], shown, strict=True):
        path = session / frame["file"]["path"]
        data = cv2.imencode(path.suffix, picture)[1].tobytes()
        path.write_bytes(data[: round(share * len(data))])


def rejected(address: str) -> list[tuple[str, str | None, str]]:
    marks = asked("GET", f"{address}v1/sessions/anna/marks")["rejected"]
    return [(mark["capture_id"], mark["camera"], mark["why"]) for mark in marks]


@pytest.mark.slow
def test_pictures_are_judged_rejected_and_taken_again(tmp_path: Path) -> None:
    station = write_station(tmp_path / "rig", cameras=3)
    with served(tmp_path / "data", station) as address, chromium() as browser:
        record = captured(address, "one")["record"]
        put_pictures(tmp_path / "data/sessions/anna", record)
        for width, scheme in ((1440, "light"), (820, "dark")):
            one = Visit(browser, address, width)
            one.page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
            one.see("Trigger box: ready")
            look_and_mark(one, address)
            take_again(one, address)
            one.page.context.close()


def opened(one: Visit) -> Locator:
    """The pictures of capture ``one`` in the view of its session."""
    sheet = one.page.locator("details.card", has_text="one,")
    sheet.locator("summary").first.wait_for()
    if sheet.get_attribute("open") is None:
        sheet.locator("summary").first.press("Enter")
    return sheet


def look_and_mark(one: Visit, address: str) -> None:
    one.page.goto(f"{address}#/sessions/anna")
    sheet = opened(one)
    first, second, third = (sheet.locator("figure").nth(k) for k in range(3))
    third.locator(".state", has_text="not whole").wait_for()
    told = [figure.locator(".looks .state").all_inner_texts()[:2] for figure in (first, second)]
    assert told == [["sharp", "whole"], ["not sharp", "whole"]]
    button = first.get_by_role("button", name="Reject the picture of cam01", exact=True)
    assert button.get_attribute("aria-pressed") == "false"
    button.press("Enter")
    sheet.locator("figure.rejected").wait_for()
    assert rejected(address)[-1] == ("one", "cam01", "")
    one.sound()
    one.page.reload()
    opened(one).locator("figure.rejected").wait_for()
    assert button.get_attribute("aria-pressed") == "true"
    button.press("Space")
    sheet.locator("figure:not(.rejected)").nth(2).wait_for()
    assert ("one", "cam01", "") not in rejected(address)


def take_again(one: Visit, address: str) -> None:
    one.go("Rig")
    one.page.get_by_label("Session").fill("anna")
    one.press("Fire")
    one.page.locator(".result .looks .state").first.wait_for()
    former = one.page.locator(".result h2").inner_text()
    one.press("Retake")
    one.page.wait_for_function(
        "was => ![undefined, was].includes(document.querySelector('.result h2')?.textContent)",
        arg=former,
    )
    now = one.page.locator(".result h2").inner_text()
    one.page.locator(".result .looks .state").nth(1).wait_for()
    assert rejected(address)[-1] == (former, None, f"taken again as {now}")
    one.press("Reject the capture")
    one.page.locator(".result figure.rejected").nth(2).wait_for()
    assert rejected(address)[-1] == (now, None, "")
    one.sound()
