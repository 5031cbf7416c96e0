"""Pages: what stands on them, that nothing is loaded, that names do no harm."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace
from html.parser import HTMLParser

import calibrations
import numpy as np
import pytest

from calibration.check import CheckOptions, CheckResult, check
from calibration.files import CalibrationRecord, CheckRecord
from calibration.report import calibration_page, check_page, history_of, history_page, history_svg

NASTY = '<script>alert("x")</script>'


class Balanced(HTMLParser):
    """Fails on tags that do not close one another."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append(tag)
        assert all(str(v).startswith("data:") for k, v in attrs if k in ("src", "href"))
        if tag not in ("meta", "link", "line", "circle", "rect"):
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert attrs
        self.seen.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def parsed(page: str) -> Balanced:
    reader = Balanced()
    reader.feed(page)
    assert reader.open == []
    assert "script" not in reader.seen
    assert "http" not in page.replace("http-equiv", "")
    return reader


def moved_check(urad: float, seed: int) -> CheckResult:
    scene = calibrations.disturbed(
        calibrations.check_scene(), 2, turn_rad=np.array([urad * 1e-6, 0.0, 0.0])
    )
    return check(
        calibrations.small_reference(), scene.observe(0.1, seed), CheckOptions(tolerance_mm=0.0)
    )


def test_the_check_page_says_it_in_words_numbers_and_pictures() -> None:
    record = CheckRecord(NASTY, "2026-11-22T10:00:00Z", moved_check(30.0, 1))
    page = check_page(record, calibrations.small_reference())
    reader = parsed(page)
    assert "Camera cam3 has moved" in page
    assert 'aria-label="red"' in page
    assert reader.seen.count("svg") == 5
    assert NASTY not in page
    assert "nan" not in page.replace("nannt", "")


def test_the_calibration_page_has_all_cameras() -> None:
    page = calibration_page(CalibrationRecord(NASTY, "2026-11-22", calibrations.small_reference()))
    reader = parsed(page)
    assert all(f"<td>cam{k}</td>" in page for k in range(1, 6))
    assert reader.seen.count("svg") == 5
    assert NASTY not in page


def test_the_history_shows_which_camera_drifts() -> None:
    records = [
        CheckRecord("rig", f"2026-11-{20 - k:02d}T10:00:00Z", moved_check(6.0 * (4 - k), k))
        for k in range(4)
    ]
    records.append(replace(records[0], reference="another"))
    history = history_of(records, "rig")
    assert history.times == tuple(sorted(r.made_utc for r in records[:-1]))
    drifting = history.cameras[2]
    assert drifting.name == "cam3"
    assert drifting.load[-1] > 1.0
    others = [max(c.load) for k, c in enumerate(history.cameras) if k != 2]
    assert drifting.load[-1] > 2.0 * max(others)
    figure = ET.fromstring(history_svg(history))  # noqa: S314 - written by ourselves
    assert len(figure.findall("circle")) == 5 * 4
    parsed(history_page(history))


def test_a_history_without_checks_is_a_page_all_the_same() -> None:
    page = history_page(history_of([], "rig"))
    parsed(page)


@pytest.mark.parametrize("light", ["green", "yellow", "red"])
def test_every_light_has_its_page(light: str) -> None:
    result = moved_check(0.0, 3)
    if light != "green":
        result = replace(result, light=type(result.light)(light))
    assert f'aria-label="{light}"' in check_page(CheckRecord("rig", "", result))
