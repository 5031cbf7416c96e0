"""Pages: what stands on them, that nothing is loaded, that names do no harm."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from dataclasses import replace
from html.parser import HTMLParser
from typing import Any

import calibrations
import numpy as np
import pytest
from drawn_pages import parts

from calibration.adjustment.residualgrid import GridCell
from calibration.adjustment.result import Calibration
from calibration.check import CheckOptions, CheckResult, check
from calibration.check.verdicts import Kind
from calibration.detection.detections import Detections
from calibration.detection.pictures import DetectedPictures, TakenPicture
from calibration.files import CalibrationRecord, CheckRecord
from calibration.report import calibration_page, check_page, history_of, history_page, history_svg
from calibration.report.network import network_figures, target_places
from calibration.report.residualplot import residual_plot
from calibration.report.views import detection_views
from common.page.svg import Series, chart

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


def without_scripts(page: str) -> str:
    """A page with figures without its scripts: plotly, the figures, and what draws them."""
    before, start, _ = page.partition('\n<script type="text/plain"')
    assert start
    return before + page[page.rindex("</script>") + len("</script>") :]


def figure_of(page: str) -> dict[str, Any]:
    """The figure that the page's script draws."""
    found: dict[str, Any] = json.loads(parts(page)["packed"])["figure"]
    return found


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


def test_what_is_wrong_stands_out_in_words_and_plain_figures() -> None:
    reference, result = calibrations.small_reference(), moved_check(3000.0, 1)
    moved = next(c for c in result.cameras if c.verdict is Kind.CAMERA_MOVED)
    assert moved.pose_statistic / moved.pose_limit > 1e3
    page = check_page(CheckRecord("rig", "2026-11-22T10:00:00Z", result), reference, "history.html")
    assert f'<tr class="bad"><td>{moved.name}</td><td>camera moved</td>' in page
    assert page.count('<tr class="bad">') == 1
    assert "e+0" not in page
    assert '<a href="history.html">' in page
    assert "<a " not in check_page(CheckRecord("rig", "", result))


def test_arrows_of_residuals_stay_within_their_drawing() -> None:
    corners = [
        GridCell(x, y, dx, dy, 1) for x, dx in ((0, -1), (99, 1)) for y, dy in ((0, -1), (79, 1))
    ]
    figure = ET.fromstring(  # noqa: S314 - written by ourselves
        residual_plot(corners, (100, 80), "cam").partition("<figcaption>")[0]
    )
    width, height = (float(v) for v in figure.attrib["viewBox"].split()[2:])
    for arrow in figure.findall("line"):
        assert 0.0 <= float(arrow.attrib["x2"]) <= width
        assert 0.0 <= float(arrow.attrib["y2"]) <= height


def test_names_at_one_place_of_a_chart_do_not_cover_each_other() -> None:
    series = [Series(f"cam{k}", (0.1, value)) for k, value in enumerate((1.0, 1.01, 1.02, 9.0))]
    figure = ET.fromstring(chart(("a", "b"), series, 0.0, "", ""))  # noqa: S314 - our own
    at = sorted(float(t.attrib["y"]) for t in figure.findall("text") if str(t.text)[:3] == "cam")
    assert len(at) == 4 and min(np.diff(at)) >= 11.0  # the size of the letters


def test_the_calibration_page_has_all_cameras() -> None:
    page = calibration_page(CalibrationRecord(NASTY, "2026-11-22", calibrations.small_reference()))
    reader = parsed(without_scripts(page))
    assert all(f"<td>cam{k}</td>" in page for k in range(1, 6))
    assert reader.seen.count("svg") == 5 + 2
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
    # What the drift explains of the others' tests is left out, so none of them is in alarm.
    others = [v for k, c in enumerate(history.cameras) if k != 2 for v in c.load if np.isfinite(v)]
    assert others and drifting.load[-1] > 2.0 * max(others)
    figure = ET.fromstring(history_svg(history))  # noqa: S314 - written by ourselves
    drawn = [v for c in history.cameras for v in c.load if np.isfinite(v)]
    assert len(drawn) >= 4 and len(figure.findall("circle")) == len(drawn)
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


