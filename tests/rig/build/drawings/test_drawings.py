"""Drawings: sound files, the same every time, legible, and nothing over anything else."""

from __future__ import annotations

import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import plan_readers as read
import pypdfium2
import pytest
from plans import plate_plan, tslot_plan

from common.errors import InputError
from rig.build.drawings import (
    Sheet,
    dxf_bytes,
    pdf_bytes,
    plate_sheets,
    setting_sheets,
    svg_bytes,
    template_pages,
    template_sheet,
    view_sheets,
)
from rig.build.drawings.annotate import spread
from rig.build.drawings.figures import fixed, setting_text
from rig.build.drawings.frame import A3_LANDSCAPE_MM, fitted
from rig.build.drawings.items import Dimension, Line, Text, dimension_parts
from rig.build.drawings.pdf import text_width_mm
from rig.build.drawings.tables import Table, table_items, table_sheets
from rig.build.mounts.settings import Setting

ROOT = Path(__file__).resolve().parents[4]
SHEETS: dict[str, Callable[[], tuple[Sheet, ...]]] = {
    "t-slot views": lambda: view_sheets(tslot_plan(5)),
    "plate views": lambda: view_sheets(plate_plan()),
    "plate": lambda: plate_sheets("Array", plate_plan().structure.plates[0]),
    "template": lambda: (template_sheet(plate_plan().structure.plates[0]),),
    "tiles": lambda: template_pages(plate_plan().structure.plates[0]),
    "settings": lambda: setting_sheets(tslot_plan(3)),
}


@pytest.fixture(params=SHEETS, scope="module")
def sheets(request: pytest.FixtureRequest) -> tuple[Sheet, ...]:
    return SHEETS[request.param]()


def test_dxf_passes_the_audit_and_is_in_millimetres(sheets: tuple[Sheet, ...]) -> None:
    document = read.read_dxf(dxf_bytes(sheets))
    audit = document.audit()
    assert not audit.errors and not audit.fixes
    assert document.header["$INSUNITS"] == 4
    assert len(document.modelspace()) >= sum(len(sheet.items) for sheet in sheets) / 2


def test_pdf_pages_have_their_size_and_ink(sheets: tuple[Sheet, ...]) -> None:
    document = pypdfium2.PdfDocument(pdf_bytes(sheets, "x"))
    assert len(document) == len(sheets)
    for page, sheet in zip(document, sheets, strict=True):
        size = np.array(page.get_size()) / read.POINTS_PER_MM
        assert size == pytest.approx([sheet.width_mm, sheet.height_mm], abs=0.01)
        pixels = np.asarray(page.render(scale=0.5).to_pil().convert("L"))
        assert 0.001 < (pixels < 128).mean() < 0.2


def test_svg_is_well_formed_and_in_millimetres(sheets: tuple[Sheet, ...]) -> None:
    root = ET.fromstring(svg_bytes(sheets, "x"))  # noqa: S314 -- made just now
    assert root.attrib["width"].endswith("mm")
    assert len(root.findall(f"{read.SVG}g")) == len(sheets)
    texts = sum(isinstance(i, Text | Dimension) for s in sheets for i in s.items)
    assert len(list(root.iter(f"{read.SVG}text"))) == texts


def boxes(sheet: Sheet) -> list[tuple[str, np.ndarray]]:
    """Words and boxes (left, low, right, high) of all texts of a sheet."""
    items = [
        p for i in sheet.items for p in (dimension_parts(i) if isinstance(i, Dimension) else [i])
    ]
    out = []
    for text in (item for item in items if isinstance(item, Text)):
        wide = text_width_mm(text.words, text.height_mm, bold=text.bold)
        start = {"start": 0.0, "middle": -wide / 2.0, "end": -wide}[text.anchor]
        box = np.array([[start, 0.0], [start + wide, text.height_mm]])
        if text.angle_deg == 90.0:
            box = np.array([[-box[1, 1], box[0, 0]], [-box[0, 1], box[1, 0]]])
        out.append((text.words, (box + np.array([text.x_mm, text.y_mm])).ravel()))
    return out


