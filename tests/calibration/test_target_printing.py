"""Printed sheets, made into pictures again and measured by detection."""

from __future__ import annotations

import re

import numpy as np
import pytest

from calibration.detection.finding import find_targets
from calibration.targets.boards import AprilGrid, Chessboard, DotGrid
from calibration.targets.kinds import (
    CarrierKind,
    CharucoPlate,
    MarkerCarrier,
    RingCarrier,
    TargetPlace,
    TargetPlan,
)
from calibration.targets.printing import carrier_drawings, page_size, to_pdf, to_svg
from calibration.targets.sheets import marker_sheet, ring_sheet, scale_bar
from common.errors import InputError
from geometry.arrays import Floats

pypdfium2 = pytest.importorskip("pypdfium2")

SHEETS: tuple[tuple[CarrierKind, str, int], ...] = (
    (CharucoPlate("plate", 9, 6, 20.0, 15.0, "DICT_5X5_100"), "A4 landscape", 100),
    (CharucoPlate("white", 5, 4, 20.0, 15.0, "DICT_4X4_50", inverted=True), "160x160", 100),
    (marker_sheet("markers", "DICT_4X4_50", range(6), 30.0, 3), "A4", 60),
    (ring_sheet("rings", range(1, 9), 3.0), "160x120", 110),
    (scale_bar("bar", (1, 2, 3), (150.0, 300.0), 4.0, 14)[0], "400x80", 120),
    (Chessboard(name="chess", columns=5, rows=4, square_mm=20.0), "140x140", 80),
    (AprilGrid(name="grid", columns=3, rows=2, tag_mm=30.0, gap_mm=9.0), "160x140", 80),
    (
        DotGrid(
            name="dots", columns=3, rows=5, spacing_mm=14.0, dot_radius_mm=4.0, asymmetric=True
        ),
        "140x140",
        80,
    ),
)


def pages(kind: CarrierKind, page: str, dpi: float) -> list[np.ndarray]:
    document = pypdfium2.PdfDocument(to_pdf(carrier_drawings(kind, page), kind.name))
    try:
        return [
            np.asarray(p.render(scale=dpi / 72.0, grayscale=True).to_numpy()).squeeze().copy()
            for p in document
        ]
    finally:
        document.close()


def softened(image: np.ndarray) -> np.ndarray:
    """Paper is neither wholly white nor black, and no camera is as sharp as a rasteriser."""
    from scipy.ndimage import gaussian_filter

    return np.rint(30.0 + gaussian_filter(image.astype(float), 0.7) * 190.0 / 255.0).astype(
        np.uint8
    )


@pytest.mark.parametrize(("kind", "page", "dpi"), SHEETS, ids=lambda v: getattr(v, "name", ""))
def test_a_sheet_has_its_size_when_printed(kind: CarrierKind, page: str, dpi: int) -> None:
    (image,) = pages(kind, page, dpi)
    width, height = page_size(page)
    assert image.shape == pytest.approx((height * dpi / 25.4, width * dpi / 25.4), abs=1.0)
    # The rasteriser fits the page into whole pixels.
    pixel_mm = np.array([width / image.shape[1], height / image.shape[0]])
    found = find_targets(softened(image), TargetPlan("set", (kind,)))
    assert found.ids == kind.ids
    # The rasteriser places edges to 1/16 pixel or so; a plate's corners and dots average that.
    measured = np.asarray(found.pixel) * pixel_mm
    nominal = kind.carrier().nominal_mm[:, :2]
    off = (measured - measured.mean(axis=0)) - (nominal - nominal.mean(axis=0))
    assert np.abs(off).max() < 0.1 * 25.4 / dpi
    scale = (measured * nominal).sum() - len(nominal) * (measured.mean(0) * nominal.mean(0)).sum()
    scale /= ((nominal - nominal.mean(axis=0)) ** 2).sum()
    assert scale == pytest.approx(1.0, abs=3e-4)


def test_the_ruler_is_as_long_as_it_says() -> None:
    dpi = 300
    (image,) = pages(scale_bar("bar", (1, 2), (100.0,), 3.0)[0], "180x70", dpi)
    # The row of pixels through the tall ticks: black begins at their left edges.
    base = image.shape[0] - int((8.0 + 10.0 + 4.0) / 25.4 * dpi)
    black = image[base] < 128
    starts = np.flatnonzero(black[1:] & ~black[:-1]) + 1
    # Only 0, 50 and 100 mm are that tall; a pixel at either end.
    assert (starts - starts[0]) * 25.4 / dpi == pytest.approx(
        [0.0, 50.0, 100.0], abs=2 * 25.4 / dpi
    )


def svg_polygons(text: str) -> list[Floats]:
    return [
        np.array([[float(v) for v in pair.split(",")] for pair in part.rstrip("Z").split("L")])
        for path in re.findall(r' d="([^"]+)"', text)
        for part in path.split("M")[1:]
    ]


def test_svg_and_pdf_are_drawn_alike() -> None:
    kind = ring_sheet("rings & dots", (1, 2), 3.0)
    (drawing,) = carrier_drawings(kind, "A4")
    text = to_svg(drawing)
    assert 'width="210mm" height="297mm" viewBox="0 0 210 297"' in text
    assert "rings &amp; dots" in text
    drawn = [p for area in drawing.areas for p in area.polygons]
    for got, wanted in zip(svg_polygons(text), drawn, strict=True):
        assert got == pytest.approx(wanted, abs=1e-5)
    assert np.ptp(drawn[0][:, 0]) == pytest.approx(6.0, abs=1e-3)


def test_targets_without_places_fill_as_many_pages_as_they_need() -> None:
    kind = RingCarrier("stand", 14.0, tuple(TargetPlace(n) for n in range(1, 6)))
    assert len(carrier_drawings(kind, "A4")) == 3
    seen: set[str] = set()
    for image in pages(kind, "A4", 25):
        seen |= set(find_targets(softened(image), TargetPlan("set", (kind,))).ids)
    assert seen == set(kind.ids)


def test_sheets_that_cannot_be_are_refused() -> None:
    plate = CharucoPlate("plate", 12, 9, 20.0, 15.0, "DICT_5X5_100")
    with pytest.raises(InputError, match="takes 250 x 190 mm, the page has room for 194 x 259"):
        carrier_drawings(plate, "A4")
    assert len(carrier_drawings(plate, "A3")) == 1
    for page in ("A5x", "10x10", "1x2x3", "A4 portrait", "axb"):
        with pytest.raises(InputError, match="there is no page"):
            page_size(page)
    solid = MarkerCarrier(
        "cube",
        "DICT_4X4_50",
        20.0,
        (TargetPlace(1, (0.0, 0.0, 0.0)), TargetPlace(2, (0.0, 0.0, 50.0))),
    )
    with pytest.raises(InputError, match="is not flat"):
        carrier_drawings(solid)