def test_the_calibration_page_has_the_values_and_where_all_stands() -> None:
    reference = calibrations.small_reference()
    page = calibration_page(CalibrationRecord("small", "2026-11-01", reference))
    for camera in reference.cameras:
        assert f"{camera.interior.focal_length_px:.2f}" in page
        assert all(f"{v:.2f}" in page for v in camera.pose.position_rig_mm)
    drawings = network_figures(reference)
    assert drawings.count("<svg") == 2
    # Each view has a dot for each camera and each place of a target.
    assert drawings.count("<circle") == 2 * (len(reference.cameras) + len(target_places(reference)))


def test_the_figure_that_turns_has_every_camera_where_it_stands() -> None:
    reference = calibrations.small_reference()
    nasty = replace(reference.cameras[0], name=NASTY)
    told = replace(reference, cameras=(nasty, *reference.cameras[1:]))
    page = calibration_page(CalibrationRecord("small", "", told))
    assert NASTY not in page
    targets, _, cameras = figure_of(page)["data"]
    assert len(targets["x"]) == len(target_places(reference))
    stand = np.array([cameras[axis] for axis in "xyz"]).T
    places = np.array([c.pose.position_rig_mm for c in reference.cameras])
    # Written to a hundredth of a millimetre.
    assert np.abs(stand - places).max() <= 0.005 + 1e-9


def test_of_each_camera_the_picture_with_most_targets_is_shown_with_marks_on_them() -> None:
    pictures = [
        TakenPicture(camera, frame, np.full((300, 600), 90, np.uint8))
        for camera, frame in (("a", "1"), ("a", "2"), ("b", "1"))
    ]
    detections = (found(1), found(3), found(2))
    seen = DetectedPictures(calibrations.small_scene().observe(0.1, 1), tuple(pictures), detections)
    one, other = detection_views(seen)
    assert (one.camera, one.frame, other.camera) == ("a", "2", "b")
    assert one.size_px == (480, 240)
    # 600 pixels become 480: the middle of pixel 9 lies at 9.5 x 0.8.
    assert np.allclose(one.marks_px[0], [9.5 * 0.8, 19.5 * 0.8])
    page = calibration_page(
        CalibrationRecord("small", "", calibrations.small_reference()), (one, other)
    )
    own = parsed(without_scripts(page))
    assert own.seen.count("image") == 2
    assert "a, 2: 3 targets" in page and "What was detected" in page


def found(count: int) -> Detections:
    return Detections(
        (600, 300),
        tuple(f"t{k}" for k in range(count)),
        np.array([[9.0 + 10.0 * k, 19.0] for k in range(count)]),
        np.full((count, 2), 0.05),
        np.full(count, 0.8),
    )


def test_places_of_targets_are_those_that_the_cameras_saw() -> None:
    scene = calibrations.small_scene()
    reference = calibrations.small_reference()
    places = target_places(reference)
    assert len(places) == sum(
        int(np.isfinite(reference.target_mm[start : start + count]).all(axis=1).sum())
        for place in reference.places
        for start, count in [_span(reference, place.carrier)]
    )
    # Everything stands before the cameras, as the scene has it.
    for camera in scene.cameras:
        assert (camera.pose.to_camera(places)[:, 2] > 0.0).all()


def _span(reference: Calibration, name: str) -> tuple[int, int]:
    start = 0
    for carrier in reference.targets.carriers:
        if carrier.name == name:
            return start, len(carrier.ids)
        start += len(carrier.ids)
    raise AssertionError(name)


def test_a_camera_that_is_fine_shows_no_alarm() -> None:
    result = moved_check(400.0, 3)
    loads = {c.name: c.pose_statistic / c.pose_limit for c in result.cameras}
    fine = [c for c in result.cameras if c.verdict is Kind.FINE]
    # Where one camera has moved far, the tests of others answer too: the very case.
    assert fine and max(loads[c.name] for c in fine) > 1.0
    record = CheckRecord("rig", "2026-11-22", result)
    assert check_page(record).count("<td>explained</td>") == sum(loads[c.name] > 1.0 for c in fine)
    history = history_of([record], "rig")
    traces = {c.name: c.load[0] for c in history.cameras}
    assert all(not traces[c.name] > 1.0 for c in fine)