def test_no_text_covers_another_and_all_are_on_the_sheet(sheets: tuple[Sheet, ...]) -> None:
    for sheet in sheets:
        placed = boxes(sheet)
        for k, (words, one) in enumerate(placed):
            assert one[:2].min() > 3.0 and one[2] < sheet.width_mm - 3.0, words
            assert one[3] < sheet.height_mm - 3.0, words
            for others, other in placed[:k]:
                over = np.minimum(one[2:], other[2:]) - np.maximum(one[:2], other[:2])
                assert over.min() < 0.15, f"{words!r} over {others!r} on {sheet.title}"


def test_no_setting_sheet_leaves_words_out() -> None:
    for sheet in setting_sheets(tslot_plan(2)):
        for words in (item.words for item in sheet.items if isinstance(item, Text)):
            assert "…" not in words, f"cut off on {sheet.title}"


def test_words_that_are_too_wide_for_a_table_go_on_below() -> None:
    long = "the middle slot of U1 to the middle slot of the arm, right positive seen from behind"
    table = Table("Set", ("Setting", "From"), (("across", long), ("reach", "the stub")), wraps=True)
    items = [item for item in table_items(table, 0.0, 100.0, 60.0) if isinstance(item, Text)]
    last = [item for item in items if item.x_mm > 10.0 and item.words != "From"]
    assert " ".join(item.words for item in last) == f"{long} the stub"
    rows = [item.y_mm for item in last]
    assert rows == sorted(rows, reverse=True) and len(set(rows)) == len(rows) > 2
    assert max(i.x_mm + text_width_mm(i.words, i.height_mm) for i in last) < 60.0
    assert 100.0 - table.height_mm(60.0) < min(rows)


def test_texts_can_be_read(sheets: tuple[Sheet, ...]) -> None:
    for sheet in sheets:
        assert min(i.height_mm for i in sheet.items if isinstance(i, Text)) >= 1.6


@pytest.mark.slow
def test_equal_plans_give_equal_files_in_another_process() -> None:
    code = (
        "import hashlib, plans; from rig.build.drawings import *;"
        "s = view_sheets(plans.tslot_plan(2));"
        "print(*(hashlib.sha256(b).hexdigest() for b in "
        "(dxf_bytes(s), svg_bytes(s, 'x'), pdf_bytes(s, 'x'))))"
    )
    path = f"import sys; sys.path[:0] = [{str(ROOT)!r}, {str(ROOT / 'tests/support')!r}];"
    runs = {
        subprocess.run(
            [sys.executable, "-c", path + code], capture_output=True, text=True, check=True
        ).stdout
        for _ in range(2)
    }
    assert len(runs) == 1


def test_many_cameras_are_named_in_one_view_only() -> None:
    sheet = view_sheets(tslot_plan(41))[0]
    words = [i.words for i in sheet.items if isinstance(i, Text)]
    assert all(words.count(f"c{k}") == 1 for k in range(1, 42))
    few = view_sheets(tslot_plan(12))[0]
    assert [i.words for i in few.items if isinstance(i, Text)].count("c3") == 4, "and the table"


def test_dimensions_in_dxf_measure_what_they_say() -> None:
    document = read.read_dxf(dxf_bytes(view_sheets(tslot_plan(5))))
    found = list(document.modelspace().query("DIMENSION"))
    assert len(found) == 4
    for dimension in found:
        assert float(dimension.dxf.text) == pytest.approx(dimension.get_measurement(), abs=0.05)


def test_a_template_is_in_true_size_and_its_ruler_is_100_mm() -> None:
    plate = plate_plan().structure.plates[0]
    for sheet in (template_sheet(plate), *template_pages(plate)):
        assert sheet.denominator == 1.0
        rulers = [
            np.ptp(i.points_mm, axis=0)
            for i in sheet.items
            if isinstance(i, Line) and i.style == "mark" and len(i.points_mm) == 2
        ]
        assert any(np.allclose(r, [100.0, 0.0]) for r in rulers)


def test_neighbouring_template_pages_share_their_crosses() -> None:
    plate = plate_plan().structure.plates[0]
    pages = read.pdf_holes(pdf_bytes(template_pages(plate), "x"), 4.4)
    marks = np.round(np.concatenate(pages)).astype(int)
    _, counts = np.unique(marks, axis=0, return_counts=True)
    assert (counts == 2).all() and len(counts) == 8


def test_paper_and_names_that_cannot_be() -> None:
    plate = plate_plan().structure.plates[0]
    with pytest.raises(InputError, match="A4 or A3"):
        template_pages(plate, "Letter")
    evil = '</text><script>alert("&")</script>\x07'
    plan = replace(tslot_plan(2), name=evil)
    sheets = view_sheets(plan)
    assert "script" not in {e.tag for e in ET.fromstring(svg_bytes(sheets, evil)).iter()}  # noqa: S314
    assert not read.read_dxf(dxf_bytes(sheets)).audit().errors
    assert pdf_bytes(view_sheets(replace(plan, name="顔 Rig")), "顔")


def test_ordinates_are_spread_as_little_as_can_be() -> None:
    places = spread(np.array([0.0, 0.5, 10.0, 10.1, 30.0]), 3.0)
    assert (np.diff(places) >= 3.0 - 1e-9).all()
    assert places == pytest.approx([-1.25, 1.75, 8.55, 11.55, 30.0])
    assert len(spread(np.zeros(0), 3.0)) == 0


def test_long_words_are_made_to_fit() -> None:
    short = fitted(Text("x" * 300, 0.0, 0.0, 3.0), 40.0)
    assert short.words.endswith("…") and text_width_mm(short.words, short.height_mm) <= 40.0
    small = fitted(Text("a name a little long", 0.0, 0.0, 3.0), 35.0)
    assert small.words == "a name a little long" and 1.6 <= small.height_mm < 3.0


def test_figures_are_stated_as_finely_as_they_are_set() -> None:
    def setting(value: float, step: float, unit: str = "mm") -> str:
        return setting_text(Setting("s", unit, value, step, -100.0, 1000.0, "here"))

    assert setting(560.0, 1.0) == "560"
    assert setting(12.5, 0.5, "deg") == "12.5"
    assert setting(0.25, 0.25) == "0.25"
    assert setting(12.3456, 0.0) == "12.3" and setting(12.3456, 0.0, "deg") == "12.35"
    assert fixed(-0.04, 1) == "0.0" and fixed(-0.06, 1) == "-0.1"


def test_tables_of_a_whole_rig_fill_their_sheet_in_columns() -> None:
    """Two long tables, one below the other, left two thirds of three sheets empty."""
    rows = tuple((f"m{k}", "2020", f"{k}.0") for k in range(60))
    tables = [Table(title, ("Member", "Profile", "Length mm"), rows) for title in ("One", "Two")]
    (content,) = table_sheets(tables, "Members", A3_LANDSCAPE_MM)
    texts = [item for item in content.items if isinstance(item, Text)]
    left = [t.x_mm for t in texts if t.words.startswith("m")]
    assert len(set(left)) >= 3 and len(left) == 120
    right = max(item.points_mm[:, 0].max() for item in content.items if isinstance(item, Line))
    assert right <= A3_LANDSCAPE_MM[0] - 10.0
    # A4 is as wide as two of them; what a column does not hold goes on a second sheet.
    pages = table_sheets([*tables, *tables], "Members")
    told = [t for page in pages for t in page.items if isinstance(t, Text)]
    assert sum(t.words.startswith("m") for t in told) == 240
    assert sum(t.words == "One" for t in told) == 2 and "Two (continued)" in {t.words for t in told}
